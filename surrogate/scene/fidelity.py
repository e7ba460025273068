"""How finely a flow is solved, and which error of the drag that resolution is made for."""

import dataclasses
import math
from collections.abc import Mapping

from surrogate.checks import did_you_mean, expect, finite_number, whole_number
from surrogate.errors import InvalidInput

LONGEST_DOWNSTREAM = 40.0  # D downstream, up to which a domain is lengthened for a wake
LONGER = 8.0  # D, by which a domain is lengthened first: few lengths share compiled code
FEWEST_CELLS = 6  # per D, if possible: fewer do not resolve bodies of usual thickness
LONGEST = 2 * LONGEST_DOWNSTREAM  # D, any side of a domain
COARSER = 0.9  # of the cells, at most, that a coarser grid has
MOST_CELLS, MOST_IN_DOMAIN = 128, 16e6  # per D, and in a 2-D domain
MOST_IN_SPACE = 4e6  # in the part of a 3-D domain that is gridded, which takes several gigabytes
WAKE = {2: 0.2, 3: 0.0}  # default of ``wake`` by dimension: that of the standard fidelity
REFINEMENT = {2: 3.0, 3: 1.0}  # default of ``refinement`` by dimension
# ``inverse_layer`` in 1 / D up to which the levels' cells suffice (study ``lift``): that of aspect
# 5 at Re 45; and for tolerances below ``TIGHT`` that of aspect 5 at Re 18.
THIN_LAYER, THIN_LAYER_IF_TIGHT, TIGHT = 32.0, 20.0, 0.002
# The same, above which bodies have twice as many harmonics, as NACA 0012 at chord Re 1000 needs
# (study ``lift``).
SHARP_ENDS = 65.0
MOST_HARMONICS = 31
MORE_HARMONICS = 2  # than the highest mode of a body (study ``harmonics``)
# Factor of the harmonics of 2-D flows without a mirror plane (study ``lift``). Seven harmonics miss
# up to 9 % of Cd of the lift of slender sections at Re 100.
LIFTING_HARMONICS = 12 / 7


def inverse_layer(reynolds: float, nose: float) -> float:
    """Return 1 / thickness of the thinnest boundary layer on a body, in 1 / D: sqrt(Re / r).

    Args:
      reynolds: U D / nu.
      nose: r, radius of curvature in D that this layer follows (``Shape.nose``).
    """
    return math.sqrt(reynolds / nose)


