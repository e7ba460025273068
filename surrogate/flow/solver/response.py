"""The response G B of a body's traction modes, which preconditions and starts the solvers.

It is needed to a few digits only, so it is of single precision. On the whole lattice it takes one
convolution with G a mode. The velocity far from the body depends on few combinations of many modes,
since higher harmonics decay with the distance (a multipole expansion): ``CompressedResponse`` has
all modes near the body and these combinations elsewhere.
"""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from surrogate.arrays import AnyArray, by_lapack, full_single_precision, single, weighted_sum
from surrogate.flow.grid.domain import Domain, GreenFunction
from surrogate.flow.grid.immersed import Spreading


class FullResponse(eqx.Module):
    """The response G B of every mode on the whole lattice."""

    velocities: Float[AnyArray, "modes axes ..."]

    @full_single_precision
    def __call__(self, amplitude: Float[AnyArray, " modes"]) -> Float[AnyArray, "axes ..."]:
        """Return the Oseen velocity G B a of a traction, to the digits of the response."""
        velocity = weighted_sum(amplitude.astype(self.velocities.dtype), self.velocities)
        return velocity.astype(amplitude.dtype)

    def slips(self, body: Spreading) -> Float[AnyArray, "modes modes"]:
        """Return S G B, the slip that each mode causes, by columns."""
        return jax.vmap(body.slip)(self.velocities).T


class CompressedResponse(eqx.Module):
    """The response G B of every mode near the body, and of a few combinations of modes elsewhere.

    Attributes:
      near: velocity of every mode on the faces of the box.
      combinations: orthonormal combinations of modes, by rows.
      far: their velocities on the whole lattice.
      corner: index of the box's first cell along each axis.
    """

    near: Float[AnyArray, "modes axes ..."]
    combinations: Float[AnyArray, "combinations modes"]
    far: Float[AnyArray, "combinations axes ..."]
    corner: tuple[int, ...] = eqx.field(static=True)

    @full_single_precision
    def __call__(self, amplitude: Float[AnyArray, " modes"]) -> Float[AnyArray, "axes ..."]:
        """Return the Oseen velocity G B a of a traction, which is approximate outside the box."""
        traction = amplitude.astype(self.near.dtype)
        velocity = weighted_sum(self.combinations @ traction, self.far)
        sides = zip(self.corner, self.near.shape[2:], strict=True)
        box = (slice(None), *(slice(start, start + side) for start, side in sides))
        velocity = velocity.at[box].set(weighted_sum(traction, self.near))
        return velocity.astype(amplitude.dtype)

    def slips(self, body: Spreading) -> Float[AnyArray, "modes modes"]:
        """Return S G B, the slip that each mode causes, by columns."""
        return jax.vmap(_within(body, self.corner, self.near.shape[2:]).slip)(self.near).T


Response = FullResponse | CompressedResponse


@full_single_precision
def mode_response(
    domain: Domain, green: GreenFunction, body: Spreading, reynolds: Float[AnyArray, ""]
) -> Response:
    """Return the response G B of a body, compressed where ``domain.far_combinations`` says so.

    Args:
      domain: the discrete problem.
      green: G on the domain's lattice.
      body: the spread modes B.
      reynolds: U D / nu.
    """
    green, body = single(jax.lax.stop_gradient((green, body)))
    eye = jnp.eye(domain.modes.count, dtype=jnp.float32)
    if domain.far_combinations is None:
        return FullResponse(domain.each_mode(lambda a: green(body.spread(a)), eye))
    corner, lattice = domain.near
    here = jax.lax.stop_gradient(domain.green_function(lattice, reynolds, jnp.float32))
    near = _within(body, corner, lattice.shape)
    velocities = domain.each_mode(lambda a: here(near.spread(a)), eye)
    # The velocity on the edge of the box determines that outside: its principal components.
    edges = _edges(velocities, lattice.folded)
    combinations = by_lapack(jnp.linalg.eigh)(edges @ edges.T)[1].T[-domain.far_combinations :]
    far = domain.each_mode(lambda a: green(body.spread(a)), combinations)
    return CompressedResponse(velocities, combinations, far, corner)


def _within(body, corner, shape):
    """Return the same spreading on a box of the lattice, given by its first cell and its shape."""
    moved = tuple(own - start for own, start in zip(body.corner, corner, strict=True))
    return dataclasses.replace(body, corner=moved, shape=shape)


def _edges(
    velocities: Float[Array, "modes axes ..."], folded: tuple[int, ...]
) -> Float[Array, "modes _"]:
    """Return the velocities in the outermost cells of the box, mirror planes left out."""
    parts = []
    for axis in range(velocities.ndim - 2):
        ends = (-1,) if axis in folded else (0, -1)
        parts += [jnp.take(velocities, end, axis + 2).reshape(len(velocities), -1) for end in ends]
    return jnp.concatenate(parts, axis=1)
