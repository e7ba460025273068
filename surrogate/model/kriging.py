"""Gradient-enhanced kriging: log Cd through every drag and slope that flows have told.

A Gaussian process (rational quadratic covariance, one length per input) of what a base model
leaves over, or of log Cd itself. Its amplitude and lengths are those of greatest posterior
probability. Rasmussen and Williams 2006, chapters 2, 5 and 9.4.
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

ALPHA = 2.0  # of the rational quadratic: a mixture of lengths that spreads about a factor of two
VALUE_NOISE, SLOPE_NOISE = 2e-5, 2e-4  # of log Cd and its slopes: the grid's own wiggle
LENGTH, SPREAD = 1.5, 0.7  # of lengths before anything is seen, and the deviation of their log
AMPLITUDE = (-1.0, 3.0)  # its log before anything is seen, and that log's deviation
CORRECTION = (-7.0, 1.5)  # the same of what a trained base leaves over
NOISY = 0.5  # deviation of the log of the noise over the above
BOUNDS = ((-10.0, 2.0), (-1.0, 4.0), (-2.0, 3.0))  # of the logs: amplitude, noise, lengths
FITTED = 64  # flows from which amplitude, noise and lengths are found; more would only cost
LEAST_CAPACITY, GROWTH = 8, 2


class Observation(NamedTuple):
    """One flow: a body, a Reynolds number, the drag, d log Cd / d(parameters, log Re)."""

    parameters: Float[AnyArray, " parameters"]
    reynolds: float
    drag: float
    slopes: Float[AnyArray, " inputs"]


class Data(eqx.Module):
    """Rows of value and slopes in scaled inputs, padded; ``real`` says which are no padding."""

    z: Float[AnyArray, "flows inputs"]
    rows: Float[AnyArray, "flows rows"]
    real: Bool[AnyArray, " flows"]


class Hyper(NamedTuple):
    """Logs of the amplitude, of the noise over what is usual, and of the lengths."""

    amplitude: Float[AnyArray, ""]
    noise: Float[AnyArray, ""]
    lengths: Float[AnyArray, " inputs"]


class Kriging(eqx.Module):
    """A drag model: the base, and the process through what it leaves over."""

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
        seen = jax.vmap(lambda y: _pair(self.hyper, z, y)[0])(self.data.z)
        left = self.mean + jnp.sum(seen * self.coefficients)
        return left if self.base is None else left + self.base.log_drag(z)


def kriging(
    told: Sequence[Observation],
    inputs: Inputs,
    base: DragNetwork | None = None,
    hyper: Hyper | None = None,
) -> Kriging:
    """The process through all that was told; ``hyper`` is found by likelihood where None."""
    data, mean = _data(told, inputs, base), _mean(told, base)
    hyper = likeliest(told, inputs, base) if hyper is None else hyper
    return Kriging(base, inputs, data, hyper, jnp.asarray(mean), _solve(data, mean, hyper))


def likeliest(told: Sequence[Observation], inputs: Inputs, base: DragNetwork | None) -> Hyper:
    """Amplitude, noise and lengths of greatest posterior probability."""
    data, mean = _data(told[:: -(-len(told) // FITTED)], inputs, base), _mean(told, base)
    amplitude, size = AMPLITUDE if base is None else CORRECTION, data.z.shape[1]

    def objective(theta):
        value, slope = _unlikelihood(theta, data, mean, amplitude)
        return float(value), np.asarray(slope)

    start = np.array([amplitude[0], 0.0, *[np.log(LENGTH)] * size])
    bounds = [*BOUNDS[:2], *[BOUNDS[2]] * size]
    options = {"maxiter": 40, "ftol": 1e-6}
    found = minimize(objective, start, jac=True, method="L-BFGS-B", bounds=bounds, options=options)
    return _hyper(jnp.asarray(found.x))


def _hyper(theta):
    return Hyper(theta[0], theta[1], theta[2:])


def _mean(told, base):
    """What is expected of log Cd, or of what the base leaves over, before anything is told."""
    return 0.0 if base is not None else np.mean([np.log(flow.drag) for flow in told])


def _centred(data, mean):
    """The rows about the mean, nought in the padding."""
    return jnp.where(data.real[:, None], data.rows.at[:, 0].add(-mean), 0.0)


def _matrix(data, hyper):
    """Covariance of all rows, noise included; padding is of variance 1 and tells nothing."""
    count, size = data.rows.shape
    pairs = jax.vmap(jax.vmap(_pair, (None, None, 0)), (None, 0, None))(hyper, data.z, data.z)
    full = pairs.transpose(0, 2, 1, 3).reshape(count * size, count * size)
    real = jnp.repeat(data.real, size)
    noise = jnp.exp(hyper.noise) * jnp.array([VALUE_NOISE, *[SLOPE_NOISE] * (size - 1)])
    diagonal = jnp.where(real, jnp.tile(noise**2, count), 1.0)
    return jnp.where(real[:, None] & real, full, 0.0) + jnp.diag(diagonal)


def _pair(hyper, z, y):
    """Covariance of value and slopes at z with value and slopes at y, in closed form."""
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
    left = _centred(data, mean)
    factor = jax.scipy.linalg.cho_factor(_matrix(data, hyper), lower=True)
    return jax.scipy.linalg.cho_solve(factor, left.ravel()).reshape(left.shape)


@jax.jit
@jax.value_and_grad
def _unlikelihood(theta, data, mean, amplitude):
    """Minus the log of likelihood and prior."""
    hyper = _hyper(theta)
    left = _centred(data, mean).ravel()
    factor = jnp.linalg.cholesky(_matrix(data, hyper))
    white = jax.scipy.linalg.solve_triangular(factor, left, lower=True)
    prior = jnp.sum(((hyper.lengths - np.log(LENGTH)) / SPREAD) ** 2)
    middle, wide = amplitude
    prior += ((hyper.amplitude - middle) / wide) ** 2 + (hyper.noise / NOISY) ** 2
    return white @ white / 2 + jnp.sum(jnp.log(jnp.diagonal(factor))) + prior / 2


def _data(told, inputs, base):
    """What the base leaves over of every flow, padded to a capacity."""
    capacity = LEAST_CAPACITY
    while capacity < len(told):
        capacity *= GROWTH
    padded = [told[min(k, len(told) - 1)] for k in range(capacity)]
    arrays = [np.array(part, float) for part in zip(*padded, strict=True)]
    z, rows = _left_over(inputs, base, *arrays)
    return Data(z, rows, jnp.arange(capacity) < len(told))


@jax.jit
def _left_over(inputs, base, parameters, reynolds, drags, slopes):
    z = jax.vmap(inputs)(parameters, reynolds)
    steep = jax.vmap(inputs.steepness)(parameters)
    rows = jnp.concatenate([jnp.log(drags)[:, None], slopes * steep], axis=1)
    if base is None:
        return z, rows
    values, slopes = jax.vmap(jax.value_and_grad(base.log_drag))(z)
    return z, rows - jnp.concatenate([values[:, None], slopes], axis=1)
