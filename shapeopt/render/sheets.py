"""What goes on a sheet of pictures: a run's cylinder and its optimum, both solved."""

from pathlib import Path
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from shapeopt.render.pictures import Panel
from surrogate.flow.loads.surface import SURFACE_POINTS, Surface, surface_of
from shapeopt.search.verify import CYLINDER
from surrogate.arrays import AnyArray
from surrogate.body.family import PARAMETERS, family_markers
from surrogate.flow.grid.domain import Domain
from surrogate.flow.flow import Solution, solve_with_continuation
from surrogate.model.store import read_scene
from surrogate.training.physics import scene_domain


class Solved(NamedTuple):
    """A family body and its flow."""

    parameters: Float[AnyArray, " parameters"]
    domain: Domain
    markers: Float[AnyArray, "nodes 2"]
    solution: Solution

    @property
    def drag(self) -> float:
        return float(self.solution.coefficients.drag)


def solve_both(record: dict[str, Any]) -> tuple[Solved, Solved]:
    """The cylinder and the run's optimum, solved on the run's own grid.

    Raises:
      NotConverged: one of the flows was not found.
    """
    domain = scene_domain(read_scene(record["scene"]))

    def solved(parameters):
        markers = family_markers(jnp.asarray(parameters), domain.nodes)
        solution = solve_with_continuation(domain, markers, record["reynolds"])
        return Solved(np.asarray(parameters), domain, np.asarray(markers), solution)

    return solved(CYLINDER), solved([record["parameters"][name] for name in PARAMETERS])


def before_and_after(record: dict[str, Any]) -> list[Panel]:
    """Two panels: the cylinder, and the run's optimum.

    Raises:
      NotConverged: as ``solve_both``.
    """
    start, optimum = solve_both(record)
    reynolds, gain = f"Re {record['reynolds']:g}", 100 * (optimum.drag / start.drag - 1)
    before = f"{reynolds}    cylinder    Cd {start.drag:.4f}"
    after = f"{reynolds}    optimum    Cd {optimum.drag:.4f}    {gain:+.1f} %"
    return [
        Panel(*start[1:], before, "drag by the flow solver"),
        Panel(*optimum[1:], after, f"{origin(record)}, {standing(record)}"),
    ]


def surfaces_of(record: dict[str, Any]) -> tuple[Surface, Surface]:
    """Loads on the cylinder and on the optimum.

    Raises:
      NotConverged: as ``solve_both``.
    """

    def surface(body):
        contour = family_markers(jnp.asarray(body.parameters), SURFACE_POINTS)
        return surface_of(body.domain, body.markers, body.solution, contour, record["reynolds"])

    start, optimum = solve_both(record)
    return surface(start), surface(optimum)


def origin(record: dict[str, Any]) -> str:
    """Which way an optimum was found, for a caption."""
    if record["surrogate"] == "none":
        return "found by the flow's adjoint"
    return f"found by the surrogate {Path(record['surrogate']).name}"


def standing(record: dict[str, Any]) -> str:
    """Whether the flow has confirmed an optimum, for a caption."""
    return "not verified" if record.get("cd_verified") is None else "verified by the flow"
