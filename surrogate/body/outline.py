"""One body of the family: its outline, and whether its parameters describe a body.

    x = -(c/2) cos t,   y = b (sin t + beta2 sin 2t + beta3 sin 3t + ... + beta12 sin 12t),

c = sqrt(aspect) and b = 1 / (2 sqrt(aspect)), so the area is pi/4 whatever the parameters, in units
of the equivalent diameter D. In space the same meridian, volume pi/6, and a flatness: ``solid``.
"""

import functools
from collections.abc import Mapping

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from scipy.special import eval_chebyu

from surrogate.arrays import AnyArray
from surrogate.body.form import Form
from surrogate.body.measures import least, moments
from surrogate.body.solid import centre, half_axes
from surrogate.errors import InvalidInput

ASPECTS = (0.1, 20.0)  # length over thickness that the solver is tested for
FLATNESSES = (0.2, 5.0)  # width over height
MIN_THICKNESS_RATIO = 0.02  # thinnest y / (b sin t) a body may have


def opening(parameters: Float[AnyArray, " parameters"], form: Form) -> Float[AnyArray, ""]:
    """Least y / (b sin t) over the body: it crosses itself where this is not positive."""
    c = np.cos(np.linspace(0, np.pi, 181))  # sin kt / sin t is a Chebyshev polynomial of cos t
    waves = np.array([eval_chebyu(k - 1, c) for k in form.modes]).reshape(len(form.modes), c.size)
    return least(1 + form.betas(parameters) @ waves)


def min_thickness_ratios(
    bodies: Float[np.ndarray, "bodies parameters"], form: Form
) -> Float[np.ndarray, " bodies"]:
    """``opening`` of many bodies, however many, with little to compile."""
    size = 2 ** (max(len(bodies), 1) - 1).bit_length()
    filled = np.zeros((size, bodies.shape[1]))
    filled[: len(bodies)] = bodies
    return np.asarray(_openings(filled, form))[: len(bodies)]


@functools.partial(jax.jit, static_argnames="form")
def _openings(bodies, form):
    return jax.vmap(lambda parameters: opening(parameters, form))(bodies)


def family_markers(
    parameters: Float[AnyArray, " parameters"], form: Form, nodes: int
) -> Float[AnyArray, "nodes 2"]:
    """Contour of a body, clockwise from the nose, its centroid at the origin.

    In space seen from the side: length and height.
    """
    t = 2 * np.pi * np.arange(nodes) / nodes
    waves = zip(form.modes, form.betas(parameters), strict=True)
    y = np.sin(t) + sum(beta * np.sin(k * t) for k, beta in waves)
    if form.dimension == 3:
        half_length, _, half_height = half_axes(parameters, form)
        x = -half_length * (np.cos(t) - centre(parameters, form))
        return jnp.stack([x, half_height * y], axis=1)
    root = jnp.sqrt(form.aspect(parameters))
    markers = jnp.stack([-root / 2 * np.cos(t), 1 / (2 * root) * y], axis=1)
    return markers - jnp.array([moments(markers)[1][0], 0.0])


def check_body(named: Mapping[str, float], dimension: int = 2) -> None:
    """Raise InvalidInput unless the named parameters describe a body."""
    values = np.array(list(named.values()), float)
    if not np.all(np.isfinite(values)):
        raise InvalidInput("body: every shape parameter must be a finite number")
    form = Form(tuple(named), dimension)
    if "flatness" in named and dimension == 2:
        raise InvalidInput("flatness: is of bodies in space, dimension 3")
    ratios = zip(form.names[: form.ratios], ("length / thickness", "width / height"), strict=False)
    for name, meaning in ratios:
        least, most = limits(name)
        if not least <= named[name] <= most:
            raise InvalidInput(
                f"{name} {named[name]:g}: must lie between {least:g} and {most:g} ({meaning})"
            )
    if float(opening(values, form)) < MIN_THICKNESS_RATIO:
        betas = list(named.items())[form.ratios :]
        bent = ", ".join(f"{name} {value:g}" for name, value in betas if value)
        raise InvalidInput(
            f"body: {bent} make the contour cross or close on itself; smaller betas would not"
        )


def limits(name: str) -> tuple[float, float]:
    """Least and greatest value of a parameter."""
    return {"aspect": ASPECTS, "flatness": FLATNESSES}.get(name, (-1.0, 1.0))
