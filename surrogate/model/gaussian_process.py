"""A Gaussian process with observed slopes: its covariance, its posterior and its coefficients.

The covariance is rational quadratic with one length scale per scaled input,

    k(z, y) = s^2 (1 + r^2 / (2 alpha))^-alpha,   r^2 = sum_i ((z_i - y_i) / l_i)^2.

With y' the scaled inputs of a body's mirror image, k(z, y) + k(z, y') makes log Cd even and
k(z, y) - k(z, y') the other outputs odd, exactly. Slopes are observations too: their covariances
are the derivatives of k. Rasmussen and Williams 2006, chapters 2, 4.2, 5 and 9.4.
"""

import dataclasses
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float
from scipy.linalg import LinAlgError, cho_solve, cholesky, solve_triangular

from surrogate.arrays import AnyArray
from surrogate.compilation import compiled
from surrogate.errors import NotConverged

# Priors and bounds in logs. They were set on the default scene, where a likelihood alone fits few
# flows too closely; no study of them is kept.
ALPHA = 2.0  # a mixture of length scales that differ by a factor of about two
VALUE_NOISE, SLOPE_NOISE = 2e-5, 2e-4  # of outputs and their slopes: their grid-offset error
LENGTH, LENGTH_DEVIATION = 1.5, 0.7  # prior median of lengths, deviation of their log
AMPLITUDE = (-1.0, 3.0)  # prior mean and deviation of log s, for outputs
RESIDUAL_AMPLITUDE = (-7.0, 1.5)  # the same for the residual of a trained base
NOISE_DEVIATION = 0.5  # prior deviation of the log of the noise over VALUE_NOISE, SLOPE_NOISE
BOUNDS = ((-10.0, 2.0), (-1.0, 4.0), (-2.0, 3.0))  # of amplitude, noise, lengths
PART = 64  # flows whose rows of the covariance are computed together
BLOCK = 4096  # rows of the covariance that are factorised together


class Data(eqx.Module):
    """Observations in scaled inputs: rows of (value, slopes), padded where not ``valid``.

    ``parity`` of an output, and ``mirror`` of the inputs, are their factors under mirroring.
    """

    z: Float[AnyArray, "flows inputs"]
    rows: Float[AnyArray, "*loads flows rows"]
    valid: Bool[AnyArray, " flows"]
    parity: Float[AnyArray, "*loads"]
    mirror: Float[AnyArray, " inputs"]

    def of_load(self, index: int) -> "Data":
        """Return the observations of one output."""
        parity = self.parity[index, ...]  # an array, where NumPy would give a scalar
        return dataclasses.replace(self, rows=self.rows[index], parity=parity)


class Hyper(NamedTuple):
    """Hyperparameters of every output as logs: amplitude, noise over its usual size, lengths.

    The amplitude is s, the lengths are l_i of the covariance k; the usual sizes of the noise are
    ``VALUE_NOISE`` and ``SLOPE_NOISE``.
    """

    amplitude: Float[AnyArray, "*loads"]
    noise: Float[AnyArray, "*loads"]
    lengths: Float[AnyArray, "*loads inputs"]


def hyper_of(theta: Float[AnyArray, "numbers ..."]) -> Hyper:
    """Return hyperparameters from rows of numbers: amplitude, noise, then the lengths."""
    return Hyper(theta[0], theta[1], theta[2:].T)


def _centred(data, mean):
    """Return the rows minus the mean; zero in the padding."""
    return jnp.where(data.valid[:, None], jnp.asarray(data.rows).at[:, 0].add(-mean), 0.0)


def _matrix(data, hyper):
    """Return the covariance of all rows with noise; padding is independent, of variance 1."""
    flows = jnp.arange(len(data.valid))
    return _covariance_rows(data, hyper, flows) + jnp.diag(_noise(data, hyper))


def _covariance_rows(data, hyper, flows):
    """Return the covariance, without noise, of the rows of some flows with all rows."""

    def block(z, y):
        return covariance(hyper, z, y, data.parity, data.mirror)

    size = data.rows.shape[1]
    blocks = jax.vmap(jax.vmap(block, (None, 0)), (0, None))(data.z[flows], data.z)
    rows = blocks.transpose(0, 2, 1, 3).reshape(len(flows) * size, data.rows.size)
    own, others = jnp.repeat(data.valid[flows], size), jnp.repeat(data.valid, size)
    return jnp.where(own[:, None] & others, rows, 0.0)


_compiled_rows = jax.jit(_covariance_rows)


def _noise(data, hyper):
    """Return the variance of the noise of every row; of padding 1."""
    count, size = data.rows.shape
    noise = jnp.exp(hyper.noise) * jnp.array([VALUE_NOISE, *[SLOPE_NOISE] * (size - 1)])
    return jnp.where(jnp.repeat(data.valid, size), jnp.tile(noise**2, count), 1.0)


