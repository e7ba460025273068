"""The skin of a body in space: the plane's meridian on cross-sections that are ellipses.

    x = -(c/2) mu,   y = w s q cos phi,   z = h s q sin phi,   mu = cos t,  s = sin t,

with s q = sin t + beta2 sin 2t + ..., so that q is a sum of Chebyshev polynomials of mu. Flatness
is w / h (1: a body of revolution), aspect c / (2 sqrt(w h)), and the volume pi/6.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.polynomial import legendre
from scipy.special import chebyu

from surrogate.arrays import AnyArray
from surrogate.body.form import Form

GAUSS = legendre.leggauss(32)  # exact for the squares of twelve modes
QUARTERS = 4  # of a body, of which one is gridded


class Skin(eqx.Module):
    """Points of a quarter of the skin (y, z > 0) and their area vectors per unit mu and phi.

    ``nodes`` are the rings, at Gauss points of mu from nose to tail, and the azimuths of each, in
    the middle of equal steps of a quarter turn. The volume's centroid is the origin.
    """

    points: Float[AnyArray, "nodes 3"]
    areas: Float[AnyArray, "nodes 3"]
    nodes: tuple[int, int] = eqx.field(static=True)

    def __iter__(self):
        return iter((self.points, self.areas))


def half_axes(
    parameters: Float[AnyArray, " parameters"], form: Form
) -> tuple[Float[AnyArray, ""], Float[AnyArray, ""], Float[AnyArray, ""]]:
    """c / 2, w and h of a body in space, in D."""
    mu, weight = GAUSS
    bulk = 3 / 4 * weight @ ((1 - mu**2) * _fullness(parameters, form, mu)[0] ** 2)
    aspect, flatness = form.aspect(parameters), form.flatness(parameters)
    thickness = (aspect * bulk) ** (-1 / 3)
    return (
        aspect * thickness / 2,
        thickness * jnp.sqrt(flatness) / 2,
        thickness / jnp.sqrt(flatness) / 2,
    )


def centre(parameters: Float[AnyArray, " parameters"], form: Form) -> Float[AnyArray, ""]:
    """mu of the volume's centroid."""
    mu, weight = GAUSS
    section = weight * (1 - mu**2) * _fullness(parameters, form, mu)[0] ** 2
    return section @ mu / jnp.sum(section)


def skin(parameters: Float[AnyArray, " parameters"], form: Form, nodes: tuple[int, int]) -> Skin:
    """A body's skin at ``nodes`` rings and azimuths."""
    return Skin(*skin_at(parameters, form, *skin_grid(nodes)), nodes)


def skin_at(
    parameters: Float[AnyArray, " parameters"],
    form: Form,
    mu: Float[np.ndarray, " points"],
    phi: Float[np.ndarray, " points"],
) -> tuple[Float[Array, "points 3"], Float[Array, "points 3"]]:
    """Points of a body's skin, and their area vectors per unit mu and phi."""
    length, width, height = half_axes(parameters, form)
    q, slope = _fullness(parameters, form, mu)
    s, y, z = np.sqrt(1 - mu**2), np.cos(phi), np.sin(phi)
    x = -length * (mu - centre(parameters, form))
    points = jnp.stack([x, width * s * q * y, height * s * q * z], axis=1)
    along = width * height * ((1 - mu**2) * q * slope - mu * q**2)
    areas = jnp.stack([along, length * height * s * q * y, length * width * s * q * z], axis=1)
    return points, areas


def skin_grid(
    nodes: tuple[int, int],
) -> tuple[Float[np.ndarray, " nodes"], Float[np.ndarray, " nodes"]]:
    """mu and phi of a skin's nodes: Gauss points, and middles of equal steps of a quarter turn."""
    mu = legendre.leggauss(nodes[0])[0][::-1]
    phi = (np.arange(nodes[1]) + 0.5) * (np.pi / 2 / nodes[1])
    along, around = np.meshgrid(mu, phi, indexing="ij")
    return along.ravel(), around.ravel()


def _fullness(parameters, form, mu):
    """q and dq/dmu: 1 + sum beta_k U_(k-1)(mu)."""
    betas = form.betas(parameters)
    waves = np.array([chebyu(k - 1)(mu) for k in form.modes]).reshape(len(form.modes), mu.size)
    slopes = np.array([chebyu(k - 1).deriv()(mu) for k in form.modes]).reshape(waves.shape)
    return 1 + betas @ waves, betas @ slopes
