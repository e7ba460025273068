"""A solved flow: force coefficients, work, estimated error and fields."""

import dataclasses
import functools
import math
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from jaxtyping import Float

from surrogate.arrays import AnyArray
from surrogate.body.chord_line import chord_point, moment_about
from surrogate.body.shape import Shape
from surrogate.checks import finite_number, whole_number
from surrogate.errors import InvalidInput
from surrogate.files import JsonObject
from surrogate.flow.check.error_estimate import accuracy_text
from surrogate.flow.fields import Fields, fields_of, polygon_of
from surrogate.flow.forces import Conditions, Forces, forces_of
from surrogate.flow.grid.domain import Domain
from surrogate.flow.grid.immersed import Markers
from surrogate.flow.solver.steady import FlowState
from surrogate.flow.surface.forces_3d import SkinLoads, skin_loads
from surrogate.flow.surface.pressure import pressure
from surrogate.flow.surface.surface import SURFACE_POINTS, Surface, surface_of
from surrogate.flow.wake import NEAR, onset_by_wake, reverse_speed
from surrogate.scene.fidelity import Fidelity
from surrogate.scene.limits import onset_of
from surrogate.summary import aligned, listed, steady_text

if TYPE_CHECKING:
    import pyvista as pv


@dataclasses.dataclass(frozen=True, eq=False)
class Solution:
    """The steady flow past one body at one Reynolds number.

    Coefficients are over U = D = rho = 1: 2 F and 2 M per unit span in 2-D, 8 F / pi and 8 M / pi
    in 3-D.

    Attributes:
      reynolds: U D / nu.
      drag: Cd; ``drag_pressure`` and ``drag_friction`` are its parts.
      lift: Cl, positive along y, in 3-D along z.
      moment: Cm about the centroid, positive nose up.
      status: "accurate" where Cd is expected to meet the tolerance, and Cl and Cm to err by at most
        2.5 times as much of Cd; else "degraded", or "unknown" without an estimate; ``accuracy``
        says why.
      expected_error: expected relative error of Cd; None where there is no estimate.
      estimated_error: relative bound of the error of Cd, made to cover 95 % of the errors.
      estimated_lift_error: bound of the error of Cl itself.
      estimated_moment_error: bound of the error of Cm itself.
      sufficient: name of a fidelity that should meet the tolerance that this one does not.
      extrapolated_drag: Cd extrapolated from two grids, where both are fine enough.
      cause: of a degraded flow: which load is expected to err by too much, that the body is too
        tall, or why there is no estimate.
      tolerance: relative error of Cd that the scene's fidelity is made for.
      fidelity: cells, domain and wake of the grid.
      green_applications: convolutions with G of this flow, without gradient and estimate.
      newton_steps: Newton steps of the last solve.
      seconds: wall time of this flow, without gradient and estimate.
      gradients: derivatives of "cd", and of "cl" and "cm" where camber or incidence is a parameter,
        by the family's parameters (incidence in degrees) and ``reynolds``, where asked for.
      shape: the body.
      domain: the discretisation.
      state: velocity and traction modes.
    """

    reynolds: float
    drag: float
    drag_pressure: float
    drag_friction: float
    lift: float
    moment: float
    status: Literal["accurate", "degraded", "unknown"]
    expected_error: float | None
    estimated_error: float | None
    estimated_lift_error: float | None
    estimated_moment_error: float | None
    sufficient: str | None
    extrapolated_drag: float | None
    cause: str
    tolerance: float
    fidelity: Fidelity
    green_applications: int
    newton_steps: int
    seconds: float
    gradients: dict[str, dict[str, float]] | None
    shape: Shape
    domain: Domain
    state: FlowState

    def __repr__(self) -> str:
        loads = f"Cd {self.drag:.4f}, Cl {self.lift:.4f}, Cm {self.moment:.4f}"
        return f"Solution(Re {self.reynolds:g}: {loads}; {self.status})"

    def summary(self) -> str:
        """Return what is known of the flow as lines of text."""
        rows = {
            "Re": f"{self.reynolds:g} (U D / nu)",
            "Cd": f"{self.drag:.4f}: pressure {self.drag_pressure:.4f}, "
            f"friction {self.drag_friction:.4f}",
            "Cl": f"{self.lift:.4f}",
            "Cm": f"{self.moment:.4f}, about the centroid, nose up",
            "error of Cd": f"{self.status}: {self.accuracy}",
            "steady": steady_text(self.reynolds, self.onset),
            "work": f"{self.newton_steps} Newton steps, {self.green_applications} convolutions "
            f"with the Green's function, {self.seconds:.2f} s",
        }
        for load, slopes in (self.gradients or {}).items():
            rows[f"d{load.capitalize()}/d"] = listed(slopes)
        return aligned(rows)

    @property
    def loads(self) -> Float[np.ndarray, " 3"]:
        """Cd, Cl and Cm as an array."""
        return np.array([self.drag, self.lift, self.moment])

    @property
    def gradient(self) -> dict[str, float] | None:
        """The derivatives of Cd by the family's parameters and ``reynolds``, where asked for."""
        return self.gradients and self.gradients["cd"]

    @property
    def accuracy(self) -> str:
        """A text on whether Cd meets the tolerance: "meets 0.4 % (expected 0.3 %, bound ...)"."""
        errors = self.expected_error, self.estimated_error
        return accuracy_text(self.status, *errors, self.tolerance, self.sufficient, self.cause)

    @functools.cached_property
    def onset(self) -> float:
        """An estimate of the Re beyond which the steady flow past this body is unstable.

        It is by the outline, and near the onset of a 2-D body in an unbounded stream by the reverse
        flow of the wake too.
        """
        onset = onset_of(self.shape)
        unbounded = self.shape.dimension == 2 and self.domain.height is None
        if not (unbounded and NEAR[0] * onset <= self.reynolds <= NEAR[1] * onset):
            return onset
        diameter = 2 * math.sqrt(polygon_of(self.shape).area / math.pi)
        found = onset_by_wake(self.reynolds * diameter, onset * diameter, self.reverse_speed)
        return found / diameter

    @functools.cached_property
    def reverse_speed(self) -> float:
        """The mean speed of the reverse flow of a 2-D flow over U, weighted with itself."""
        x, y = self.domain.lattice.unfolded.faces()[0]
        return reverse_speed(self.velocity[0], x, y, self.shape)

    @property
    def markers(self) -> Markers:
        """The surface markers in D: the contour clockwise from the nose, or a part of the skin."""
        return self.shape.markers(self.domain.nodes)

    @property
    def velocity(self) -> Float[np.ndarray, "axes ..."]:
        """The velocity over U, the stream included, on the faces of ``domain.lattice.unfolded``."""
        whole = np.array(self.domain.lattice.unfold(self.state.velocity))
        whole[0] += 1.0
        return whole

    @functools.cached_property
    def fields(self) -> Fields:
        """The velocity, pressure and vorticity at the cell centres of the whole grid."""
        return fields_of(self.domain, self.shape, self.velocity, self._pressure)

    @functools.cached_property
    def _pressure(self) -> Float[np.ndarray, "..."]:
        """The pressure over rho U^2 in the cells of the whole lattice."""
        return pressure(self.domain, self.markers, self.state, self.reynolds)

    @property
    def x(self) -> Float[np.ndarray, " nx"]:
        """The x of the cell centres in D; fields are indexed [i, j(, k)] by x, y(, z)."""
        return self.fields.axes[0]

    @property
    def y(self) -> Float[np.ndarray, " ny"]:
        """The y of the cell centres in D."""
        return self.fields.axes[1]

    @property
    def z(self) -> Float[np.ndarray, " nz"]:
        """The z of the cell centres in D, of a 3-D flow."""
        return self._in_3d("z", self.fields.axes)

    @property
    def u(self) -> Float[np.ndarray, "..."]:
        """The velocity along x over U at the cell centres."""
        return self.fields.velocity[0]

    @property
    def v(self) -> Float[np.ndarray, "..."]:
        """The velocity along y over U at the cell centres."""
        return self.fields.velocity[1]

    @property
    def w(self) -> Float[np.ndarray, "..."]:
        """The velocity along z over U at the cell centres, of a 3-D flow."""
        return self._in_3d("w", self.fields.velocity)

    @property
    def p(self) -> Float[np.ndarray, "..."]:
        """The pressure over rho U^2 at the cell centres, zero far upstream; Cp is twice that."""
        return self.fields.p

    @property
    def vorticity(self) -> Float[np.ndarray, "..."]:
        """The vorticity over U / D at the cell centres; in 3-D an array of three components."""
        return self.fields.vorticity

    def forces(
        self, *, speed: float, diameter: float, density: float, viscosity: float | None = None
    ) -> Forces:
        """Return the forces in N and the moment in N m, in 2-D per metre of span.

        Args:
          speed: of the stream, m/s.
          diameter: equivalent diameter D of the body, m.
          density: of the fluid, kg/m^3.
          viscosity: kinematic viscosity, m^2/s, to check that Re = U D / nu.

        Raises:
          InvalidInput: a number is not positive, or U D / nu is not this flow's Re.
        """
        conditions = Conditions(speed, diameter, density, viscosity)
        conditions.check(self.reynolds)
        names = [field.name for field in dataclasses.fields(Forces)]
        coefficients = {name: getattr(self, name) for name in names}
        return forces_of(coefficients, conditions, self.shape.dimension)

    def write(self, folder: str | Path, notes: JsonObject | None = None) -> Path:
        """Write contour with Cp and Cf, fields (.vti, .npz), a picture and a record to a folder.

        The contour is that of the body as it lies, turned by its incidence. The folder, which is
        returned, must be new, empty or of an earlier flow, which is replaced; other files stay.

        Args:
          folder: to be written.
          notes: further entries of the record, ``flow.json``, values of JSON by name.

        Raises:
          InvalidInput: the folder holds something else, or is not writable, or a note is none.
        """
        # pyvista and matplotlib take a second to import, which only files and pictures need
        from surrogate.flow.output.folder import write_flow

        return write_flow(self, folder, notes)

    def mesh(self) -> "pv.ImageData":
        """Return the fields as a pyvista mesh whose points are the cells' centres."""
        from surrogate.flow.output.meshes import fields_mesh

        return fields_mesh(self.fields)

    def surface_mesh(self) -> "pv.PolyData":
        """Return the contour, or the skin of a 3-D body, as a pyvista mesh with Cp and Cf."""
        from surrogate.flow.output.meshes import surface_mesh

        return surface_mesh(self)

    def _in_3d(self, name, parts):
        if self.shape.dimension == 2:
            raise AttributeError(f"{name}: a 2-D flow has none")
        return parts[2]

    def skin_loads(
        self, points: Float[AnyArray, "points 3"], areas: Float[AnyArray, "points 3"]
    ) -> SkinLoads:
        """Return Cp and friction at points of a 3-D body's skin, given with their area vectors.

        Raises:
          InvalidInput: the body is 2-D, where ``surface`` has them.
        """
        if self.shape.dimension == 2:
            raise InvalidInput("skin_loads: is for 3-D bodies; surface is for 2-D ones")
        flow = self.state.velocity, self._pressure, self.reynolds
        return skin_loads(self.domain, *flow, points, areas)

    @property
    def chord(self) -> float:
        """The body's length from nose to tail at zero incidence, in D."""
        return self.shape.chord

    def moment_about(self, station: float) -> float:
        """Return Cm, nose up, about the point of the chord at x/c = ``station``.

        Args:
          station: x/c of the point: 0 is the nose, 0.25 the quarter chord, 1 the tail.

        Raises:
          InvalidInput: it is not a finite number.
        """
        point = chord_point(self.shape, finite_number("station", station))
        return moment_about(point, self.drag, self.lift, self.moment)

    @property
    def chord_reynolds(self) -> float:
        """The Reynolds number U c / nu, by the chord c."""
        return self.reynolds * self.chord

    def surface(self, points: int = SURFACE_POINTS) -> Surface:
        """Return Cp and Cf along the contour of a 2-D body.

        Args:
          points: number of points of the contour, from 16 to 8192.

        Raises:
          InvalidInput: the body is 3-D, where ``skin_loads`` has them, or the number is out of
            range.
        """
        if self.shape.dimension == 3:
            raise InvalidInput("surface: is for 2-D bodies; skin_loads is for 3-D ones")
        points = whole_number("surface points", points, 16, 8192)
        every = math.ceil(self.domain.nodes / points)  # as fine as the contour that was solved
        flow = self.state.velocity, self._pressure
        found = surface_of(self.domain, *flow, self.shape.draw(every * points), self.reynolds)
        return Surface(*(part[::every] for part in found[:3]), self.shape.incidence)
