"""Scaled inputs of load models: logs of length ratios and of Re, the others as they are.

All are in [-1, 1]. The mirror image of a body in y = 0 has the opposite camber and incidence; these
are scaled without an offset, so that it has the opposite scaled inputs there. So are sine modes
that describing a body by its opposite nose negates.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from surrogate.arrays import AnyArray
from surrogate.body.body_class import BodyClass
from surrogate.model.features import (
    evaluate_features,
    incidence_index,
    mirror_of_features,
    negated_by_reversal,
)
from surrogate.scene.scene import Scene


class Inputs(eqx.Module):
    """The affine map of a scene's ranges to [-1, 1]; length ratios and Re enter by their logs."""

    low: Float[AnyArray, " inputs"]
    high: Float[AnyArray, " inputs"]
    body_class: BodyClass = eqx.field(static=True)

    def __call__(
        self, parameters: Float[AnyArray, " parameters"], reynolds: Float[AnyArray, ""]
    ) -> Float[Array, " inputs"]:
        """Return the scaled inputs z of a body and a Reynolds number."""
        low, width = jax.lax.stop_gradient((self.low, self.width))
        values = jnp.append(self.body_class.smooth(parameters), jnp.log(reynolds))
        return 2 * (values - low) / width - 1

    @property
    def mirror(self) -> np.ndarray:
        """The factors, 1 or -1, from the scaled inputs of a body to those of its mirror image."""
        return np.where([*_keep_mirror_plane(self.body_class), True], 1.0, -1.0)

    def features(self, z: Float[AnyArray, " inputs"]) -> Float[Array, " features"]:
        """Return the features of scaled inputs, see ``surrogate.model.features``."""
        return evaluate_features(self.body_class, z, jax.lax.stop_gradient(self.largest_incidence))

    @property
    def largest_incidence(self) -> Float[AnyArray, ""] | float:
        """The incidence in degrees at which its scaled input is 1, for bodies in 3-D; else 0."""
        index = incidence_index(self.body_class)
        return 0.0 if index is None else self.high[index]

    @property
    def feature_mirror(self) -> np.ndarray:
        """The factors, 1 or -1, from the features of a body to those of its mirror image."""
        return mirror_of_features(self.body_class, self.mirror)

    def steepness(self, parameters: Float[AnyArray, " parameters"]) -> Float[AnyArray, " inputs"]:
        """Return d(parameters, log Re) / dz, which converts slopes to slopes in scaled inputs."""
        smooth = jax.jvp(self.body_class.smooth, (parameters,), (jnp.ones_like(parameters),))[1]
        return jax.lax.stop_gradient(self.width) / 2 / jnp.append(smooth, 1.0)

    @property
    def width(self) -> Float[Array, " inputs"]:
        """The length of every range, of length ratios and Re in logs; 1 where it is a point."""
        return jnp.where(self.high > self.low, self.high - self.low, 1.0)  # of a single Re: 1


def scene_inputs(scene: Scene) -> Inputs:
    """Return the map of a scene's bodies and Reynolds numbers to scaled inputs."""
    body_class = scene.family.body_class
    kept = _keep_mirror_plane(body_class) & ~np.array(negated_by_reversal(body_class))
    low, high = scene.family.bounds.T
    largest = np.maximum(np.abs(low), np.abs(high))
    ends = zip(
        (np.where(kept, low, -largest), np.where(kept, high, largest)), scene.reynolds, strict=True
    )
    scaled = (jnp.asarray(np.append(body_class.smooth(p), np.log(re)), float) for p, re in ends)
    return Inputs(*scaled, body_class)


def _keep_mirror_plane(body_class):
    """Return which parameters leave bodies symmetric in y = 0."""
    return np.array([parameter.keeps_mirror_plane for parameter in body_class.parameters])


def quadratic(z: Float[AnyArray, " inputs"]) -> Float[Array, " features"]:
    """Return all monomials of z up to degree 2: 1, z_i, and z_i z_j for i <= j."""
    i, j = np.triu_indices(z.size)
    return jnp.concatenate([jnp.ones(1), z, z[i] * z[j]])
