"""Regressions on solved drags that need no network: polynomials and kriging, with slopes or not."""

import math
import warnings
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from surrogate.model.inputs import Inputs
from surrogate.model.kriging import Observation, kriging


class Solved(NamedTuple):
    """Solved flows: their scaled inputs and observations."""

    inputs: Inputs
    z: np.ndarray
    observations: list[Observation]

    def head(self, count: int) -> "Solved":
        return Solved(self.inputs, self.z[:count], self.observations[:count])

    @property
    def log_drag(self) -> np.ndarray:
        return np.log([flow.drag for flow in self.observations])


Predictor = Callable[[np.ndarray], np.ndarray]
Fit = Callable[[Solved], Predictor]


def rivals() -> dict[str, Fit]:
    """By name; kriging with slopes alone where scikit-learn is not installed."""
    try:
        import sklearn  # noqa: F401
    except ImportError:
        return {"kriging, with slopes": _with_slopes}
    return {"polynomial": _polynomial, "kriging": _kriging, "kriging, with slopes": _with_slopes}


def _with_slopes(solved: Solved) -> Predictor:
    """The process that designs from nothing are led by."""
    model = kriging(solved.observations, solved.inputs)
    predict = jax.jit(jax.vmap(model.log_drag))
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
