"""Multi-process runs, on one machine or several: every process runs the same program.

Only the first process writes files and prints; decisions that depend on clocks or files are
broadcast from it.
"""

import json
import os
from collections.abc import Mapping
from typing import Any

import jax
import numpy as np
from jax.experimental import multihost_utils
from jaxtyping import PyTree

from surrogate.errors import InvalidInput

HEARTBEAT = 10  # seconds without a heartbeat after which a process counts as lost
INITIALISATION = 120  # seconds that processes wait for each other at the start


def join(
    coordinator: str | None = None, processes: int | None = None, process: int | None = None
) -> None:
    """Make this process one of a multi-process run, before the first computation.

    Args:
      coordinator: HOST:PORT of the first process; without it the scheduler that started this
        process (Slurm, Open MPI) provides all three.
      processes: how many there are.
      process: the number of this one, from 0.

    Raises:
      InvalidInput: the other processes did not connect, or an argument is invalid.
    """
    if coordinator is not None:
        if processes is None or process is None or not 0 <= process < processes:
            raise InvalidInput(
                f"process {process} of {processes}: both numbers are needed, from 0 to N - 1 of N"
            )
        if ":" not in coordinator:
            raise InvalidInput(f"coordinator {coordinator!r}: HOST:PORT of the first process")
    try:
        jax.distributed.initialize(
            coordinator,
            processes,
            process,
            initialization_timeout=INITIALISATION,
            heartbeat_timeout_seconds=HEARTBEAT,
        )
    except (RuntimeError, ValueError) as problem:
        reason = str(problem).splitlines()[0]
        raise InvalidInput(f"processes could not connect: {reason}") from None


def scheduled(environment: Mapping[str, str] = os.environ) -> bool:
    """Return whether a scheduler has started several processes of this program."""
    slurm = "SLURM_STEP_NODELIST" in environment and int(environment.get("SLURM_NTASKS") or 1) > 1
    return slurm or int(environment.get("OMPI_COMM_WORLD_SIZE") or 1) > 1


def first() -> bool:
    """Return whether this is the first process, which alone writes files and prints."""
    return jax.process_index() == 0


def broadcast_from_first(tree: PyTree) -> PyTree:
    """Return the first process's values of a pytree, on all processes.

    Shapes must be the same on all of them.
    """
    if jax.process_count() == 1:
        return tree
    return jax.tree.map(np.asarray, multihost_utils.broadcast_one_to_all(tree))


def broadcast_json(value: Any) -> Any:
    """Return the first process's JSON value, on all processes."""
    if jax.process_count() == 1:
        return value
    letters = np.frombuffer(json.dumps(value).encode(), np.uint8)
    size = int(broadcast_from_first(np.asarray(letters.size)))
    letters = letters if first() else np.zeros(size, np.uint8)
    return json.loads(bytes(broadcast_from_first(letters)))


def gather_to_host(array: jax.Array) -> np.ndarray:
    """Return the whole of an array, sharded over the devices of all processes, on the host."""
    if array.is_fully_addressable:
        return np.asarray(array)
    return multihost_utils.process_allgather(array, tiled=True)
