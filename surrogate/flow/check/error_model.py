"""Models of how a flow's errors depend on its grid and on its domain, in 2-D and in 3-D.

Notes with the formulas and their evidence are in ``surrogate/flow/README.md``.
"""

import abc
import math
from typing import ClassVar, NamedTuple

from surrogate.flow.grid.wall_3d import thin_layer
from surrogate.scene.fidelity import inverse_layer

ASYMPTOTIC_CELLS = 16  # per D, from which the grid's error falls at its order


class Loads(NamedTuple):
    """One number for each load, Cd, Cl and Cm: its value, its error, or a tolerance of it."""

    drag: float
    lift: float
    moment: float


class ErrorModel(abc.ABC):
    """A model of how errors depend on the grid and on the domain, in 2-D or in 3-D.

    The constants are fitted to errors against finite elements and finer grids: of the bodies of
    studies ``lift`` and ``trust_space``, and of random bodies and sections of other seeds than
    those of ``trust`` and ``random_sections``; ``onset_factors`` to ``extremes_lift`` and the first
    sections of ``random_sections``.
    """

    COARSER: ClassVar[float]  # cells of the coarser grid, as a share of the whole
    OTHER_DOMAIN: ClassVar[float]  # sides of the other domain, as a multiple of the own
    DOMAIN_ERROR: ClassVar[float]  # the domain's error there over that in the own one
    SAFETY: ClassVar[Loads]  # bound over likely error of each load
    GRID_SHARE: ClassVar[float]  # of the grid's error by its order that is left on average
    TALLEST: ClassVar[float]  # D across the stream, the tallest body of the tests of tolerances

    @abc.abstractmethod
    def order(self, reynolds: float) -> float:
        """Return the power of the cell size that the grid's error falls with."""

    @abc.abstractmethod
    def spreads(self, cells: int, reynolds: float, nose: float) -> Loads:
        """Return the likely errors of the loads over Cd that neither grid nor domain shows.

        Args:
          cells: of the flow whose error it is, per D.
          reynolds: U D / nu.
          nose: radius of curvature in D that its boundary layers follow (``Shape.nose``).
        """

    @abc.abstractmethod
    def onset_factors(self, ratio: float) -> Loads:
        """Return the factors by which likely errors are multiplied near the onset of instability.

        Args:
          ratio: Re over that of the onset; may exceed 1.
        """

    @abc.abstractmethod
    def likely(self, grid: Loads, domain: Loads, spreads: Loads) -> Loads:
        """Return the likely errors of the loads over Cd from their parts, over Cd too.

        They are without the factors of ``onset_factors``.

        Args:
          grid: errors of the grid, with their signs.
          domain: errors of the domain, with their signs.
          spreads: the parts that neither of them shows, from ``spreads``.
        """

    @abc.abstractmethod
    def margin(self, cells: int, reynolds: float) -> float:
        """Return the ratio of the expected error to the likely one.

        Args:
          cells: of the coarser grid, per D.
          reynolds: U D / nu.
        """


