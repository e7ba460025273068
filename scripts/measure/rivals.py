"""Rival regressions on solved flows: polynomials, kriging with gradients or without, and JENN."""

import math
import warnings
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from study import Unavailable

from surrogate.model.inputs import Inputs
from surrogate.model.kriging import Observation, kriging

COMPONENTS = 4  # of partial least squares, and points that replace a flow's gradient
# Of JENN, the best of those tried on sections whose loads are those of ``pretrained:lift``.
JENN_WIDTHS = 16, 32, 64  # of both hidden layers
JENN_RATES = 1e-2, 3e-3, 1e-3, 3e-4  # of Adam, one after the other
JENN_STEPS = 2000  # at each rate
JENN_SLOPES = 1.0  # weight of the gradients


class Solved(NamedTuple):
    """Solved flows of family bodies: their scaled inputs and observations."""

    inputs: Inputs
    z: np.ndarray
    observations: list[Observation]

    def head(self, count: int) -> "Solved":
        """Return the first ``count`` flows."""
        return Solved(self.inputs, self.z[:count], self.observations[:count])

    @property
    def log_drag(self) -> np.ndarray:
        """The logarithms of the drag coefficients, shape (flows,)."""
        return np.log([flow.drag for flow in self.observations])


class SolvedLoads(NamedTuple):
    """Solved flows in scaled inputs: the outputs (log Cd, Cl / Cd, Cm / Cd) and their gradients."""

    z: np.ndarray  # (flows, inputs)
    outputs: np.ndarray  # (flows, loads)
    slopes: np.ndarray  # (flows, loads, inputs)


Predictor = Callable[[np.ndarray], np.ndarray]
Fit = Callable[[Solved], Predictor]


def rivals() -> dict[str, Fit]:
    """Return the regressions by name; GEK alone where scikit-learn is not installed.

    GEK is gradient-enhanced kriging, as that by which designs from nothing are led.
    """
    try:
        import sklearn  # noqa: F401
    except ImportError:
        return {"gradient-enhanced kriging": _with_slopes}
    return {
        "polynomial": _polynomial,
        "kriging": _kriging,
        "gradient-enhanced kriging": _with_slopes,
    }


def _with_slopes(solved: Solved) -> Predictor:
    """Return the predictions of gradient-enhanced kriging, which leads designs without training."""
    model = kriging(solved.observations, solved.inputs)
    predict = jax.jit(jax.vmap(lambda z: model.outputs(z)[0]))
    return lambda z: np.asarray(predict(jnp.asarray(z)))


def _polynomial(solved: Solved) -> Predictor:
    """Least squares on all monomials of degree 4, or of what the samples can carry."""
    from sklearn.linear_model import LinearRegression
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import PolynomialFeatures

    count, size = solved.z.shape
    fits = (d for d in (4, 3, 2, 1) if math.comb(size + d, d) <= 0.7 * count)
    fit = make_pipeline(PolynomialFeatures(next(fits, 0)), LinearRegression())
    return fit.fit(solved.z, solved.log_drag).predict


def _kriging(solved: Solved) -> Predictor:
    """Gaussian process with one length scale per input, fitted by maximum likelihood."""
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    kernel = ConstantKernel(1.0, (1e-3, 1e4)) * RBF(np.full(solved.z.shape[1], 2.0), (0.05, 50))
    kernel += WhiteKernel(1e-6, (1e-12, 1e-2))
    search = {"normalize_y": True, "n_restarts_optimizer": 2, "random_state": 0}
    with warnings.catch_warnings():  # a length scale at its bound, an early end of the search
        warnings.simplefilter("ignore", ConvergenceWarning)
        return GaussianProcessRegressor(kernel, **search).fit(solved.z, solved.log_drag).predict


