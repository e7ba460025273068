"""Many processes, on one machine or many, that work as one: all run the same program.

The first alone writes files and speaks; what clocks or files decide is agreed on from it.
"""

import os
from collections.abc import Mapping

import jax
import numpy as np
from jax.experimental import multihost_utils
from jaxtyping import PyTree

from surrogate.errors import InvalidInput

HEARTBEAT = 10  # seconds without a sign of life after which a process counts as lost
TOGETHER = 120  # seconds that processes wait for each other at the start


def join(
    coordinator: str | None = None, processes: int | None = None, process: int | None = None
) -> None:
    """Make this process one of many, before the first computation.

    Without arguments the scheduler that started it (Slurm, Open MPI) says which.

    Raises:
      InvalidInput: the others did not come, or the numbers make no sense.
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
            initialization_timeout=TOGETHER,
            heartbeat_timeout_seconds=HEARTBEAT,
        )
    except (RuntimeError, ValueError) as problem:
        reason = str(problem).splitlines()[0]
        raise InvalidInput(f"processes did not come together: {reason}") from None


def scheduled(environment: Mapping[str, str] = os.environ) -> bool:
    """Whether a scheduler has started several processes of this program."""
    slurm = "SLURM_STEP_NODELIST" in environment and int(environment.get("SLURM_NTASKS", 1)) > 1
    return slurm or int(environment.get("OMPI_COMM_WORLD_SIZE", 1)) > 1


def first() -> bool:
    """Whether this process writes and speaks."""
    return jax.process_index() == 0


def agreed(tree: PyTree) -> PyTree:
    """What the first process holds, for all; shapes must be the same everywhere."""
    if jax.process_count() == 1:
        return tree
    return jax.tree.map(np.asarray, multihost_utils.broadcast_one_to_all(tree))


def together(array: jax.Array) -> np.ndarray:
    """What the devices of all processes hold of an array, on the host."""
    if array.is_fully_addressable:
        return np.asarray(array)
    return multihost_utils.process_allgather(array, tiled=True)