def covariance(
    hyper: Hyper,
    z: Float[AnyArray, " inputs"],
    y: Float[AnyArray, " inputs"],
    parity: Float[AnyArray, ""],
    mirror: Float[AnyArray, " inputs"],
) -> Float[Array, "rows rows"]:
    """Return the covariance matrix of (value, slopes) at z with (value, slopes) at y.

    Args:
      hyper: of one output.
      z: scaled inputs.
      y: scaled inputs.
      parity: 1 for an even output, -1 for an odd one.
      mirror: factors of the inputs under mirroring; 1 for all where bodies are symmetric.
    """
    direct = _free_covariance(hyper, z, y)
    image = _free_covariance(hyper, z, mirror * y) * jnp.append(1.0, mirror)
    lifting = jnp.any(mirror < 0)  # else every body is its own mirror image
    return direct + jnp.where(lifting, parity, 0.0) * image


def _free_covariance(hyper, z, y):
    """Return the same of a process without symmetry."""
    scale = jnp.exp(-hyper.lengths)
    away = (z - y) * scale
    bulk = 1 + jnp.sum(away**2) / (2 * ALPHA)
    variance = jnp.exp(2 * hyper.amplitude)
    first = bulk ** (-ALPHA - 1) * away * scale  # -dk/dz over the variance
    outer = (1 + 1 / ALPHA) * bulk ** (-ALPHA - 2) * jnp.outer(away * scale, away * scale)
    second = bulk ** (-ALPHA - 1) * jnp.diag(scale**2) - outer
    top = jnp.append(bulk**-ALPHA, first)
    below = jnp.concatenate([-first[:, None], second], axis=1)
    return variance * jnp.concatenate([top[None], below])


def solve(data: Data, mean: float, hyper: Hyper) -> Float[np.ndarray, "flows rows"]:
    """Return the coefficients of the observations in the predictions of one output.

    The covariance is made in parts and factorised in place, on the host, so that there is one such
    matrix in memory: 11 GB for 4,096 flows with eight slopes each.

    Args:
      data: observations of one output, the valid ones first.
      mean: of the process.
      hyper: of this output.

    Returns:
      The coefficients, which are zero in the padding.

    Raises:
      NotConverged: the covariance matrix is not positive definite to rounding.
    """
    capacity, size = data.rows.shape
    flows = int(np.sum(data.valid))
    matrix = np.empty((flows * size, flows * size))
    for start in range(0, flows, PART):
        part = np.arange(start, min(start + PART, capacity))
        rows = matrix[start * size : (start + PART) * size]
        rows[:] = _compiled_rows(data, hyper, part)[: len(rows), : len(matrix)]
    matrix[np.diag_indices_from(matrix)] += np.asarray(_noise(data, hyper))[: len(matrix)]
    found = np.asarray(_centred(data, mean)).copy()
    try:
        _factorise(matrix)
        found[:flows] = cho_solve(
            (matrix.T, False), found[:flows].ravel(), check_finite=False
        ).reshape(flows, size)
    except LinAlgError:
        found[:] = np.nan
    if not np.all(np.isfinite(found)):
        raise NotConverged("kriging: the covariance of these observations is singular to rounding")
    return found


def _factorise(matrix):
    """Overwrite the lower triangle of a symmetric matrix by its Cholesky factor, block by block.

    A single call of LAPACK would do, but that of OpenBLAS 0.3 on several threads ends the process
    by a segmentation fault where a matrix has tens of thousands of rows.
    """
    for start in range(0, len(matrix), BLOCK):
        end = start + BLOCK
        own, below = matrix[start:end, start:end], matrix[end:, start:end]
        own[:] = cholesky(own, lower=True, check_finite=False)
        below[:] = solve_triangular(own, below.T, lower=True, check_finite=False).T
        for k in range(0, len(below), BLOCK):
            matrix[end + k :, end + k : end + k + BLOCK] -= below[k:] @ below[k : k + BLOCK].T


@compiled()
@jax.value_and_grad
def negative_log_posterior(
    theta: Float[AnyArray, " numbers"],
    data: Data,
    mean: Float[AnyArray, ""],
    amplitude: tuple[Float[AnyArray, ""], Float[AnyArray, ""]],
) -> Float[Array, ""]:
    """Return the negative log posterior of one output's hyperparameters, and its gradient.

    Args:
      theta: the hyperparameters, as in ``hyper_of``.
      data: observations of one output.
      mean: of the process.
      amplitude: prior mean and deviation of the log of the amplitude.
    """
    hyper = hyper_of(theta)
    centred = _centred(data, mean).ravel()
    factor = jnp.linalg.cholesky(_matrix(data, hyper))
    white = jax.scipy.linalg.solve_triangular(factor, centred, lower=True)
    prior = jnp.sum(((hyper.lengths - np.log(LENGTH)) / LENGTH_DEVIATION) ** 2)
    middle, deviation = amplitude
    prior += ((hyper.amplitude - middle) / deviation) ** 2 + (hyper.noise / NOISE_DEVIATION) ** 2
    return white @ white / 2 + jnp.sum(jnp.log(jnp.diagonal(factor))) + prior / 2