def polynomial_with_slopes(solved: SolvedLoads) -> Predictor:
    """Fit outputs and slopes by least squares on all monomials, of the degree that predicts best.

    The degree is chosen on a quarter of the flows, fitted to the others.
    """
    count, size = solved.z.shape
    split = 3 * count // 4
    some, rest = (SolvedLoads(*(x[part] for x in solved)) for part in _parts(split, count))
    most = split * (size + 1)
    degrees = [d for d in range(1, 7) if math.comb(size + d, d) <= 0.7 * most]

    def error(degree):
        return np.mean((_fitted_polynomial(some, degree)(rest.z) - rest.outputs) ** 2)

    return _fitted_polynomial(solved, min(degrees, key=error))


def _parts(split: int, count: int) -> tuple[slice, slice]:
    return slice(0, split), slice(split, count)


def _fitted_polynomial(solved: SolvedLoads, degree: int) -> Predictor:
    from sklearn.preprocessing import PolynomialFeatures

    powers = PolynomialFeatures(degree).fit(solved.z).powers_
    rows = [np.prod(solved.z[:, None] ** powers, axis=-1)]
    right = [solved.outputs]
    for k in range(solved.z.shape[1]):
        lower = np.maximum(powers - np.eye(powers.shape[1], dtype=int)[k], 0)
        rows.append(powers[:, k] * np.prod(solved.z[:, None] ** lower, axis=-1))
        right.append(solved.slopes[:, :, k])
    found = np.linalg.lstsq(np.concatenate(rows), np.concatenate(right), rcond=None)[0]
    return lambda z: np.prod(z[:, None] ** powers, axis=-1) @ found


def gekpls(solved: SolvedLoads) -> Predictor:
    """Fit gradient-enhanced kriging with partial least squares by SMT (Bouhlel and Martins 2019).

    Raises:
      Unavailable: SMT is not installed.
    """
    try:
        from smt.surrogate_models import GEKPLS
    except ImportError:
        raise Unavailable("GEKPLS needs SMT: pip install -e '.[bench]'") from None
    models, size = [], solved.z.shape[1]
    silent = dict.fromkeys(("print_global", "print_training", "print_prediction"), False)
    for k in range(solved.outputs.shape[1]):
        box = np.column_stack([solved.z.min(axis=0), solved.z.max(axis=0)])
        model = GEKPLS(n_comp=COMPONENTS, extra_points=COMPONENTS, xlimits=box, **silent)
        model.set_training_values(solved.z, solved.outputs[:, k])
        for j in range(size):
            model.set_training_derivatives(solved.z, solved.slopes[:, k, j : j + 1], j)
        model.train()
        models.append(model)
    return lambda z: np.concatenate([model.predict_values(z) for model in models], axis=1)


def jenn(solved: SolvedLoads, steps: int | None = None) -> Predictor:
    """Fit a network to outputs and slopes by the package JENN (Berguin 2024).

    Its two hidden layers are the widest of ``JENN_WIDTHS`` with fewer weights than there are
    numbers to fit.

    Args:
      solved: flows.
      steps: of Adam at each of the rates ``JENN_RATES``; by default ``JENN_STEPS``.

    Raises:
      Unavailable: JENN is not installed.
    """
    try:
        from jenn import NeuralNet
    except ImportError:
        raise Unavailable("JENN is not installed: pip install -e '.[bench]'") from None
    inputs, outputs = solved.z.shape[1], solved.outputs.shape[1]
    numbers = solved.outputs.size + solved.slopes.size
    fits = (w for w in JENN_WIDTHS if w * (inputs + 1) + (w + outputs) * (w + 1) < numbers)
    width = max(fits, default=JENN_WIDTHS[0])
    network = NeuralNet([inputs, width, width, outputs])
    labels = solved.z.T, solved.outputs.T, solved.slopes.transpose(1, 2, 0)
    for k, rate in enumerate(JENN_RATES):
        settings = {"alpha": rate, "gamma": JENN_SLOPES, "max_iter": steps or JENN_STEPS}
        network.fit(*labels, is_normalize=True, random_state=0, is_warmstart=k > 0, **settings)
    return lambda z: network.predict(z.T).T
