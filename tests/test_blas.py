"""Idle threads of OpenBLAS leave the processor to the flow."""

import os
import subprocess
import sys

import pytest

IDLE = """
import time
import surrogate
import jax
import jax.numpy as jnp
matrix = jnp.eye(70) + jnp.ones((70, 70))
invert = jax.jit(jnp.linalg.inv)
jax.block_until_ready(invert(matrix))
jax.block_until_ready(invert(matrix))
start = time.process_time()
time.sleep(0.1)
print(time.process_time() - start)
"""


@pytest.mark.skipif(os.cpu_count() < 2, reason="one core has no threads of OpenBLAS")
def test_idle_threads_of_openblas_sleep():
    """They would take some 35 ms of the 100."""
    environment = {k: v for k, v in os.environ.items() if not k.startswith("OPENBLAS")}
    done = subprocess.run(
        [sys.executable, "-c", IDLE], env=environment, capture_output=True, text=True, check=True
    )
    assert float(done.stdout) < 0.01