class ErrorModel2D(ErrorModel):
    """The error model in 2-D: the errors of grid and domain with their signs, and a spread.

    A larger domain shows the domain's error with its sign. The two parts partly cancel, so they are
    added with their signs; to their sum's square are added those of half the domain's part, which
    is uncertain, and of a spread that neither part shows. The spread grows with the cell size over
    the thickness of the thinnest boundary layer. An error of the lift is assumed to act at the tail
    and so adds to that of the moment. Near the onset of instability the likely errors of lift and
    moment are multiplied by an empirical factor.
    """

    COARSER, OTHER_DOMAIN, DOMAIN_ERROR, TALLEST = 1 / 2, 1.25, 0.4, 1.75
    SAFETY = Loads(2.0, 2.0, 2.0)
    GRID_SHARE = 0.5  # fitted; errors of third order, as at low Re, would leave 3/7
    DOMAIN_SPREAD = 0.5  # of the domain's error, by which it is uncertain
    SPREAD, SPREAD_CELLS = 0.5e-3, 16  # of the drag over Cd, on grids of SPREAD_CELLS cells per D
    LAYERS = Loads(1e-3, 2e-3, 1e-3)  # spreads over Cd on cells as large as the layer is thick
    TAIL = 0.5  # D from the centroid, where an error of the lift acts
    NEAR_ONSET = 1.5  # k of the factor 1 + k (Re / onset)^p of errors of Cl and Cm
    ONSET_POWER = 4  # p of this factor

    def order(self, reynolds: float) -> float:
        """Return 2, the order of the scheme where boundary layers are thin."""
        return 2.0

    def spreads(self, cells: int, reynolds: float, nose: float) -> Loads:
        """Return the spreads of equation (9) of ``surrogate/flow/README.md``."""
        layers = inverse_layer(reynolds, nose) / cells
        drag, lift, moment = (spread * layers for spread in self.LAYERS)
        drag = math.hypot(drag, self.SPREAD * math.sqrt(self.SPREAD_CELLS / cells))
        return Loads(drag, lift, moment)

    def onset_factors(self, ratio: float) -> Loads:
        """Return the factors of equation (10) of ``surrogate/flow/README.md``; 1 for the drag."""
        factor = 1.0 + self.NEAR_ONSET * min(ratio, 1.0) ** self.ONSET_POWER
        return Loads(1.0, factor, factor)

    def likely(self, grid: Loads, domain: Loads, spreads: Loads) -> Loads:
        """Return the likely errors by equation (9) of ``surrogate/flow/README.md``."""
        drag, lift, moment = (
            math.hypot(self.GRID_SHARE * g + d, self.DOMAIN_SPREAD * d)
            for g, d in zip(grid, domain, strict=True)
        )
        seen = drag, lift, math.hypot(moment, self.TAIL * lift)
        return Loads(*map(math.hypot, seen, spreads))

    def margin(self, cells: int, reynolds: float) -> float:
        """Return 1: the likely error is the expected one."""
        return 1.0


class ErrorModel3D(ErrorModel):
    """The error model in 3-D: a scheme of third order, of second where boundary layers are thin.

    Bodies leave room for a slightly smaller domain only, whose error's sign says little: the two
    parts are added up, lest they cancel.
    """

    COARSER, OTHER_DOMAIN, DOMAIN_ERROR, TALLEST = 2 / 3, 5 / 6, 5.0, 1.65
    SAFETY, GRID_SHARE = Loads(2.25, 2.25, 2.25), 1.0
    FEW_CELLS = 1.25  # margin on grids of few cells: with 1, errors exceed the tolerance by a sixth
    THIN_LAYERS = 2.5  # margin where boundary layers are thin: errors reach 2.2 times the likely

    def order(self, reynolds: float) -> float:
        """Return the order, which falls from 3 to 2 as boundary layers thin to few cells."""
        return 3.0 - thin_layer(reynolds)

    def spreads(self, cells: int, reynolds: float, nose: float) -> Loads:
        """Return zeros: grid and domain show the whole error."""
        return Loads(0.0, 0.0, 0.0)

    def onset_factors(self, ratio: float) -> Loads:
        """Return ones: errors near the onset have not been measured in 3-D."""
        return Loads(1.0, 1.0, 1.0)

    def likely(self, grid: Loads, domain: Loads, spreads: Loads) -> Loads:
        """Return the sums of the magnitudes of the parts."""
        return Loads(*(sum(map(abs, parts)) for parts in zip(grid, domain, spreads, strict=True)))

    def margin(self, cells: int, reynolds: float) -> float:
        """Return a margin that is larger on few cells and where boundary layers are thin."""
        margin = 1.0 if cells >= ASYMPTOTIC_CELLS else self.FEW_CELLS
        return margin + (self.THIN_LAYERS - margin) * thin_layer(reynolds)


ERROR_MODELS: dict[int, ErrorModel] = {2: ErrorModel2D(), 3: ErrorModel3D()}
