"""Contours and surfaces of bodies as nodes, by one program for all bodies of a class."""

import functools

import jax
from jaxtyping import Array, Float

from surrogate.arrays import AnyArray
from surrogate.body.body_class import BodyClass
from surrogate.body.skin import Skin, SkinNodes
from surrogate.compilation import compiled


@compiled("body_class", "nodes")
def drawn_outline(
    body_class: BodyClass, parameters: Float[AnyArray, " parameters"], nodes: int
) -> Float[Array, "nodes 2"]:
    """Return ``body_class.outline`` of a body, by one program for all bodies of the class."""
    return body_class.outline(parameters, nodes)


@functools.partial(jax.jit, static_argnames=("body_class", "nodes"))
def drawn_contour(
    body_class: BodyClass, parameters: Float[AnyArray, " parameters"], nodes: int
) -> Float[Array, "nodes 2"]:
    """Return ``body_class.contour`` of a body, by one program for all bodies of the class."""
    return body_class.contour(parameters, nodes)


@functools.partial(jax.jit, static_argnums=(0, 2))
def body_markers(
    body_class: BodyClass,
    parameters: Float[AnyArray, " parameters"],
    nodes: int | SkinNodes,
) -> Float[AnyArray, "nodes 2"] | Skin:
    """Return the surface markers of a family body as it lies, by one program for each class."""
    return body_class.markers(parameters, nodes)
