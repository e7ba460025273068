"""Free falls of spheroids in air and in water beside what experiments and simulations report."""

import numpy as np
from study import Result, Row, Run, Study, Table, cases, columns

from shapeopt.free_fall import Fall, fall
from shapeopt.orientation import orientations, small_swings
from surrogate import Particle, load
from surrogate.model.surrogate import Surrogate

SURROGATE, TILT = "pretrained:particle", 30.0  # degrees of the axis above its stable position
AIR = Particle(density_ratio=1000, viscosity=1.5e-5, size=1.4e-4)
WATER = Particle(density_ratio=1.2, viscosity=1e-6, size=4e-4)
FLUIDS = {"air": AIR, "water": WATER}


def measure(run: Run, fluid: str, aspect: float) -> Row:
    """Return the final Re, the sideways drift, and small swings about the final motion."""
    net, particle = load(SURROGATE), FLUIDS[fluid]
    body = [aspect, 1.0, 0.0, 0.0]
    stable = 90.0 if aspect > 1 else 0.0  # incidence of the axis, to the vertical velocity
    found = _until_steady(net, body, particle, -90.0 + stable + TILT)
    frequency, decay = small_swings(net, body, particle, found)
    row: Row = {"reynolds": float(found.reynolds[-1]), "speed": float(-found.velocity[-1, 1])}
    row |= {"size": 1e6 * particle.size, "drift": float(np.ptp(found.x) / particle.size)}
    row["stable"] = [o.incidence for o in orientations(net, body, row["reynolds"]) if o.stable]
    row |= {"frequency": frequency, "decay": decay}
    return row


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


def text(result: Result) -> str:
    """Return what a paper reports on such falls, and whether these show it."""
    air = {row["aspect"]: row for row in result["rows"] if row["fluid"] == "air"}
    disc, rod = air.get(min(air)), air.get(max(air))
    if not (disc["frequency"] and rod["frequency"]):
        return ""
    return (
        "Bhowmick, Wang, Latt and Bagheri (J. Fluid Mech. 2025) report of ellipsoids in air at a "
        "density ratio of 1000 and Re 2.1 to 4.5 that they swing, discs at nearly twice the "
        "frequency of rods and with a faster decay, and that they drift sideways by up to ten "
        "diameters; of liquids, that the orientation relaxes monotonically. Here the flattest "
        f"spheroid swings at {disc['frequency'] / rod['frequency']:.1f} times the frequency of the "
        f"longest one and decays {disc['decay'] / rod['decay']:.1f} times as fast; the largest "
        f"drift is {max(row['drift'] for row in air.values()):.1f} D. Frequencies and drifts may "
        "differ from those reported since the bodies were released in another way, or since the "
        "resistance to rotation here is that of Stokes flow. Sideways is the range of the "
        "horizontal position over the fall; a dash, that nothing swings."
    )


COLUMNS = columns(
    "fluid {fluid} | aspect {aspect:g} | size, um {size:g} | Re {reynolds:.2f}"
    " | speed, m/s {speed:.4f} | small swings: frequency, Hz {frequency:.1f}"
    " | decay, 1/s {decay:.1f} | sideways, D {drift:.1f}"
)
CASES = cases(fluid=tuple(FLUIDS), aspect=(0.3, 0.5, 0.8, 1.25, 2.0, 4.0))
STUDIES = {"falls": Study([Table(CASES, measure, COLUMNS)], text)}