@dataclasses.dataclass(frozen=True)
class Fidelity:
    """Resolution of the flow solver: cells per D, and the computational domain.

    Args:
      name: by which messages call it.
      cells: grid cells per D.
      upstream: from the body's centroid to the inlet, in D.
      downstream: from the body's centroid to the outlet, in D.
      height: of the domain, in 3-D its width too, in D.
      harmonics: highest harmonic of the traction on the body; bodies of high modes have more.
      wake: how much longer a domain a wake takes: it is lengthened where ``downstream`` is more
        than 2 D less than wake * Re * (height of the body / D)^2, up to 40 D; of one body by itself
        that is wider than long with the power 4. By default 0.2 in 2-D and 0 in 3-D.
      refinement: greatest factor by which ``cells`` are multiplied for slender bodies at high Re,
        whose boundary layers are thin; where they are thinnest ``harmonics`` are doubled. By
        default 3 in 2-D and 1, for none, in 3-D.
      tolerance: relative error tolerance of the drag: ``Solution.status`` is "accurate" where the
        expected error is below it, and those of Cl and Cm, over Cd, are below 2.5 times it. Levels
        are made for it at Re 0.5 to 45 and aspect 0.5 to 5 in 2-D, at Re 0.1 to 100 and aspect 0.5
        to 4 in 3-D; of bodies with lift at Re 1 to 200 and 1 to 100.
    """

    name: str
    cells: int
    upstream: float
    downstream: float
    height: float
    harmonics: int = 7
    wake: float | None = None
    tolerance: float = 0.015
    refinement: float | None = None

    def __post_init__(self):
        expect("fidelity", self.name, str, "name")
        plain = {
            "cells": whole_number("cells per D", self.cells, 3, MOST_CELLS),
            "harmonics": whole_number("harmonics", self.harmonics, 1, MOST_HARMONICS),
        }
        limits = dict.fromkeys(("upstream", "downstream", "height"), (1, LONGEST))
        limits |= {} if self.wake is None else {"wake": (0, 1)}
        limits |= {} if self.refinement is None else {"refinement": (1, 8)}
        for name, (low, high) in (limits | {"tolerance": (0, 1)}).items():
            plain[name] = finite_number(name, getattr(self, name))
            if not low <= plain[name] <= high:
                raise InvalidInput(f"fidelity: {name} {plain[name]:g}: from {low:g} to {high:g}")
        area = (plain["upstream"] + plain["downstream"]) * plain["height"]
        if (count := plain["cells"] ** 2 * area) > MOST_IN_DOMAIN:
            raise InvalidInput(
                f"fidelity: a domain of {count / 1e6:.0f} million cells; up to "
                f"{MOST_IN_DOMAIN / 1e6:g} are solved"
            )
        for name, value in plain.items():
            object.__setattr__(self, name, value)

    def for_wake(self, reynolds: float, height: float) -> "Fidelity":
        """Return the fidelity with a domain that is long enough for the wakes of bodies.

        Args:
          reynolds: greatest U D / nu.
          height: of the bodies across the stream, in D.
        """
        if not self._is_short(reynolds * height**2):
            return self
        longer = self.downstream + LONGER
        enough = self._wake * reynolds * height**2 <= longer
        return self._lengthened(longer if enough else LONGEST_DOWNSTREAM)

    def for_layers(self, reynolds: float, nose: float) -> "Fidelity":
        """Return the fidelity with cells that are small enough for the boundary layers of bodies.

        The factor is rounded up to a multiple of a half, so that there are few grids. Where layers
        are thinnest, the traction at the sharp ends of the bodies takes more harmonics, too.

        Args:
          reynolds: greatest U D / nu.
          nose: smallest radius of curvature in D that the layers follow (``Shape.nose``).
        """
        most = REFINEMENT[2] if self.refinement is None else self.refinement
        layer = inverse_layer(reynolds, nose)
        thin = THIN_LAYER if self.tolerance > TIGHT else THIN_LAYER_IF_TIGHT
        factor = max(min(math.ceil(2 * layer / thin - 0.05) / 2, most), 1.0)
        more = 2 if layer > SHARP_ENDS and most > 1 else 1
        harmonics = min(more * self.harmonics, MOST_HARMONICS)
        cells = min(round(factor * self.cells), MOST_CELLS)
        return dataclasses.replace(self, cells=cells, harmonics=harmonics, refinement=1.0)

    def for_body(self, reynolds: float, height: float, nose: float) -> "Fidelity":
        """Return the fidelity for the wake and the boundary layer of one body.

        A body that is taller than D gets a longer domain at lower Re than by ``for_wake``, by
        (height / D)^4 in place of the square: along this line the standard domain's error of Cd is
        0.1 to 0.2 % (study ``wide_bodies``). Scenes do not: their grid holds a height and an Re
        that few of their bodies have.

        Args:
          reynolds: U D / nu.
          height: of the body across the stream, in D.
          nose: as for ``for_layers``.
        """
        fidelity = self.for_layers(reynolds, nose).for_wake(reynolds, height)
        if fidelity.downstream > self.downstream or not self._is_short(reynolds * height**4):
            return fidelity
        return fidelity._lengthened(self.downstream + LONGER)

    def for_modes(self, highest: int, lifting: bool) -> "Fidelity":
        """Return the fidelity with as many harmonics of the traction as the bodies' waves need.

        Fewer than two more than the bodies' highest mode miss up to 2 % of Cd (study
        ``harmonics``).

        Args:
          highest: greatest k of the modes that the bodies have, 1 of ellipses.
          lifting: whether flows have ``LIFTING_HARMONICS`` times the harmonics.
        """
        needed = (highest + MORE_HARMONICS) / (LIFTING_HARMONICS if lifting else 1)
        harmonics = min(max(self.harmonics, math.ceil(needed)), MOST_HARMONICS)
        return dataclasses.replace(self, harmonics=harmonics)

    @property
    def _wake(self) -> float:
        return WAKE[2] if self.wake is None else self.wake

    def _is_short(self, scale: float) -> bool:
        """Return whether ``wake`` times this scale is over 2 D longer than the domain."""
        return min(self._wake * scale, LONGEST_DOWNSTREAM) - self.downstream > 2

    def _lengthened(self, downstream: float) -> "Fidelity":
        downstream = min(downstream, LONGEST_DOWNSTREAM)
        higher = min(self.height + 4, LONGEST)
        return dataclasses.replace(self, downstream=downstream, height=higher)

    def coarser(self, share: float, fewest: int = 0) -> "Fidelity":
        """Return the fidelity with this share of the cells, but no fewer than bodies need.

        Args:
          share: of the cells.
          fewest: cells per D that a certain body needs; usual ones need ``FEWEST_CELLS``.

        Raises:
          InvalidInput: the body needs more than 0.9 times the cells.
        """
        if fewest > COARSER * self.cells:
            raise InvalidInput(f"fidelity: a body that needs {fewest} of {self.cells} cells per D")
        usual = min(self.cells - 2, FEWEST_CELLS)
        return dataclasses.replace(self, cells=max(round(share * self.cells), usual, fewest))

    def scaled(self, share: float) -> "Fidelity":
        """Return the fidelity with all lengths of the domain multiplied by ``share``.

        Each is at most 80 D; grids take less (``check_far_field``).
        """
        sizes = ("upstream", "downstream", "height")
        scaled = {name: min(share * getattr(self, name), LONGEST) for name in sizes}
        return dataclasses.replace(self, **scaled)


