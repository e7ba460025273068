"""Gradient-enhanced kriging (GEK): log Cd interpolated from drags and slopes of solved flows.

A Gaussian process of log Cd, or of the residual log Cd - log Cd of a base network: constant mean,
rational quadratic covariance with one length scale per scaled input,

    k(z, y) = s^2 (1 + r^2 / (2 alpha))^-alpha,   r^2 = sum_i ((z_i - y_i) / l_i)^2.

Slopes are observations too: their covariances are the derivatives of k. Amplitude s, noise and
lengths l maximise the posterior. Rasmussen and Williams 2006, chapters 2, 4.2, 5 and 9.4.
"""

from collections.abc import Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float
from scipy.optimize import minimize

from surrogate.arrays import AnyArray
from surrogate.model.inputs import Inputs
from surrogate.model.network import DragNetwork

# Priors and bounds in logs. They were set on the default scene, where a likelihood alone fits few
# flows too closely; no study of them is kept.
ALPHA = 2.0  # a mixture of length scales that differ by a factor of about two
VALUE_NOISE, SLOPE_NOISE = 2e-5, 2e-4  # of log Cd and its slopes: their grid-offset error
LENGTH, LENGTH_DEVIATION = 1.5, 0.7  # prior median of lengths, deviation of their log
AMPLITUDE = (-1.0, 3.0)  # prior mean and deviation of log s, for log Cd
RESIDUAL_AMPLITUDE = (-7.0, 1.5)  # the same for the residual of a trained base
NOISE_DEVIATION = 0.5  # prior deviation of the log of the noise over VALUE_NOISE, SLOPE_NOISE
BOUNDS = ((-10.0, 2.0), (-1.0, 4.0), (-2.0, 3.0))  # of amplitude, noise, lengths
FITTED = 64  # observations at most from which hyperparameters are fitted: bounds the cost
MIN_CAPACITY, GROWTH = 16, 4  # of the padded arrays, so that few sizes are compiled


class Observation(NamedTuple):
    """One solved flow: body, Reynolds number, Cd, and d log Cd / d(parameters, log Re)."""

    parameters: Float[AnyArray, " parameters"]
    reynolds: float
    drag: float
    slopes: Float[AnyArray, " inputs"]


class Data(eqx.Module):
    """Observations in scaled inputs: rows of (value, slopes), padded where not ``valid``."""

    z: Float[AnyArray, "flows inputs"]
    rows: Float[AnyArray, "flows rows"]
    valid: Bool[AnyArray, " flows"]


class Hyper(NamedTuple):
    """Hyperparameters as logs: amplitude, noise over its usual size, lengths."""

    amplitude: Float[AnyArray, ""]
    noise: Float[AnyArray, ""]
    lengths: Float[AnyArray, " inputs"]


class Kriging(eqx.Module):
    """A fitted process, plus the base network whose residual it models, if any."""

    base: DragNetwork | None
    inputs: Inputs
    data: Data
    hyper: Hyper
    mean: Float[AnyArray, ""]
    coefficients: Float[AnyArray, "flows rows"]

    def drag(
        self, parameters: Float[AnyArray, " parameters"], reynolds: Float[AnyArray, ""]
    ) -> Float[Array, ""]:
        """Cd of a body."""
        return jnp.exp(self.log_drag(self.inputs(parameters, reynolds)))

    def log_drag(self, z: Float[AnyArray, " inputs"]) -> Float[Array, ""]:
        """log Cd at scaled inputs."""
        covariances = jax.vmap(lambda y: _covariance(self.hyper, z, y)[0])(self.data.z)
        residual = self.mean + jnp.sum(covariances * self.coefficients)
        return residual if self.base is None else residual + self.base.log_drag(z)


def kriging(
    observations: Sequence[Observation],
    inputs: Inputs,
    base: DragNetwork | None = None,
    hyper: Hyper | None = None,
) -> Kriging:
    """Fit the process to observations.

    Args:
      observations: solved flows, at least one.
      inputs: the scaling of bodies and Reynolds numbers.
      base: network whose residual is modelled; log Cd itself if None.
      hyper: hyperparameters; by default those of ``likeliest``.
    """
    data, mean = _data(observations, inputs, base), _mean(observations, base)
    hyper = likeliest(observations, inputs, base) if hyper is None else hyper
    return Kriging(base, inputs, data, hyper, jnp.asarray(mean), _solve(data, mean, hyper))


