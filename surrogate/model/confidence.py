"""Bounds for the errors of a surrogate's answers, by what the training samples leave unknown."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from surrogate.arrays import AnyArray
from surrogate.model.network import LoadNetwork
from surrogate.scene.samples import Samples

RIDGE = 1e-4  # over the mean square of the training samples' gradients; 1e-6 to 1e-2 serve as well
COVERED = 0.95  # share of the bodies whose errors lie within the bounds


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True, eq=False)
class Novelty:
    """A measure of how little the training samples say about the loads at another body and Re.

    The network is linearised in its weights w. The novelty of a load is the norm of the part of
    its gradient d(load)/dw / Cd that no combination of the gradients at the training samples
    gives: in the linearised model the standard deviation of the load, up to a factor, once the
    samples are known (linearised Laplace approximation, MacKay 1992).
    """

    network: LoadNetwork
    known: Float[Array, "outputs weights"]  # gradients of all loads at all training samples
    factor: Float[Array, "outputs outputs"]  # Cholesky factor of their regularised Gram matrix

    @classmethod
    def of(cls, network: LoadNetwork, samples: Samples) -> "Novelty":
        """Return the novelty measure of a network with respect to its training samples.

        Args:
          network: the trained network.
          samples: on which it was trained.
        """
        return cls(network, *_known(network, *samples))

    @jax.jit
    def __call__(
        self, parameters: Float[AnyArray, " parameters"], reynolds: Float[AnyArray, ""]
    ) -> Float[Array, " loads"]:
        """Return the novelty of each load of a body at a Reynolds number."""
        gradients = _gradients(self.network, parameters, reynolds)
        explained = self._explained(gradients)
        # the ridge keeps the difference positive; rounding may not
        left = jnp.sum(gradients**2, axis=-1) - jnp.sum(explained**2, axis=0)
        return jnp.sqrt(jnp.maximum(left, 0.0))

    @jax.jit
    def gradients(
        self, samples: Samples
    ) -> tuple[Float[Array, "outputs weights"], Float[Array, "known outputs"]]:
        """Return the gradients of the loads over Cd at some samples, and what is known of them.

        All loads of a sample stand together. With these g and e the covariance of the loads, once
        the training samples are known, is g g^T - e^T e, up to the same factor as the novelty.
        """
        gradients = _all_gradients(self.network, *samples)
        return gradients, self._explained(gradients)

    @property
    def ridge(self) -> Float[Array, ""]:
        """The variance by which each output counts as uncertain even where it is known."""
        return _ridge(self.known)

    def _explained(self, gradients):
        return jax.scipy.linalg.solve_triangular(self.factor, self.known @ gradients.T, lower=True)


def error_scales(
    errors: Float[AnyArray, "bodies loads"], novelty: Float[AnyArray, "bodies loads"]
) -> Float[np.ndarray, " loads"]:
    """Return the factors by which the novelty of each load is multiplied to bound its error.

    By split conformal prediction: the errors of 95 % of other bodies, drawn as these, lie within
    their bounds, on average over draws. With n < 19 bodies the largest ratio is taken,
    which covers n / (n + 1).

    Args:
      errors: of bodies that the training did not use, over Cd.
      novelty: of the same bodies.
    """
    ratios = np.sort(np.asarray(errors) / np.asarray(novelty), axis=0)
    rank = min(len(ratios), int(np.ceil((len(ratios) + 1) * COVERED)))
    return ratios[rank - 1]


@jax.jit
def _known(network, parameters, reynolds):
    """Gradients at samples, and the Cholesky factor of their regularised Gram matrix."""
    known = _all_gradients(network, parameters, reynolds)
    return known, jnp.linalg.cholesky(known @ known.T + _ridge(known) * jnp.eye(len(known)))


def _ridge(known):
    return RIDGE * jnp.mean(jnp.sum(known**2, axis=1))


def _all_gradients(network, parameters, reynolds):
    """Gradients of all loads of some bodies in the weights, over Cd, a row for each."""
    gradients = jax.vmap(_gradients, (None, 0, 0))(network, parameters, reynolds)
    return gradients.reshape(-1, gradients.shape[-1])


def _gradients(network, *sample):
    """Gradients of the loads of a body in the weights, over Cd."""

    def loads(weights):
        return network.with_load_weights(weights).loads(*sample)

    return jax.jacrev(loads)(network.load_weights) / network.loads(*sample)[0]
