"""Gradient-enhanced kriging (GEK): outputs interpolated from loads and slopes of solved flows.

The outputs are log Cd, and where there is lift Cl / Cd and Cm / Cd (``model/outputs.py``).
Each is a Gaussian process of its own, or its residual over a base network is: constant mean,
rational quadratic covariance with one length scale per scaled input,

    k(z, y) = s^2 (1 + r^2 / (2 alpha))^-alpha,   r^2 = sum_i ((z_i - y_i) / l_i)^2.

With y' the scaled inputs of a body's mirror image, k(z, y) + k(z, y') makes log Cd even and
k(z, y) - k(z, y') the others odd, exactly. Slopes are observations too: their covariances are the
derivatives of k. Amplitude s, noise and lengths l maximise the posterior. Rasmussen and Williams
2006, chapters 2, 4.2, 5 and 9.4.
"""

import dataclasses
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
from surrogate.model.network import LoadNetwork
from surrogate.model.outputs import OutputModel, load_gradients, outputs_of

# Priors and bounds in logs. They were set on the default scene, where a likelihood alone fits few
# flows too closely; no study of them is kept.
ALPHA = 2.0  # a mixture of length scales that differ by a factor of about two
VALUE_NOISE, SLOPE_NOISE = 2e-5, 2e-4  # of outputs and their slopes: their grid-offset error
LENGTH, LENGTH_DEVIATION = 1.5, 0.7  # prior median of lengths, deviation of their log
AMPLITUDE = (-1.0, 3.0)  # prior mean and deviation of log s, for outputs
RESIDUAL_AMPLITUDE = (-7.0, 1.5)  # the same for the residual of a trained base
NOISE_DEVIATION = 0.5  # prior deviation of the log of the noise over VALUE_NOISE, SLOPE_NOISE
BOUNDS = ((-10.0, 2.0), (-1.0, 4.0), (-2.0, 3.0))  # of amplitude, noise, lengths
FITTED = 64  # observations at most from which hyperparameters are fitted: bounds the cost
MIN_CAPACITY, GROWTH = 16, 4  # of the padded arrays, so that few sizes are compiled


class Observation(NamedTuple):
    """One solved flow: body, Reynolds number, loads Cd (, Cl, Cm), and slopes of the outputs.

    ``slopes`` are the derivatives of log Cd (, Cl / Cd, Cm / Cd) in (parameters, log Re).
    """

    parameters: Float[AnyArray, " parameters"]
    reynolds: float
    loads: Float[AnyArray, " loads"]
    slopes: Float[AnyArray, "loads inputs"]

    @property
    def drag(self) -> float:
        """Drag coefficient Cd."""
        return float(self.loads[0])

    @property
    def load_slopes(self) -> Float[np.ndarray, "loads inputs"]:
        """Derivatives of the loads Cd (, Cl, Cm) in (parameters, log Re)."""
        return np.asarray(load_gradients(self.loads, self.slopes))


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


class Kriging(OutputModel):
    """Fitted Gaussian processes of the outputs, or of their residuals over a base network."""

    base: LoadNetwork | None
    inputs: Inputs
    data: Data
    hyper: Hyper
    mean: Float[AnyArray, " loads"]
    coefficients: Float[AnyArray, "loads flows rows"]

    def outputs(self, z: Float[AnyArray, " inputs"]) -> Float[Array, " loads"]:
        """Return log Cd, and where there is lift Cl / Cd and Cm / Cd, at scaled inputs."""

        def one(hyper, parity, mean, coefficients):
            def with_observation(y):
                return _covariance(hyper, z, y, parity, self.inputs.mirror)[0]

            return mean + jnp.sum(jax.vmap(with_observation)(self.data.z) * coefficients)

        residual = jax.vmap(one)(self.hyper, self.data.parity, self.mean, self.coefficients)
        return residual if self.base is None else residual + self.base.outputs(z)


def kriging(
    observations: Sequence[Observation],
    inputs: Inputs,
    base: LoadNetwork | None = None,
    hyper: Hyper | None = None,
) -> Kriging:
    """Fit the Gaussian processes to observations.

    Args:
      observations: solved flows, at least one.
      inputs: the scaling of bodies and Reynolds numbers.
      base: network whose residuals are modelled; the outputs themselves if None.
      hyper: hyperparameters; by default those of ``likeliest``.

    Returns:
      The fitted model.
    """
    data, mean = _data(observations, inputs, base), _mean(observations, base)
    hyper = likeliest(observations, inputs, base) if hyper is None else hyper
    coefficients = [
        np.asarray(
            _solve(data.of_load(k), mean[k], jax.tree.map(lambda leaf, k=k: leaf[k, ...], hyper))
        )
        for k in range(len(mean))
    ]
    return Kriging(base, inputs, data, hyper, mean, np.array(coefficients))


