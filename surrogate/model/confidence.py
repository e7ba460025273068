"""The expected error of a surrogate's answer, from its distance to the training samples."""

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from surrogate.arrays import AnyArray
from surrogate.model.network import LoadNetwork

RIDGE = 1e-4  # over the mean square of the training samples' gradients; 1e-6 to 1e-2 serve as well
COVERED = 0.95  # share of the bodies whose errors lie within the bounds


@dataclasses.dataclass(frozen=True, eq=False)
class Novelty:
    """How little the training samples say about a network's loads at other bodies and Re.

    The network is linearised in its weights w. The novelty of a load is the norm of the part of
    its gradient d(load)/dw / Cd that no combination of the gradients at the training samples
    gives: in the linearised model the standard deviation of the load, up to a factor, once the
    samples are known (linearised Laplace approximation, MacKay 1992).
    """

    network: LoadNetwork
    parameters: Float[AnyArray, "samples parameters"]  # of the training samples
    reynolds: Float[AnyArray, " samples"]

    def __call__(
        self, parameters: Float[AnyArray, "bodies parameters"], reynolds: Float[AnyArray, " bodies"]
    ) -> Float[Array, "bodies loads"]:
        """Return the novelty of each load of bodies at Reynolds numbers."""
        known, factor = self._known
        return _novelty(self.network, known, factor, jnp.asarray(parameters), jnp.asarray(reynolds))

    @functools.cached_property
    def _known(self):
        """Gradients at the training samples, and the Cholesky factor of their regularised Gram."""
        gradients = _gradients(self.network, self.parameters, self.reynolds)
        known = gradients.reshape(-1, gradients.shape[-1])
        gram = known @ known.T
        return known, jnp.linalg.cholesky(
            gram + RIDGE * jnp.mean(jnp.diag(gram)) * jnp.eye(len(gram))
        )


def error_scales(
    errors: Float[AnyArray, "bodies loads"], novelty: Float[AnyArray, "bodies loads"]
) -> Float[np.ndarray, " loads"]:
    """Return by how much the novelty of each load is to be multiplied to bound its error.

    By split conformal prediction: the errors of 95 % of other bodies, drawn as these, lie within
    their bounds, on average over draws. With fewer than 19 bodies the largest ratio is taken.

    Args:
      errors: of bodies that the training did not use, over Cd.
      novelty: of the same bodies.
    """
    ratios = np.sort(np.asarray(errors) / np.asarray(novelty), axis=0)
    rank = min(len(ratios), int(np.ceil((len(ratios) + 1) * COVERED)))
    return ratios[rank - 1]


@jax.jit
def _novelty(network, known, factor, parameters, reynolds):
    gradients = _gradients(network, parameters, reynolds)
    explained = jax.scipy.linalg.solve_triangular(
        factor, known @ gradients.reshape(-1, gradients.shape[-1]).T, lower=True
    )
    explained = jnp.sum(explained**2, axis=0).reshape(gradients.shape[:-1])
    # the ridge keeps the difference positive; rounding may not
    return jnp.sqrt(jnp.maximum(jnp.sum(gradients**2, axis=-1) - explained, 0.0))


@jax.jit
def _gradients(network, parameters, reynolds):
    """Gradients of the loads in the weights, over Cd, for each body."""

    def loads(weights, *sample):
        return network.with_load_weights(weights).loads(*sample)

    def gradient(*sample):
        return jax.jacrev(loads)(network.load_weights, *sample) / network.loads(*sample)[0]

    return jax.vmap(gradient)(jnp.asarray(parameters), jnp.asarray(reynolds))
