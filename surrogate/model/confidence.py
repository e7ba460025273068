"""Bounds for the errors of a surrogate's answers, by what the training samples leave unknown."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import scipy.linalg
from jaxtyping import Array, Float

from surrogate.arrays import AnyArray
from surrogate.model.network import LoadNetwork
from surrogate.scene.samples import Samples

RIDGE = 1e-4  # over the mean square of the training samples' gradients; 1e-6 to 1e-2 serve as well
MOST_SAMPLES = 1024  # that the bounds of answers take: preparing them takes seconds, not minutes
COVERED = 0.95  # share of the bodies whose errors lie within the bounds


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True, eq=False)
class Novelty:
    """A measure of how little the training samples say about the loads at another body and Re.

    The network is linearised in its weights w. With the gradients g = d(load)/dw / Cd at a body, K
    those of all loads at the training samples, one a row, and a ridge r, the novelty of a load is

        sqrt(g (K^T K / r + 1)^-1 g^T) = sqrt(g g^T - v^T v),   v = L^-1 K g^T / sqrt(r),

    with L L^T = K K^T / r + 1; in the linearised model it is the standard deviation of the load, up
    to a factor, once the samples are known (linearised Laplace approximation, MacKay 1992).
    """

    network: LoadNetwork
    known: Float[Array, "rows weights"]  # K / sqrt(r), or its R by QR if that has fewer rows
    factor: Float[Array, "rows rows"]  # L, lower
    ridge: Float[Array, ""]  # r, the variance by which each output of the samples is uncertain

    @classmethod
    def of(cls, network: LoadNetwork, samples: Samples) -> "Novelty":
        """Return the novelty measure of a network with respect to its training samples.

        Args:
          network: the trained network.
          samples: on which it was trained.
        """
        known = np.asarray(_all_gradients(network, *samples))
        ridge = RIDGE * np.mean(np.sum(known**2, axis=1))
        known = known / np.sqrt(ridge)
        if len(known) > known.shape[1]:  # fewer rows with the same K^T K
            known = scipy.linalg.qr(known, mode="economic")[1]
        matrix = known @ known.T  # by NumPy: BLAS takes half of the products
        matrix[np.diag_indices(len(matrix))] += 1.0
        factor = scipy.linalg.cholesky(matrix, lower=True, overwrite_a=True)
        return cls(network, *jax.device_put((known, factor, ridge)))

    @classmethod
    def of_answers(cls, network: LoadNetwork, samples: Samples) -> "Novelty":
        """Return the novelty measure for the bounds of answers, by at most 1,024 samples.

        It is larger than that of all samples, but grows in the same places, and bounds are scaled
        by the errors on held-out bodies. Samples of an infill beyond the first 1,024 do not count.

        Args:
          network: the trained network.
          samples: on which it was trained.
        """
        return cls.of(network, samples.head(MOST_SAMPLES))

    @jax.jit
    def __call__(
        self, parameters: Float[AnyArray, " parameters"], reynolds: Float[AnyArray, ""]
    ) -> Float[Array, " loads"]:
        """Return the novelty of each load of a body at a Reynolds number."""
        gradients = _gradients(self.network, parameters, reynolds).T
        explained = self._explained(gradients)
        left = jnp.sum(gradients**2, axis=0) - jnp.sum(explained**2, axis=0)
        return jnp.sqrt(jnp.maximum(left, 0.0))

    @jax.jit
    def covariance_parts(
        self, samples: Samples
    ) -> tuple[Float[Array, "weights outputs"], Float[Array, "rows outputs"]]:
        """Return g^T and v of all loads of some samples, a column for each; see ``Novelty``.

        g g^T - v^T v is the covariance of the loads in the linearised model once the training
        samples are known, up to the factor of the novelty. All loads of a sample stand together.
        """
        gradients = _all_gradients(self.network, *samples).T
        return gradients, self._explained(gradients)

    def _explained(self, gradients):
        """Return the vectors v, a column for each of the gradients."""
        return jax.scipy.linalg.solve_triangular(self.factor, self.known @ gradients, lower=True)


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


def coverage(bodies: int) -> float:
    """Return the share of errors that ``error_scales`` of this many bodies cover."""
    return min(COVERED, bodies / (bodies + 1))


@jax.jit
def _all_gradients(network, parameters, reynolds):
    """Return the gradients of all loads of some bodies in the weights, over Cd, a row for each."""
    gradients = jax.vmap(_gradients, (None, 0, 0))(network, parameters, reynolds)
    return gradients.reshape(-1, gradients.shape[-1])


def _gradients(network, *sample):
    """Return the gradients of the loads of a body in the weights, over Cd."""

    def loads(weights):
        return network.with_load_weights(weights).loads(*sample)

    return jax.jacrev(loads)(network.load_weights) / network.loads(*sample)[0]
