"""Training labels: traction modes, loads and their gradients, and a network's residuals to them.

Labels are stored: a sample whose label has converged is not evaluated again. They are found by
the inversions of ``inversion.py``.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from surrogate.arrays import AnyArray
from surrogate.model.features import incidence_index
from surrogate.model.network import LoadNetwork, moment_factors
from surrogate.scene.samples import Samples
from surrogate.training.methods.method import Batch
from surrogate.training.physics import Physics

# A choice: with less, gradients of the moment at low Re outweigh all other residuals in the fit.
LEAST_FACTOR = 0.1


class TrainingLabels(NamedTuple):
    """Training labels of many samples, or the label of one.

    The outputs are log Cd, and where there is lift Cl / Cd and Cm / Cd.

    Args:
      tractions: traction modes; of the Oseen flow until the label is valid.
      outputs: of the same flow.
      slopes: d outputs / d(parameters, log Re) of valid and converged labels, if requested.
      valid: whether there is a label, if only of a flow that has not converged.
      converged: whether no further evaluation is needed (also if none would succeed).
    """

    tractions: Float[AnyArray, "*samples modes"]
    outputs: Float[AnyArray, "*samples loads"]
    slopes: Float[AnyArray, "*samples loads inputs"]
    valid: Bool[AnyArray, "*samples"]
    converged: Bool[AnyArray, "*samples"]

    def pending(self, batch: Batch) -> Bool[np.ndarray, " batch"]:
        """Return whether the label of each sample has not converged."""
        return ~np.asarray(self.converged)[batch]

    @property
    def progress(self) -> str:
        """How many flows need no further step, and where there are more how many are begun."""
        valid, converged = np.asarray(self.valid), np.asarray(self.converged)
        begun, solved = np.sum(valid | converged), np.sum(converged)
        known = f"flows {solved} of {converged.size}"
        return known if begun == solved else f"{known}, {begun} begun"


def no_labels(physics: Physics) -> TrainingLabels:
    """Return the label store before any evaluation.

    It holds tractions and outputs of the Oseen flows; no label is valid or converged.
    """
    none = jnp.zeros(physics.count, bool)
    slopes = jnp.zeros((*physics.outputs.shape, physics.samples.parameters.shape[1] + 1))
    return TrainingLabels(physics.tractions, physics.outputs, slopes, none, none)


def load_residuals(
    network: LoadNetwork, samples: Samples, labels: TrainingLabels, index: Int[Array, ""]
) -> Float[Array, "loads outcomes"]:
    """Return the residuals of one sample: of every output, and of its gradient in scaled inputs.

    Residuals of labels that are not valid (gradient: not converged) are zero. Those of Cm / Cd of
    3-D bodies at incidence are weighted. With the factors c of its heads (``moment_factors``), the
    residual of the value is divided by |c|, that of the derivative in z_i by
    sqrt(|c|^2 + |dc/dz_i|^2), each at least ``LEAST_FACTOR``. So bodies that are symmetric fore and
    aft, which have the moment by inertia alone, count at low Re as others do, where its factor
    Re / (Re + 5) is small.

    Args:
      network: whose outputs are compared with the label.
      samples: all samples.
      labels: their labels.
      index: of the sample.

    Returns:
      One row for each output: its residual, then those of its derivatives in all scaled inputs.
    """
    parameters, reynolds = samples.at(index)
    z, steepness = network.inputs(parameters, reynolds), network.inputs.steepness(parameters)
    outputs, gradients = network.outputs(z), jax.jacrev(network.outputs)(z)
    residuals = jnp.where(labels.valid[index], outputs - labels.outputs[index], 0.0)
    known = labels.valid[index] & labels.converged[index]
    slopes = jnp.where(known, gradients - steepness * labels.slopes[index], 0.0)
    return _weights(network.inputs, z, len(outputs)) * jnp.column_stack([residuals, slopes])


def _weights(inputs, z, loads):
    """Return the weights of all residuals of one sample: 1, but for the moment of 3-D bodies."""
    weights = jnp.ones((loads, 1 + len(z)))
    if incidence_index(inputs.body_class) is None:
        return weights

    def factors(z):
        return moment_factors(inputs, inputs.features(z))

    values, slopes = factors(z), jax.jacfwd(factors)(z)
    squares = jnp.sum(values**2) + jnp.append(0.0, jnp.sum(slopes**2, axis=0))
    return weights.at[2].set(jax.lax.rsqrt(jnp.maximum(squares, LEAST_FACTOR**2)))
