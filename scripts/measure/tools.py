"""What several studies use: solved flows, errors, times, memory, processes of their own."""

import contextlib
import os
import socket
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np
from jax.experimental.compilation_cache import compilation_cache
from study import Row

from surrogate import Fidelity, Flow, Scene, Solution, family_shape
from surrogate.devices import Devices
from surrogate.flow.batch import FlowBatch, batch_solver, estimated_cost
from surrogate.flow.streams import forget_operators
from surrogate.partition import partition_bodies
from surrogate.scene.samples import training_samples

POLL_S = 0.02  # between two looks at the memory
LOADS = ("cd", "cl", "cm")
SILENT = 2.0  # times the error tolerance: an error that a drag called accurate must not have


def solved(
    body: Mapping[str, float],
    reynolds: float,
    fidelity: Fidelity,
    dimension: int = 2,
    stream: str = "unbounded",
    **options: bool,
) -> Solution:
    """Solve the flow past a body of the family, without an estimate of its error unless asked for.

    It takes its time as if no flow had been solved at this Re before.

    Args:
      body: Parameters of the family by name.
      reynolds: U D / nu.
      fidelity: Of the flow.
      dimension: 2 or 3.
      stream: As for ``parse_stream``.
      **options: Of ``Flow.solve``.
    """
    forget_operators()
    flow = Flow(Scene(stream, dimension=dimension, fidelity=fidelity))
    shape = family_shape(body, dimension=dimension)
    return flow.solve(shape, reynolds, **{"estimate": False, "allow_unsteady": True} | options)


def bounds_of(found: Solution) -> tuple[float | None, float | None, float | None]:
    """Return the bounds of the errors of Cd, Cl and Cm of a flow, None where there is none."""
    drag = found.estimated_error and found.estimated_error * found.drag
    return drag, found.estimated_lift_error, found.estimated_moment_error


def beside(found: Solution, reference: Sequence[float]) -> Row:
    """Return the loads of a flow, their errors and bounds over the reference Cd, status and work.

    Args:
      found: The flow.
      reference: Its Cd, Cl and Cm by something more accurate.
    """
    row: Row = {"status": found.status, "green_applications": found.green_applications}
    rows = zip(LOADS, found.loads.tolist(), reference, bounds_of(found), strict=True)
    for name, load, true, bound in rows:
        row |= {name: load, f"{name}_error": (load - true) / reference[0]}
        row |= {f"{name}_bound": None if bound is None else bound / reference[0]}
    return row


def relative_error(cd: float | None, exact: float | None) -> float | None:
    """Return the relative error, or None where one of the two is unknown."""
    return None if cd is None or exact is None else cd / exact - 1


def mean_and_most(errors: Iterable[float | None]) -> tuple[float | None, float | None]:
    """Return the mean and the largest of the absolute errors that are known."""
    known = [abs(error) for error in errors if error is not None]
    return (float(np.mean(known)), max(known)) if known else (None, None)


def name_of(body: Mapping[str, float], form: str = "g") -> str:
    """Return the parameters of a body as text, such as "aspect 2, beta2 0.1"."""
    return ", ".join(f"{name} {value:{form}}" for name, value in body.items())


class PeakMemory:
    """A context in which the memory of the process is watched; ``mib`` is its greatest growth.

    It is 0 on systems without ``/proc``.
    """

    mib = 0.0

    def __enter__(self) -> "PeakMemory":
        self._begin, self._over = resident_mib(), threading.Event()
        self._thread = threading.Thread(target=self._watch)
        self._thread.start()
        return self

    def __exit__(self, *problem: object) -> None:
        self._over.set()
        self._thread.join()

    def _watch(self):
        over = False
        while not over:
            over = self._over.wait(POLL_S)
            self.mib = max(self.mib, resident_mib() - self._begin)


def resident_mib() -> float:
    """Return the resident memory of this process in MiB, 0 on systems without ``/proc``."""
    statm = Path("/proc/self/statm")
    pages = int(statm.read_text().split()[1]) if statm.is_file() else 0
    return pages * os.sysconf("SC_PAGESIZE") / 2**20


def alone(call: Callable[[], Any]) -> Any:
    """Return the result of a call that finds no operators of earlier flows."""
    forget_operators()
    return call()


def medians(calls: Sequence[Callable[[], Any]], repeats: int = 7) -> list[float]:
    """Return the median seconds of every call, without compilation.

    The calls take turns, so that other work on the machine slows all of them alike.
    """
    seconds = np.zeros((repeats + 1, len(calls)))
    for row in seconds:
        for k, call in enumerate(calls):
            start = time.perf_counter()
            jax.block_until_ready(call())
            row[k] = time.perf_counter() - start
    return np.median(seconds[1:], axis=0).tolist()


@contextlib.contextmanager
def cold_cache() -> Iterator[None]:
    """Switch JAX's persistent compilation cache off."""
    before = jax.config.jax_enable_compilation_cache
    jax.config.update("jax_enable_compilation_cache", False)
    compilation_cache.reset_cache()
    try:
        yield
    finally:
        jax.config.update("jax_enable_compilation_cache", before)
        compilation_cache.reset_cache()


def megabytes(compiled: Any) -> float:
    """Return the memory of a compiled call in MB, its outputs included."""
    memory = compiled.memory_analysis()
    return (memory.temp_size_in_bytes + memory.output_size_in_bytes) / 1e6


def power_of(rows: Sequence[Row], x: str, y: str) -> float | None:
    """Return the exponent p of |y| ~ x^p, fitted to two rows or more."""
    logs = np.log([[row[x], abs(row[y])] for row in rows]).T
    return float(np.polyfit(*logs, 1)[0]) if len(rows) > 1 else None


def timed_batch(flow: Flow, devices: Devices, count: int, rounds: int) -> tuple[Row, FlowBatch]:
    """Solve the first training bodies of a scene a few times, without compilation.

    Args:
      flow: Of the scene.
      devices: Over which the bodies are partitioned.
      count: Number of bodies.
      rounds: How often they are solved, after once to warm up.

    Returns:
      Flows per second and MiB per body of a batch, and the flows.
    """
    samples = training_samples(flow.scene, 0, count)
    partition = partition_bodies(devices, estimated_cost(flow.scene.family, *samples))
    given = devices.place((partition, *samples))
    program = batch_solver(flow.bodies).lower(*given).compile()
    memory, found = program.memory_analysis().temp_size_in_bytes, []
    seconds = medians([lambda: found.append(program(*given)) or found[-1]], rounds)[0]
    row = {
        "flows_per_s": count / seconds,
        "mib_per_body": memory / devices.device_batch / 2**20,
    }
    return row, found[-1]


def free_port() -> int:
    """Return a free TCP port of this machine."""
    with socket.socket() as probe:
        probe.bind(("localhost", 0))
        return probe.getsockname()[1]
