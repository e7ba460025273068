"""How right shape gradients are: of the adjoint on each grid, and of the surrogates that ship.

python scripts/measure/gradients.py
"""

import sys
from collections.abc import Callable

import jax
import numpy as np
from study import TINY, Result, Study, run_study, table_of_rows

from surrogate import FIDELITIES, Flow, Scene, load
from surrogate.training.plan import METHODS
from surrogate.training.samples import Samples, held_out_samples


def measure(tiny: bool, progress: Callable) -> Result:
    """Gradients of unseen bodies by every grid and surrogate, against standard and fine."""
    levels = dict.fromkeys(FIDELITIES, TINY) if tiny else FIDELITIES
    bodies = held_out_samples(Scene(), 0, 2 if tiny else 64)
    found = {}
    for k, (name, fidelity) in enumerate(levels.items()):
        progress(k / len(levels), f"adjoint, {name}")
        found[f"adjoint, {name}"] = adjoint_slopes(Flow(Scene(fidelity=fidelity)), bodies)
    for method in METHODS:
        network = load(f"pretrained:{method}").network
        found[method] = np.asarray(jax.vmap(jax.grad(network.drag))(*bodies))
    widths = np.ptp(Scene().family.bounds, axis=1)
    truths = {level: found[f"adjoint, {level}"] for level in ("standard", "fine")}
    rows = [
        {"gradient": name} | {level: distance(g, truth, widths) for level, truth in truths.items()}
        for name, g in found.items()
    ]
    return {"bodies": bodies.count, "rows": rows}


def adjoint_slopes(flow: Flow, bodies: Samples) -> np.ndarray:
    """Of the flow's own drag; NaN where flow or adjoint were not found."""
    return np.array([flow.slope(*query).gradient for query in zip(*bodies, strict=True)])


def distance(gradient: np.ndarray, truth: np.ndarray, widths: np.ndarray) -> float:
    """Median over the bodies of |g - truth| / |truth|, in ranges of the parameters."""
    miss = np.linalg.norm((gradient - truth) * widths, axis=1)
    return float(np.nanmedian(miss / np.linalg.norm(truth * widths, axis=1)))


HEADS = "gradient of | from the standard adjoint | from the fine adjoint"
FORMS = "{gradient} | {standard:.1%} | {fine:.1%}"
STUDY = Study("gradients", measure, table_of_rows(HEADS, FORMS))

if __name__ == "__main__":
    sys.exit(run_study(STUDY))
