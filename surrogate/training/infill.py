"""Infill: further training samples where a surrogate is least certain (active learning)."""

import numpy as np

from surrogate.errors import InvalidInput
from surrogate.model.confidence import RIDGE
from surrogate.model.surrogate import LOAD_NAMES, Surrogate
from surrogate.scene.samples import training_samples
from surrogate.scene.scene import Scene

CANDIDATES = 2048  # further points of the Sobol sequence, of which the samples are chosen


def infill_positions(surrogate: Surrogate, scene: Scene, seed: int, count: int) -> tuple[int, ...]:
    """Return the positions in the Sobol sequence of the samples to add to those of a surrogate.

    One after the other, the candidate whose error bound is largest is taken, the bounds being those
    of the surrogate linearised in its weights, once the samples taken so far are known too. This
    takes no flow: the bounds do not depend on the answers.

    Args:
      surrogate: trained on this scene with this seed.
      scene: of the new training.
      seed: of the new training.
      count: number of samples of the new training, those of the surrogate included.

    Returns:
      The positions of the surrogate's own infill, then the new ones.

    Raises:
      InvalidInput: the surrogate is of another scene or seed, or of ``count`` samples or more.
    """
    trained = surrogate.recorded("samples")
    if surrogate.scene.record != scene.record or surrogate.recorded("seed") != seed:
        raise InvalidInput("refine: a surrogate of another scene or seed; take that of this one")
    if count <= trained:
        raise InvalidInput(f"refine: a surrogate of {trained} samples; ask for more, not {count}")
    own = tuple(surrogate.record.get("infill", ()))
    start = trained - len(own)
    positions = np.setdiff1d(np.arange(start, start + CANDIDATES), own)
    candidates = training_samples(scene, seed, start + CANDIDATES).at(positions)
    names = LOAD_NAMES[: 1 if scene.family.body_class.symmetric else len(LOAD_NAMES)]
    scales = np.array([surrogate.recorded(f"{name}_error_scale") for name in names])
    covariance = np.asarray(surrogate.novelty.covariance(candidates))
    chosen = _largest_bounds(covariance, scales, count - trained)
    return (*own, *positions[chosen].tolist())


def _largest_bounds(covariance, scales, count):
    """Return the indices of the samples whose bounds are largest, each given those before it."""
    covariance, loads, chosen = np.array(covariance), len(scales), []
    ridge = RIDGE * np.mean(np.diag(covariance)) * np.eye(loads)
    for _ in range(count):
        variances = np.maximum(np.diag(covariance), 0.0).reshape(-1, loads)
        chosen.append(int(np.argmax(np.max(scales**2 * variances, axis=1))))
        rows = loads * chosen[-1] + np.arange(loads)
        known = np.linalg.cholesky(covariance[np.ix_(rows, rows)] + ridge)
        explained = np.linalg.solve(known, covariance[rows])
        covariance -= explained.T @ explained
    return chosen