def _by_name(*levels):
    return {level.name: level for level in levels}


NAMED = {
    2: _by_name(
        Fidelity("draft", 10, 4, 8, 8, wake=0.15, tolerance=0.015, refinement=3.0),
        Fidelity("standard", 16, 6, 12, 8, wake=0.2, tolerance=0.004, refinement=3.0),
        Fidelity("fine", 32, 8, 20, 12, wake=0.3, tolerance=0.001, refinement=3.0),
    ),
    3: _by_name(
        Fidelity("draft", 8, 3, 6, 4, wake=0.0, tolerance=0.02, refinement=1.0),
        Fidelity("standard", 16, 3, 6, 4, wake=0.0, tolerance=0.005, refinement=1.0),
        Fidelity("fine", 24, 4, 8, 6, wake=0.0, tolerance=0.001, refinement=1.0),
    ),
}
FIDELITIES = NAMED[2]


def check_cells(fidelity: Fidelity, shape: tuple[int, ...], symmetric: bool) -> None:
    """Raise InvalidInput if a grid of this shape has more cells than memory is likely to hold.

    Args:
      fidelity: of the grid.
      shape: cells along each axis, of the part of the domain that is gridded.
      symmetric: whether bodies have a mirror plane along the stream, so that half is gridded; in
        3-D two, so that a quarter is, else half.
    """
    most = {2: MOST_IN_DOMAIN, 3: MOST_IN_SPACE}[len(shape)]
    if (count := math.prod(shape)) > most:
        part = {(2, False): "", (3, True): "a quarter of "}.get((len(shape), symmetric), "half of ")
        raise InvalidInput(
            f"fidelity {fidelity.name}: {part}the domain has {count / 1e6:.1f} million cells; "
            f"up to {most / 1e6:g} are solved, so fewer cells per D would do"
        )


def read_fidelity(value: object, dimension: int) -> Fidelity:
    """Return a fidelity given by its name, by a table of its numbers, or as it is.

    Names and the defaults of ``wake`` and ``refinement`` depend on the dimension.

    Raises:
      InvalidInput: there is none of this name, or a number is missing or out of range.
    """
    if isinstance(value, Fidelity) and value in NAMED[5 - dimension].values():
        raise InvalidInput(
            f"fidelity {value.name}: this is the one of {5 - dimension}-D flows; its name, "
            f"{value.name!r}, stands for that of {dimension}-D ones too"
        )
    if isinstance(value, Mapping):
        names = [field.name for field in dataclasses.fields(Fidelity)]
        needed = "cells", "upstream", "downstream", "height"
        wrong = [f"lacks {name}" for name in needed if name not in value]
        unknown = (name for name in value if name not in names)
        wrong = [f"has {name!r}{did_you_mean(name, names)}" for name in unknown] + wrong
        if wrong:
            raise InvalidInput(f"fidelity: {wrong[0]}; a name, or a table of {', '.join(names)}")
        value = Fidelity(**{"name": "custom", **value})
    if isinstance(value, Fidelity):
        defaults = {"wake": WAKE[dimension], "refinement": REFINEMENT[dimension]}
        missing = {name: n for name, n in defaults.items() if getattr(value, name) is None}
        return dataclasses.replace(value, **missing)
    levels = NAMED[dimension]
    if not isinstance(value, str) or value not in levels:
        hint = did_you_mean(value, levels)
        raise InvalidInput(f"fidelity {value!r}: one of {', '.join(levels)}{hint}")
    return levels[value]
