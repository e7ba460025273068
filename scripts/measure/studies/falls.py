"""Free falls of spheroids in air and in water beside what experiments and simulations report."""

import math

import numpy as np
from falls_by_correlations import small_swings_by_correlations
from study import TINY, Result, Row, Run, Study, Table, cases, columns

from shapeopt.free_fall import Fall, fall
from shapeopt.orientation import orientations, small_swings
from surrogate import Flow, Particle, Scene, family_shape, load
from surrogate.body.ellipsoid import equivalent_ellipsoid
from surrogate.flow.settling import settle
from surrogate.model.surrogate import Surrogate

SURROGATE, TILT = "pretrained:particle", 30.0  # degrees of the axis above its stable position
AIR = Particle(density_ratio=1000, viscosity=1.5e-5, size=1.4e-4)
WATER = Particle(density_ratio=1.2, viscosity=1e-6, size=4e-4)
FLUIDS = {"air": AIR, "water": WATER}


def measure(run: Run, fluid: str, aspect: float) -> Row:
    """Return the final Re, the sideways drift, and small swings about the final motion."""
    net, particle = load(SURROGATE), FLUIDS[fluid]
    body = [aspect, 1.0, 0.0, 0.0]
    found = _until_steady(net, body, particle, -90.0 + broadside(aspect) + TILT)
    frequency, decay = small_swings(net, body, particle, found)
    row: Row = {"reynolds": float(found.reynolds[-1]), "speed": float(-found.velocity[-1, 1])}
    row |= {"size": 1e6 * particle.size, "drift": float(np.ptp(found.x) / particle.size)}
    row["stable"] = [o.incidence for o in orientations(net, body, row["reynolds"]) if o.stable]
    row |= {"frequency": frequency, "decay": decay}
    return row


def released(run: Run, aspect: float, tilt: float) -> Row:
    """Return the sideways drift in air of a spheroid that is released at a tilt, in degrees.

    The tilt is that of the axis from its stable direction.
    """
    body = [aspect, 1.0, 0.0, 0.0]
    found = _until_steady(load(SURROGATE), body, AIR, -90.0 + broadside(aspect) + tilt)
    return {"drift": float(np.ptp(found.x) / AIR.size)}


def undamped(run: Run, aspect: float) -> Row:
    """Return the frequency of small swings in air without damping, by the slope of the flow's Cm.

    At the terminal velocity, along a straight path, the angular frequency is
    sqrt((pi/8) Re^2 |dCm / dalpha| / (J + J')) nu / D^2, alpha in radians, see
    ``shapeopt.free_fall``; resistance to rotation is left out.
    """
    flow = Flow(Scene(dimension=3, fidelity=run.pick(TINY, "standard")))
    shape = family_shape({"aspect": aspect, "incidence": broadside(aspect)}, dimension=3)
    reynolds = settle(flow, shape, AIR, estimate=False).reynolds
    found = flow.solve(shape, reynolds, gradient=True, estimate=False)
    assert found.gradients is not None
    slope = abs(math.degrees(found.gradients["cm"]["incidence"]))
    spheroid = equivalent_ellipsoid(aspect)
    inertia = AIR.density_ratio * spheroid.inertia + spheroid.added_inertia
    angular_frequency = math.sqrt(math.pi / 8 * reynolds**2 * slope / inertia)
    return {
        "reynolds": reynolds,
        "frequency": angular_frequency / (2 * math.pi) * AIR.viscosity / AIR.size**2,
    }


def broadside(aspect: float) -> float:
    """Return the stable incidence of a spheroid in degrees, its axis to the vertical velocity."""
    return 90.0 if aspect > 1 else 0.0


