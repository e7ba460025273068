"""Constraints on a body: ranges of its parameters, and constraint values c(p) >= 0.

A new bound is an entry of ``BOUNDS`` and the field of ``Problem`` of that name. Symbols as in
``shapeopt/README.md``, section 1; lengths are by the problem's ``Reference``.
"""

import functools
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from shapeopt.problem.reference import Reference
from surrogate.arrays import AnyArray
from surrogate.body.body_class import BodyClass
from surrogate.body.measures import least
from surrogate.body.validity import CLEAR_THICKNESS_RATIO
from surrogate.compilation import compiled

FEASIBLE = -1e-6  # constraint value down to which a body counts as feasible: rounding and solver
EVERY = "every body of the family"
OWN_SHAPE = "own shape"  # the constraint that a body does not cross itself


class Bound(NamedTuple):
    """A kind of bound that a problem may set on a length measured on a body, in D.

    It holds for every value of ``measure``, a method of ``BodyClass``: a minimum where ``sense`` is
    1, a maximum where it is -1. ``unbounded`` is a bound that every body satisfies. ``usual``
    stands for a bound that is not set when two problems are compared. An ``optional`` one has so
    many values that it takes part only where it is set. ``conflict`` begins the text of a conflict.
    """

    measure: str
    sense: int
    unbounded: float
    usual: float
    conflict: str
    optional: bool = False

    def values(
        self, body_class: BodyClass, parameters: Float[AnyArray, " parameters"]
    ) -> Float[Array, " values"]:
        """Return the quantities of a body that the bound limits."""
        return jnp.hstack(jax.tree.leaves(getattr(body_class, self.measure)(parameters)))


BOUNDS = {
    "max_length": Bound("length", -1, 100.0, 3.0, f"{EVERY} is longer than"),
    "min_thickness": Bound("thickness", 1, 0.0, 0.3, f"{EVERY} is thinner than"),
    # the next two all along the body, because an optimum meets them at several places
    "max_thickness": Bound("thicknesses", -1, 100.0, 1.0, f"{EVERY} is thicker than", True),
    "max_camber": Bound("cambers", -1, 100.0, 0.5, f"{EVERY} has more camber than", True),
    "min_radius": Bound("radii", 1, 0.0, 0.0, f"{EVERY} has somewhere a radius below"),
}


class Station(NamedTuple):
    """A lower bound on the thickness at one place along the chord.

    Args:
      x: x/c, 0 at the nose and 1 at the tail.
      thickness: least thickness there, in D, or in chords where the problem is by the chord.
    """

    x: float
    thickness: float


FREE_STATION = Station(0.5, 0.0)  # that every body satisfies


class Limits(eqx.Module):
    """All constraints of a problem as arrays.

    ``low`` and ``high`` are the ranges of the variables of the search: the parameters of the body,
    and behind them those that an objective adds. ``shift`` are the shape changes of the scenarios,
    under which a body must not cross itself; ``bounds`` are values by their names in ``BOUNDS``;
    ``stations`` has rows (x/c, thickness).
    """

    low: Float[AnyArray, " variables"]
    high: Float[AnyArray, " variables"]
    shift: Float[AnyArray, "cases parameters"]
    bounds: dict[str, Float[AnyArray, ""]]
    stations: Float[AnyArray, "stations 2"]
    reference: Reference = eqx.field(static=True)

    @property
    def body_class(self) -> BodyClass:
        """The class of the bodies."""
        return self.reference.body_class

    @property
    def width(self) -> Float[AnyArray, " variables"]:
        """Widths of the ranges, at least 1e-12 so that variables can be scaled by them."""
        return jnp.maximum(self.high - self.low, 1e-12)

    def body(self, variables: Float[AnyArray, " variables"]) -> Float[AnyArray, " parameters"]:
        """Return the parameters of the body, the first of the variables."""
        return variables[: self.shift.shape[-1]]

    def padded(self, names: set[str], stations: int, cases: int, variables: int) -> "Limits":
        """Return equivalent constraints with these bounds, and these numbers of all else.

        What is added is satisfied by every body, so that limits can be stacked. Variables that are
        added are held at 0.
        """
        added = np.tile(np.array(FREE_STATION), (stations - len(self.stations), 1))
        return Limits(
            np.pad(self.low, (0, variables - len(self.low))),
            np.pad(self.high, (0, variables - len(self.high))),
            np.pad(self.shift, ((0, cases - len(self.shift)), (0, 0)), mode="edge"),
            {name: np.asarray(BOUNDS[name].unbounded) for name in names} | self.bounds,
            np.concatenate([self.stations, added]),
            self.reference,
        )


@jax.jit
def constraint_values(
    variables: Float[AnyArray, " variables"], limits: Limits
) -> Float[Array, " constraints"]:
    """Return c(p), which is >= 0 where a body satisfies the constraints other than its ranges."""
    parameters = limits.body(variables)
    body, unit = limits.body_class, limits.reference.length(parameters)
    ratios = jax.vmap(lambda shift: body.min_thickness_ratio(parameters + shift))(limits.shift)
    values = [least(ratios) - CLEAR_THICKNESS_RATIO]
    for name, bound in BOUNDS.items():
        if name in limits.bounds:
            lengths = bound.values(body, parameters) / unit
            values.append(bound.sense * (lengths - limits.bounds[name]))
    if len(limits.stations):
        thicknesses = jax.vmap(body.thickness_at, (None, 0))(parameters, limits.stations[:, 0])
        values.append(thicknesses / unit - limits.stations[:, 1])
    return jnp.hstack(values)


def constraint_names(limits: Limits) -> list[str]:
    """Return what each of the ``constraint_values`` bounds: a field of ``Problem``, or in words."""
    names = [OWN_SHAPE]
    for name, bound in BOUNDS.items():
        if name in limits.bounds:
            values = functools.partial(bound.values, limits.body_class)
            names += [name] * jax.eval_shape(values, limits.body(limits.low)).size
    return names + [f"thickness at {x:g} c" for x in limits.stations[:, 0]]


@compiled()
def constraint_values_and_jacobian(
    variables: Float[AnyArray, " variables"], limits: Limits
) -> tuple[Float[Array, " constraints"], Float[Array, "constraints variables"]]:
    """Return c(p) and its derivative in the variables."""

    def twice(variables):
        values = constraint_values(variables, limits)
        return values, values

    jacobian, values = jax.jacfwd(twice, has_aux=True)(variables)
    return values, jacobian


@jax.jit
def satisfied(
    bodies: Float[AnyArray, "bodies variables"], limits: Limits, tolerance: AnyArray | float = 0.0
) -> Bool[Array, " bodies"]:
    """Return which bodies are within their ranges and have all c(p) >= -tolerance."""
    inside = (bodies >= limits.low - 1e-9) & (bodies <= limits.high + 1e-9)
    values = jax.vmap(constraint_values, in_axes=(0, None))(bodies, limits)
    return jnp.all(inside, axis=1) & jnp.all(values >= -tolerance, axis=1)