def uncorrected(inputs: Inputs, base: LoadNetwork, loads: int) -> Kriging:
    """Return a base network as kriging of its residual before the first observation: by zero.

    Its arrays have the shapes of kriging through a few observations, so that what uses the model is
    not compiled anew when the first is made.

    Args:
      inputs: the scaling of bodies and Reynolds numbers.
      base: network whose loads are returned unchanged.
      loads: number of its outputs.
    """
    size, zeros = len(inputs.mirror), np.zeros
    rows = zeros((loads, MIN_CAPACITY, 1 + size))
    data = Data(
        zeros((MIN_CAPACITY, size)), rows, zeros(MIN_CAPACITY, bool), _parity(loads), inputs.mirror
    )
    hyper = Hyper(zeros(loads), zeros(loads), zeros((loads, size)))
    return Kriging(base, inputs, data, hyper, zeros(loads), rows)


def likeliest(
    observations: Sequence[Observation], inputs: Inputs, base: LoadNetwork | None
) -> Hyper:
    """Return the hyperparameters of greatest posterior probability.

    They are fitted to at most ``FITTED`` of the observations, by L-BFGS-B.

    Args:
      observations: solved flows, at least one.
      inputs: the scaling of bodies and Reynolds numbers.
      base: network whose residuals are modelled; the outputs themselves if None.
    """
    some = observations[:: -(-len(observations) // FITTED)]
    data, mean = _data(some, inputs, base), _mean(observations, base)
    amplitude, size = AMPLITUDE if base is None else RESIDUAL_AMPLITUDE, data.z.shape[1]
    start = np.array([amplitude[0], 0.0, *[np.log(LENGTH)] * size])
    bounds = [*BOUNDS[:2], *[BOUNDS[2]] * size]
    options = {"maxiter": 40, "ftol": 1e-6}

    def fitted(load):
        own = data.of_load(load)

        def objective(theta):
            value, gradient = _negative_log_posterior(theta, own, mean[load], amplitude)
            return float(value), np.asarray(gradient)

        settings = {"jac": True, "method": "L-BFGS-B", "bounds": bounds, "options": options}
        return minimize(objective, start, **settings).x

    return _hyper(np.array([fitted(load) for load in range(len(mean))]).T)


def _hyper(theta):
    return Hyper(theta[0], theta[1], theta[2:].T)


def _mean(observations, base):
    """The processes' means: of the observed log Cd, else zero, as for the residuals of a base."""
    mean = np.zeros(len(observations[0].loads))
    if base is None:
        mean[0] = np.mean([np.log(flow.drag) for flow in observations])
    return mean


def _centred(data, mean):
    """The rows minus the mean; zero in the padding."""
    return jnp.where(data.valid[:, None], data.rows.at[:, 0].add(-mean), 0.0)


def _matrix(data, hyper):
    """Covariance of all rows with noise; padding is independent of all else, of variance 1."""
    count, size = data.rows.shape

    def covariance(z, y):
        return _covariance(hyper, z, y, data.parity, data.mirror)

    blocks = jax.vmap(jax.vmap(covariance, (None, 0)), (0, None))(data.z, data.z)
    full = blocks.transpose(0, 2, 1, 3).reshape(count * size, count * size)
    valid = jnp.repeat(data.valid, size)
    noise = jnp.exp(hyper.noise) * jnp.array([VALUE_NOISE, *[SLOPE_NOISE] * (size - 1)])
    diagonal = jnp.where(valid, jnp.tile(noise**2, count), 1.0)
    return jnp.where(valid[:, None] & valid, full, 0.0) + jnp.diag(diagonal)


def _covariance(hyper, z, y, parity, mirror):
    """Covariance matrix of (value, slopes) at z with (value, slopes) at y, even or odd."""
    direct = _free_covariance(hyper, z, y)
    image = _free_covariance(hyper, z, mirror * y) * jnp.append(1.0, mirror)
    lifting = jnp.any(mirror < 0)  # else every body is its own mirror image
    return direct + jnp.where(lifting, parity, 0.0) * image


def _free_covariance(hyper, z, y):
    """The same of a process without symmetry."""
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
    z, rows = map(np.asarray, _residuals(inputs, base, *arrays))
    return Data(z, rows, np.arange(capacity) < count, _parity(len(rows)), inputs.mirror)


def _parity(loads):
    """The outputs' factors under mirroring: log Cd is even, the others are odd."""
    return np.append(1.0, -np.ones(loads - 1))


@jax.jit
def _residuals(inputs, base, parameters, reynolds, loads, slopes):
    """Scaled inputs; outputs and their slopes in them, minus those of the base, loads first."""
    z = jax.vmap(inputs)(parameters, reynolds)
    steepness = jax.vmap(inputs.steepness)(parameters)[:, None]
    values = jax.vmap(outputs_of)(loads)
    rows = jnp.concatenate([values[..., None], slopes * steepness], axis=2)
    if base is not None:
        values, slopes = jax.vmap(base.outputs)(z), jax.vmap(jax.jacrev(base.outputs))(z)
        rows -= jnp.concatenate([values[..., None], slopes], axis=2)
    return z, rows.transpose(1, 0, 2)