def likeliest(
    observations: Sequence[Observation], inputs: Inputs, base: DragNetwork | None
) -> Hyper:
    """Hyperparameters of greatest posterior probability, from at most ``FITTED`` observations."""
    some = observations[:: -(-len(observations) // FITTED)]
    data, mean = _data(some, inputs, base), _mean(observations, base)
    amplitude, size = AMPLITUDE if base is None else RESIDUAL_AMPLITUDE, data.z.shape[1]

    def objective(theta):
        value, gradient = _negative_log_posterior(theta, data, mean, amplitude)
        return float(value), np.asarray(gradient)

    start = np.array([amplitude[0], 0.0, *[np.log(LENGTH)] * size])
    bounds = [*BOUNDS[:2], *[BOUNDS[2]] * size]
    options = {"maxiter": 40, "ftol": 1e-6}
    found = minimize(objective, start, jac=True, method="L-BFGS-B", bounds=bounds, options=options)
    return _hyper(jnp.asarray(found.x))


def _hyper(theta):
    return Hyper(theta[0], theta[1], theta[2:])


def _mean(observations, base):
    """The process's mean: of the observed log Cd, or zero for a base's residual."""
    return 0.0 if base is not None else np.mean([np.log(flow.drag) for flow in observations])


def _centred(data, mean):
    """The rows minus the mean; zero in the padding."""
    return jnp.where(data.valid[:, None], data.rows.at[:, 0].add(-mean), 0.0)


def _matrix(data, hyper):
    """Covariance of all rows with noise; padding is independent of all else, of variance 1."""
    count, size = data.rows.shape
    pairs = jax.vmap(jax.vmap(_covariance, (None, None, 0)), (None, 0, None))
    blocks = pairs(hyper, data.z, data.z)
    full = blocks.transpose(0, 2, 1, 3).reshape(count * size, count * size)
    valid = jnp.repeat(data.valid, size)
    noise = jnp.exp(hyper.noise) * jnp.array([VALUE_NOISE, *[SLOPE_NOISE] * (size - 1)])
    diagonal = jnp.where(valid, jnp.tile(noise**2, count), 1.0)
    return jnp.where(valid[:, None] & valid, full, 0.0) + jnp.diag(diagonal)


def _covariance(hyper, z, y):
    """Covariance matrix of (value, slopes) at z with (value, slopes) at y."""
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


@jax.jit
def _solve(data, mean, hyper):
    centred = _centred(data, mean)
    factor = jax.scipy.linalg.cho_factor(_matrix(data, hyper), lower=True)
    return jax.scipy.linalg.cho_solve(factor, centred.ravel()).reshape(centred.shape)


@jax.jit
@jax.value_and_grad
def _negative_log_posterior(theta, data, mean, amplitude):
    hyper = _hyper(theta)
    centred = _centred(data, mean).ravel()
    factor = jnp.linalg.cholesky(_matrix(data, hyper))
    white = jax.scipy.linalg.solve_triangular(factor, centred, lower=True)
    prior = jnp.sum(((hyper.lengths - np.log(LENGTH)) / LENGTH_DEVIATION) ** 2)
    middle, deviation = amplitude
    prior += ((hyper.amplitude - middle) / deviation) ** 2 + (hyper.noise / NOISE_DEVIATION) ** 2
    return white @ white / 2 + jnp.sum(jnp.log(jnp.diagonal(factor))) + prior / 2


def _data(observations, inputs, base):
    """Rows of all observations, padded to a capacity."""
    count, capacity = len(observations), MIN_CAPACITY
    while capacity < count:
        capacity *= GROWTH
    padded = [observations[min(k, count - 1)] for k in range(capacity)]
    arrays = [np.array(part, float) for part in zip(*padded, strict=True)]
    z, rows = _residuals(inputs, base, *arrays)
    return Data(z, rows, jnp.arange(capacity) < count)


@jax.jit
def _residuals(inputs, base, parameters, reynolds, drags, slopes):
    """Scaled inputs; log Cd and its slopes in them, minus those of the base."""
    z = jax.vmap(inputs)(parameters, reynolds)
    steepness = jax.vmap(inputs.steepness)(parameters)
    rows = jnp.concatenate([jnp.log(drags)[:, None], slopes * steepness], axis=1)
    if base is None:
        return z, rows
    values, slopes = jax.vmap(jax.value_and_grad(base.log_drag))(z)
    return z, rows - jnp.concatenate([values[:, None], slopes], axis=1)
