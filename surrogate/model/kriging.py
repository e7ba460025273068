"""Gradient-enhanced kriging (GEK): outputs interpolated from loads and slopes of solved flows.

The outputs are log Cd, and where there is lift Cl / Cd and Cm / Cd (``model/outputs.py``).
Each is a Gaussian process of its own, or its residual over a base network is, with constant mean
(``gaussian_process``). Amplitude, noise and lengths maximise the posterior.
"""

from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.optimize import minimize

from surrogate.arrays import AnyArray
from surrogate.compilation import compiled
from surrogate.model.gaussian_process import (
    AMPLITUDE,
    BOUNDS,
    LENGTH,
    RESIDUAL_AMPLITUDE,
    Data,
    Hyper,
    covariance,
    hyper_of,
    negative_log_posterior,
    solve,
)
from surrogate.model.inputs import Inputs
from surrogate.model.network import LoadNetwork
from surrogate.model.outputs import PARITY, OutputModel, gradients_of_loads, outputs_of

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
        return np.asarray(gradients_of_loads(self.loads, self.slopes))


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
                return covariance(hyper, z, y, parity, self.inputs.mirror)[0]

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

    Raises:
      NotConverged: the covariance matrix is not positive definite to rounding.
    """
    data, mean = _data(observations, inputs, base), _mean(observations, base)
    hyper = likeliest(observations, inputs, base) if hyper is None else hyper
    coefficients = [
        solve(data.of_load(k), float(mean[k]), jax.tree.map(lambda leaf, k=k: leaf[k, ...], hyper))
        for k in range(len(mean))
    ]
    return Kriging(base, inputs, data, hyper, mean, np.array(coefficients))


def uncorrected(inputs: Inputs, base: LoadNetwork, loads: int) -> Kriging:
    """Return a base network as the kriging model that no observation corrects yet.

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
        zeros((MIN_CAPACITY, size)), rows, zeros(MIN_CAPACITY, bool), PARITY[:loads], inputs.mirror
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
            value, gradient = negative_log_posterior(theta, own, mean[load], amplitude)
            return float(value), np.asarray(gradient)

        settings = {"jac": True, "method": "L-BFGS-B", "bounds": bounds, "options": options}
        return minimize(objective, start, **settings).x

    return hyper_of(np.array([fitted(load) for load in range(len(mean))]).T)


def _mean(observations, base):
    """Return the processes' means: of the observed log Cd where there is no base; else zero."""
    mean = np.zeros(len(observations[0].loads))
    if base is None:
        mean[0] = np.mean([np.log(flow.drag) for flow in observations])
    return mean


def _data(observations, inputs, base):
    """Return the rows of all observations, padded to a capacity."""
    count, capacity = len(observations), MIN_CAPACITY
    while capacity < count:
        capacity *= GROWTH
    padded = [observations[min(k, count - 1)] for k in range(capacity)]
    arrays = [np.array(part, float) for part in zip(*padded, strict=True)]
    z, rows = map(np.asarray, _residuals(inputs, base, *arrays))
    return Data(z, rows, np.arange(capacity) < count, PARITY[: len(rows)], inputs.mirror)


@compiled()
def _residuals(inputs, base, parameters, reynolds, loads, slopes):
    """Return scaled inputs, and outputs and slopes in them minus those of the base, loads first."""
    z = jax.vmap(inputs)(parameters, reynolds)
    steepness = jax.vmap(inputs.steepness)(parameters)[:, None]
    values = jax.vmap(outputs_of)(loads)
    rows = jnp.concatenate([values[..., None], slopes * steepness], axis=2)
    if base is not None:
        values, slopes = jax.vmap(base.outputs)(z), jax.vmap(jax.jacrev(base.outputs))(z)
        rows -= jnp.concatenate([values[..., None], slopes], axis=2)
    return z, rows.transpose(1, 0, 2)
