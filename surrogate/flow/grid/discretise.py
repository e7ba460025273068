"""Which discrete problem a scene or a single body is solved on."""

import math

import numpy as np

from surrogate.body.drawing import drawn_outline
from surrogate.body.measures import least_mean_thickness
from surrogate.body.shape import FamilyShape, Shape
from surrogate.errors import InvalidInput
from surrogate.flow.grid.domain import Domain, too_thin
from surrogate.flow.grid.domain_2d import Domain2D
from surrogate.flow.grid.domain_3d import Domain3D
from surrogate.flow.grid.modes_2d import Modes2D
from surrogate.flow.grid.modes_3d import Modes3D
from surrogate.scene.fidelity import Fidelity
from surrogate.scene.limits import check_stream
from surrogate.scene.scene import Scene
from surrogate.scene.stream import Stream

DOMAINS: dict[int, type[Domain]] = {2: Domain2D, 3: Domain3D}
SCENE_CLEARANCE = (1.0, 0.5)  # D from a scene's largest body to the domain's edges
ROUNDING = 4  # extents are rounded up to 1 / 4 D where a message names them
OUTLINE_NODES = 400  # of the contour whose mean thickness is measured


def scene_domain(scene: Scene) -> Domain:
    """Return the domain that holds every body of a scene, and the round one, at every Re of it.

    Raises:
      InvalidInput: the longest or tallest bodies do not fit the domain or the tunnel.
    """
    check_stream(scene.stream, scene.fidelity_for_bodies, np.array(scene.extent), SCENE_CLEARANCE)
    return DOMAINS[scene.dimension].of_scene(scene)


def fitted_domain(stream: Stream, fidelity: Fidelity, shape: Shape, reynolds: float) -> Domain:
    """Return a domain for one body, as long as the wake at this Re needs.

    There are few domains of a fidelity, whatever the bodies, so that few programs are compiled: in
    2-D all bodies of up to 4 by 2 D have the same box.

    Args:
      stream: unbounded or a tunnel.
      fidelity: cells per D and size of the domain, which are adapted to the body.
      shape: the body.
      reynolds: U D / nu.

    Raises:
      InvalidInput: the body is thinner than the grid resolves, or does not fit the stream.
    """
    kind, extent = DOMAINS[shape.dimension], shape.extent
    fidelity = fidelity.for_body(reynolds, shape.height, shape.nose)
    fidelity = fidelity.for_modes(shape.highest_mode, shape.dimension == 2 and not shape.symmetric)
    check_resolution(kind, fidelity, shape)
    extent = np.ceil(extent * ROUNDING) / ROUNDING
    check_stream(stream, fidelity, extent, kind.CLEARANCE)
    return kind.around(stream, fidelity, extent, shape, reynolds)


def traction_modes(scene: Scene) -> Modes2D | Modes3D:
    """Return the traction modes of a scene's bodies on its grid."""
    return DOMAINS[scene.dimension].modes_of(scene.family.names, scene.fidelity_for_bodies)


def check_resolution(kind: type[Domain], fidelity: Fidelity, shape: Shape) -> None:
    """Raise InvalidInput where a body's mean thickness has too few cells to be resolved."""
    cells = fidelity.cells * _thickness(shape)
    if cells < kind.MIN_THICKNESS:
        raise InvalidInput(too_thin(cells, kind.MIN_THICKNESS, 1 / fidelity.cells))


def fewest_cells(shape: Shape) -> int:
    """Return the cells per D of the coarsest grid that resolves a body."""
    return math.ceil(DOMAINS[shape.dimension].MIN_THICKNESS / _thickness(shape))


def _thickness(shape):
    outline, flatness = shape.draw(OUTLINE_NODES), np.ones(())
    if isinstance(shape, FamilyShape):
        outline = drawn_outline(shape.body_class, shape.values, OUTLINE_NODES)
        flatness = shape.body_class.flatness(shape.values)
    return float(least_mean_thickness(outline, flatness))
