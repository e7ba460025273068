"""The flows of held-out bodies, on which the errors of a training are measured."""

from collections.abc import Callable

import jax
import numpy as np

from surrogate.devices import Devices
from surrogate.errors import NotConverged
from surrogate.flow.batch import FlowBatch
from surrogate.flow.flow import Flow
from surrogate.scene.samples import Samples, held_out_samples
from surrogate.training.plan import Plan

HELD_OUT_FAILURES = 0.1  # share of the held-out flows that may fail; one always may
AT_ONCE = 16  # most held-out flows between two reports, per body that a device solves at once

Report = Callable[[int, int], None]


def silent(done: int, of: int) -> None:
    """Report nothing: the default where a report of progress is optional."""


def solve_held_out(
    flow: Flow, plan: Plan, devices: Devices, report: Report = silent
) -> tuple[Samples, FlowBatch]:
    """Return the held-out bodies whose flows converge, and these flows.

    Args:
      flow: of the plan's scene.
      plan: of the training.
      devices: over which the flows are distributed.
      report: as of ``make_setup``.

    Raises:
      NotConverged: more than a tenth of the flows, at least two, or all of them did not converge.
    """
    held_out = held_out_samples(plan.scene, plan.seed, plan.held_out)
    most, parts = AT_ONCE * devices.device_batch * devices.count, []
    size = -(-held_out.count // -(-held_out.count // most))  # of parts of equal size
    for start in range(0, held_out.count, size):
        own = np.arange(start, min(start + size, held_out.count))
        part = flow.solve_all(
            *held_out.at(np.resize(own, size)), devices, allow_unsteady=True, partial=True
        )
        parts.append(jax.tree.map(lambda leaf, count=own.size: leaf[:count], part))
        report(start + own.size, held_out.count)
    found = jax.tree.map(lambda *leaves: np.concatenate(leaves), *parts)
    failed = int(np.sum(~found.converged))
    if failed > max(1, HELD_OUT_FAILURES * held_out.count) or failed == held_out.count:
        raise NotConverged(
            f"training: {failed} of {held_out.count} held-out flows did not converge, at most a "
            "tenth may fail; more cells or lower Reynolds numbers in the scene would help"
        )
    keep = np.flatnonzero(found.converged)
    return held_out.at(keep), jax.tree.map(lambda leaf: leaf[keep], found)
