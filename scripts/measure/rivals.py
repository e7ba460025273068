"""Regressions on solved drags that need no network: polynomials and kriging."""

import math
import warnings
from collections.abc import Callable

import numpy as np

Predictor = Callable[[np.ndarray], np.ndarray]
Fit = Callable[[np.ndarray, np.ndarray], Predictor]


def rivals() -> dict[str, Fit]:
    """By name; none where scikit-learn is not installed."""
    try:
        import sklearn  # noqa: F401
    except ImportError:
        return {}
    return {"polynomial": _polynomial, "kriging": _kriging}


def _polynomial(x: np.ndarray, y: np.ndarray) -> Predictor:
    """Least squares on all monomials of degree 4, or of what the samples can carry."""
    from sklearn.linear_model import LinearRegression
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import PolynomialFeatures

    fits = (d for d in (4, 3, 2, 1) if math.comb(x.shape[1] + d, d) <= 0.7 * len(x))
    return make_pipeline(PolynomialFeatures(next(fits, 0)), LinearRegression()).fit(x, y).predict


def _kriging(x: np.ndarray, y: np.ndarray) -> Predictor:
    """Gaussian process with one length scale per input, fitted by maximum likelihood."""
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    kernel = ConstantKernel(1.0, (1e-3, 1e4)) * RBF(np.full(x.shape[1], 2.0), (0.05, 50))
    kernel += WhiteKernel(1e-6, (1e-12, 1e-2))
    search = {"normalize_y": True, "n_restarts_optimizer": 2, "random_state": 0}
    with warnings.catch_warnings():  # a length scale at its bound, an early end of the search
        warnings.simplefilter("ignore", ConvergenceWarning)
        return GaussianProcessRegressor(kernel, **search).fit(x, y).predict
