"""Infill: further training samples where a surrogate is least certain (active learning)."""

import numpy as np

from surrogate.errors import InvalidInput
from surrogate.model.confidence import Novelty
from surrogate.model.surrogate import Surrogate
from surrogate.processes import broadcast_json, first
from surrogate.repeats import differences
from surrogate.scene.samples import Samples, training_samples
from surrogate.scene.scene import Scene

CANDIDATES = 2048  # further points of the Sobol sequence, of which the samples are chosen


def infill_positions(
    surrogate: Surrogate, scene: Scene, seed: int, count: int, symmetric_share: float = 0.0
) -> tuple[int, ...]:
    """Return the positions in the Sobol sequence of the samples to add to those of a surrogate.

    One after the other, the candidate whose error bound is largest is taken, the bounds being those
    of the surrogate linearised in its weights, once the samples taken so far are known too. This
    takes no flow: the bounds do not depend on the answers. In a multi-process run the first process
    chooses.

    Args:
      surrogate: trained on this scene with this seed.
      scene: of the new training.
      seed: of the new training.
      count: number of samples of the new training, those of the surrogate included.
      symmetric_share: of the new training; with another one than the surrogate's, the bodies at its
        positions are not all those that it was trained on.

    Returns:
      The positions of the surrogate's own infill, then the new ones.

    Raises:
      InvalidInput: the surrogate is of another scene or seed, of ``count`` samples or more, or
        more are to be added than there are candidates.
    """
    trained = surrogate.recorded("samples")
    theirs = surrogate.scene.record | {"seed": surrogate.recorded("seed")}
    if found := differences(theirs, scene.record | {"seed": seed}):
        raise InvalidInput(f"infill: the surrogate is of another scene or seed ({found})")
    own = tuple(surrogate.record.get("infill", ()))
    start = trained - len(own)
    positions = np.setdiff1d(np.arange(start, start + CANDIDATES), own)
    if not trained < count <= trained + len(positions):
        raise InvalidInput(
            f"infill: from {trained + 1} to {trained + len(positions)} samples in all can be asked "
            f"for, as the surrogate has {trained}; not {count}"
        )
    chosen = None
    if first():
        drawn = training_samples(scene, seed, start + CANDIDATES, (), symmetric_share)
        candidates = drawn.at(positions)
        chosen = positions[_largest_bounds(surrogate, candidates, count - trained)].tolist()
    return (*own, *broadcast_json(chosen))


def _largest_bounds(surrogate: Surrogate, candidates: Samples, count: int) -> list[int]:
    """Return the indices of the candidates whose bounds are largest, each given those before it.

    The covariance of all loads at all candidates is factored by Cholesky's method, whose pivots are
    the loads of the next sample; only the rows of these are computed.
    """
    novelty = Novelty.of(surrogate.network, surrogate.training_samples)
    scales = surrogate.error_scales
    gradients, explained = map(np.asarray, novelty.covariance_parts(candidates))
    loads, start = len(scales), len(explained)
    factor = np.concatenate([explained, np.empty((loads * count, explained.shape[1]))])
    variances = np.sum(gradients**2, axis=0) - np.sum(explained**2, axis=0)
    noise, chosen = float(novelty.ridge) * np.eye(loads), []
    for done in range(start, len(factor), loads):
        bounds = np.max(scales**2 * variances.reshape(-1, loads), axis=1)
        bounds[chosen] = -np.inf
        chosen.append(int(np.argmax(bounds)))
        rows, known = loads * chosen[-1] + np.arange(loads), factor[:done]
        covariance = gradients[:, rows].T @ gradients - known[:, rows].T @ known
        pivot = np.linalg.cholesky(covariance[:, rows] + noise)
        factor[done : done + loads] = np.linalg.solve(pivot, covariance)
        variances -= np.sum(factor[done : done + loads] ** 2, axis=0)
    return chosen