def _until_steady(net: Surrogate, body: list[float], particle: Particle, tilt: float) -> Fall:
    """The fall, long enough for its tilt to come to rest."""
    unit = particle.size**2 / particle.viscosity
    seconds = unit * particle.density_ratio / 4
    while True:
        found = fall(net, body, particle, seconds, tilt=tilt)
        late = found.tilt[len(found.tilt) // 2 :]
        if np.ptp(late) < 1e-2 * TILT:
            return found
        seconds *= 2


def against_model(rows: list[Row]) -> list[Row]:
    """Return the falls in air with the relative differences of the published model from them."""
    found = []
    for row in rows:
        if row["fluid"] == "air" and row["frequency"]:
            names = "reynolds", "frequency", "decay"
            theirs = zip(names, small_swings_by_correlations(row["aspect"], AIR), strict=True)
            found.append(row | {f"{name}_off": value / row[name] - 1 for name, value in theirs})
    return found


def _agreement(rows):
    """Return the largest differences of the model in Re and frequency as a sentence."""
    found = against_model(rows)
    reynolds = max(abs(row["reynolds_off"]) for row in found)
    worst = max(found, key=lambda row: abs(row["frequency_off"]))
    rest = max((abs(r["frequency_off"]) for r in found if r is not worst), default=math.nan)
    return (
        f"Re differs by {100 * reynolds:.0f} % at most, the frequency by {100 * rest:.0f} %, but "
        f"for aspect {worst['aspect']:g}, where it is {100 * worst['frequency_off']:+.1f} %: near "
        "the sphere the correlations' moments are too large."
    )


def show(rows: list[Row]) -> str:
    """Return the table of falls, and that of the published model beside them."""
    return f"{COLUMNS(rows)}\n\n{MODEL(against_model(rows))}"


def text(result: Result) -> str:
    """Return what papers report on such falls, and whether these show it."""
    air = {row["aspect"]: row for row in result["rows"] if row["fluid"] == "air"}
    disc, rod = air.get(min(air)), air.get(max(air))
    if not (disc["frequency"] and rod["frequency"]):
        return ""
    most = max(result["released"], key=lambda row: row["drift"])
    return (
        "Sideways is the range of the horizontal position over the fall; a dash, that nothing "
        "swings. Bhowmick, Wang, Latt and Bagheri (J. Fluid Mech. 2025) report of ellipsoids in "
        "air at a density ratio of 1000, elongation and flatness 0.2 to 1 and Re 2.1 to 4.5 that "
        "they swing, discs at nearly twice the frequency of rods and with a faster decay, and that "
        "they drift sideways by up to ten diameters; of liquids, that the orientation relaxes "
        f"monotonically. Here the flattest spheroid swings at {_ratio(disc, rod, 'frequency')} "
        f"times the frequency of the longest one and decays {_ratio(disc, rod, 'decay')} times as "
        f"fast, and spheroids that are released at {most['tilt']:g} degrees drift by up to "
        f"{most['drift']:.1f} D, far less than reported. Of the report its abstract was at hand, "
        "not how the bodies were released; the resistance to rotation here is that of Stokes flow. "
        "The model in the second table is that of a public code that cites Bhowmick et al. (Phys. "
        "Rev. Lett. 132, 2024), of which the abstract alone was at hand: no measured frequency is "
        "compared here. It has the drag and the moment of Froehlich's correlations of prolate "
        f"spheroids and of Ouchene's of oblate ones. {_agreement(result['rows'])} The decay is no "
        "independent check: it comes nearly all from the Stokes resistance to rotation that both "
        "have."
    )


def _ratio(one, other, name):
    return f"{one[name] / other[name]:.1f}"


def text_of_swings(result: Result) -> str:
    """Return the ratio of the frequencies of the flattest and the longest spheroid as text."""
    ratio = _ratio(result["rows"][0], result["rows"][-1], "frequency")
    return f"The flattest spheroid swings at {ratio} times the frequency of the longest one."


COLUMNS = columns(
    "fluid {fluid} | aspect {aspect:g} | size, um {size:g} | Re {reynolds:.2f}"
    " | speed, m/s {speed:.4f} | small swings: frequency, Hz {frequency:.1f}"
    " | decay, 1/s {decay:.1f} | sideways, D {drift:.1f}"
)
MODEL = columns(
    "in air, aspect {aspect:g} | Re {reynolds:.2f} | difference of the model {reynolds_off:+.1%}"
    " | frequency, Hz {frequency:.1f} | of the model {frequency_off:+.1%}"
    " | decay, 1/s {decay:.1f} | of the model {decay_off:+.1%}"
)
RELEASED = columns(
    "aspect {aspect:g} | released at, degrees from the stable direction {tilt:g}"
    " | sideways, D {drift:.1f}"
)
UNDAMPED = columns(
    "aspect {aspect:g} | Re {reynolds:.2f} | frequency without damping by the flow, Hz"
    " {frequency:.1f}"
)
CASES = cases(fluid=tuple(FLUIDS), aspect=(0.3, 0.5, 0.8, 1.25, 2.0, 4.0))
TILTS = cases(aspect=(0.3, 4.0), tilt=(60.0, 89.0))
ENDS = cases(aspect=(0.2, 0.3, 4.0, 5.0))
STUDIES = {
    "falls": Study(
        [Table(CASES, measure, show), Table(TILTS, released, RELEASED, key="released")], text
    ),
    "swings": Study([Table(ENDS, undamped, UNDAMPED)], text_of_swings),
}
