"""A discretised class of bodies: everything static that a compiled program depends on."""

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PyTree

from surrogate.arrays import AnyArray, padded
from surrogate.body.body_class import BodyClass
from surrogate.body.drawing import body_markers
from surrogate.body.measures import least_mean_thickness
from surrogate.compilation import compiled
from surrogate.errors import InvalidInput
from surrogate.flow import programs
from surrogate.flow.grid.domain import Domain, too_thin
from surrogate.flow.grid.immersed import Markers
from surrogate.flow.loads import LOADS, Load, drag
from surrogate.flow.solver.newton import NewtonInfo, NewtonSettings
from surrogate.flow.solver.steady import FlowState, Operators
from surrogate.flow.streams import kept_operators
from surrogate.scene.limits import onset_of_instability

OUTLINE_NODES = 128  # of the outline whose mean thickness is measured


class Coverage(NamedTuple):
    """Whether a grid holds and resolves bodies, and their onset of instability.

    Attributes:
      onset: Re above which their steady flow is unstable.
      fits: whether the grid's box holds the body.
      cells: cells across the mean thickness.
      resolved: whether these are enough.
    """

    onset: Float[AnyArray, "*bodies"]
    fits: Bool[AnyArray, "*bodies"]
    cells: Float[AnyArray, "*bodies"]
    resolved: Bool[AnyArray, "*bodies"]


@dataclasses.dataclass(frozen=True)
class DiscreteBodies:
    """A class of bodies, given by parameters, on one grid; hashable as a static argument of jit."""

    domain: Domain
    body_class: BodyClass
    settings: NewtonSettings

    @property
    def loads(self) -> tuple[Load, ...]:
        """The loads that do not vanish by symmetry: Cd, and Cl and Cm where bodies have lift."""
        return (drag,) if self.domain.modes.lift_index is None else tuple(LOADS.values())

    def markers(self, parameters: Float[AnyArray, " parameters"]) -> Markers:
        """Return a body's surface markers: its contour in 2-D, a part of its skin in 3-D."""
        return body_markers(self.body_class, parameters, self.domain.nodes)

    def in_parameters(
        self, parameters: Float[AnyArray, " parameters"], by_markers: PyTree
    ) -> Float[Array, "loads parameters"]:
        """Return gradients of loads in a body's markers as those in its parameters.

        Args:
          parameters: of the body.
          by_markers: gradients, as ``markers`` with a leading axis of the loads.
        """
        pull = jax.vjp(self.markers, parameters)[1]
        return jax.vmap(lambda one: pull(one)[0])(by_markers)

    def assembled(
        self, parameters: Float[AnyArray, " parameters"], reynolds: Float[AnyArray, ""]
    ) -> Operators:
        """Assemble the operators of a body."""
        stream = kept_operators(self.domain, reynolds, parameters)
        return programs.assemble(self.domain, self.markers(parameters), reynolds, stream)

    def solved(
        self, parameters: Float[AnyArray, " parameters"], reynolds: Float[AnyArray, ""]
    ) -> tuple[Operators, FlowState, NewtonInfo]:
        """Solve the flow past a body from its Oseen flow; return operators, state and outcome."""
        operators = self.assembled(parameters, reynolds)
        return operators, *programs.solve(self.domain, operators, None, self.settings)

    def coverage(self, parameters: Float[AnyArray, " parameters"]) -> Coverage:
        """Return whether a body fits the grid's box, is resolved, and where it becomes unstable."""
        half_extent = jnp.abs(jax.tree.leaves(self.markers(parameters))[0]).max(axis=0)
        outline = self.body_class.outline(parameters, OUTLINE_NODES)
        thickness = least_mean_thickness(outline, self.body_class.flatness(parameters))
        cells = thickness / self.domain.lattice.step[0]
        fits = jnp.all(half_extent <= self.domain.half_extent)
        onset = onset_of_instability(
            2 * half_extent, self.body_class.contour(parameters, OUTLINE_NODES)
        )
        return Coverage(onset, fits, cells, cells >= self.domain.MIN_THICKNESS)

    def check(self, parameters: Float[np.ndarray, "bodies parameters"]) -> Coverage:
        """Return the coverage of many bodies, all of which the grid must cover.

        Raises:
          InvalidInput: one is larger than the grid's box, or thinner than the grid resolves.
        """
        found = jax.tree.map(np.asarray, _coverages(self, padded(parameters)))
        found = jax.tree.map(lambda part: part[: len(parameters)], found)
        if not np.all(found.fits):
            raise InvalidInput("body: is larger than those that the scene's grid was made for")
        if not np.all(found.resolved):
            raise InvalidInput(
                too_thin(found.cells.min(), self.domain.MIN_THICKNESS, self.domain.lattice.step[0])
            )
        return found


@compiled("bodies")
def _coverages(bodies, parameters):
    return jax.vmap(bodies.coverage)(parameters)
