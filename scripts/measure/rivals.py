"""Regressions on solved drags that need no network: polynomials and kriging."""

import itertools
import warnings
from collections.abc import Callable

import numpy as np

from surrogate.errors import InvalidInput

Predictor = Callable[[np.ndarray], np.ndarray]


def polynomial(x: np.ndarray, y: np.ndarray) -> Predictor:
    """Least squares on all monomials of degree 4, or of what the samples can carry."""
    degree = next(d for d in (4, 3, 2, 1) if len(_powers(x.shape[1], d)) <= 0.7 * len(x))
    powers = _powers(x.shape[1], degree)
    weights = np.linalg.lstsq(_monomials(x, powers), y, rcond=None)[0]
    return lambda z: _monomials(z, powers) @ weights


def _powers(variables: int, degree: int) -> np.ndarray:
    every = itertools.product(range(degree + 1), repeat=variables)
    return np.array([p for p in every if sum(p) <= degree])


def _monomials(x: np.ndarray, powers: np.ndarray) -> np.ndarray:
    return np.prod(x[:, None, :] ** powers[None], axis=2)


def kriging() -> Callable[[np.ndarray, np.ndarray], Predictor]:
    """Gaussian process with one length scale per input, fitted by maximum likelihood.

    Raises:
      InvalidInput: scikit-learn is not installed.
    """
    try:
        from sklearn.exceptions import ConvergenceWarning
        from sklearn.gaussian_process import GaussianProcessRegressor
        from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel
    except ImportError:
        raise InvalidInput("kriging needs scikit-learn: pip install -e '.[bench]'") from None

    def fit(x, y):
        kernel = ConstantKernel(1.0, (1e-3, 1e4)) * RBF(np.full(x.shape[1], 2.0), (0.05, 50))
        process = GaussianProcessRegressor(
            kernel + WhiteKernel(1e-6, (1e-12, 1e-2)), normalize_y=True, n_restarts_optimizer=2
        )
        process.random_state = 0
        with warnings.catch_warnings():  # a length scale at its bound, an early end of the search
            warnings.simplefilter("ignore", ConvergenceWarning)
            return process.fit(x, y).predict

    return fit
