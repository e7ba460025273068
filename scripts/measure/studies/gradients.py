"""Error of shape gradients: of the adjoint on each grid, and of the surrogates that ship."""

import functools

import jax
import numpy as np
from study import Row, Run, Study, Table, columns

from surrogate import FIDELITIES, Fidelity, Flow, Scene, load
from surrogate.training.plan import METHODS
from surrogate.training.samples import Samples, held_out_samples


def cases(run: Run) -> list[Row]:
    """Every grid's adjoint and every method's network."""
    grids = [{"gradient": f"adjoint, {name}", "level": name} for name in FIDELITIES]
    return [*grids, *({"gradient": name, "method": name} for name in METHODS)]


def measure(run, gradient, level=None, method=None) -> Row:
    """Distance from the adjoint's gradient on the standard and on the fine grid."""
    bodies = held_out_samples(Scene(), 0, run.pick(2, 64))

    def adjoint(name):
        return adjoint_slopes_once(run.fidelity(name), bodies.count)

    if method:
        found = np.asarray(jax.vmap(jax.grad(load(f"pretrained:{method}").network.drag))(*bodies))
    else:
        found = adjoint(level)
    widths = np.ptp(Scene().family.bounds, axis=1)
    return {name: distance(found, adjoint(name), widths) for name in ("standard", "fine")}


@functools.cache
def adjoint_slopes_once(fidelity: Fidelity, count: int) -> np.ndarray:
    """The gradients of the first held-out bodies on one grid."""
    return adjoint_slopes(Flow(Scene(fidelity=fidelity)), held_out_samples(Scene(), 0, count))


def adjoint_slopes(flow: Flow, bodies: Samples) -> np.ndarray:
    """Shape gradients of the drag; NaN where flow or adjoint did not converge."""
    return np.array([flow.slope(*query).gradient for query in zip(*bodies, strict=True)])


def distance(gradient: np.ndarray, truth: np.ndarray, widths: np.ndarray) -> float:
    """Median over bodies of |g - truth| / |truth|, each parameter scaled by its range."""
    error = np.linalg.norm((gradient - truth) * widths, axis=1)
    return float(np.nanmedian(error / np.linalg.norm(truth * widths, axis=1)))


COLUMNS = "gradient {gradient} | error against the standard adjoint {standard:.1%}"
COLUMNS += " | against the fine adjoint {fine:.1%}"
STUDY = Study([Table(cases, measure, columns(COLUMNS), tiny="all")])
