"""Terminal velocities of particles: by the flow, by Stokes's law, by the drag curve of spheres."""

import math
from collections.abc import Iterator

from scipy.optimize import brentq
from study import TINY, Row, Run, Study, Table, columns

from surrogate import Flow, Scene, family_shape
from surrogate.flow.settling import RANGE, Particle, settle

WATER = 1e-6  # m^2/s
QUARTZ, POLYESTER, POLYETHYLENE = 2.65, 1.38, 0.95  # densities over that of water
SPHERES = (5e-6, 20e-6, 63e-6, 125e-6, 250e-6, 400e-6)  # m
PARTICLES = {  # parameters of the family, density ratio, size
    "flake of quartz": ({"aspect": 0.5}, QUARTZ, 250e-6),
    "spindle of quartz": ({"aspect": 3.0}, QUARTZ, 250e-6),
    "fragment of polyester": ({"aspect": 0.7, "flatness": 1.5}, POLYESTER, 300e-6),
    "fibre of polyester": ({"aspect": 4.0}, POLYESTER, 100e-6),
    "pellet of polyethylene, rising": ({"aspect": 0.8}, POLYETHYLENE, 500e-6),
    "spindle of quartz, held at 45 degrees": ({"aspect": 3.0, "incidence": 45.0}, QUARTZ, 250e-6),
    "flake of quartz, held at 30 degrees": ({"aspect": 0.5, "incidence": 30.0}, QUARTZ, 250e-6),
}


def particles(run: Run) -> Iterator[Row]:
    """Yield spheres of many sizes, then other bodies, most of which move along their axis."""
    spheres = [("sphere of quartz", ({"aspect": 1.0}, QUARTZ, size)) for size in SPHERES]
    for name, (body, density, size) in [*spheres, *PARTICLES.items()]:
        yield {"name": name, "size": 1e6 * size, "parameters": body, "density": density}


def measure(run, size, parameters, density, **_) -> Row:
    """Return Re, speed (mm/s) and drift (degrees), and errors of the two laws for the sphere.

    The sphere is that of the body's volume.

    Args:
      run: How the study is run.
      size: Diameter of that sphere in um.
      parameters: Of the body, by name.
      density: Over that of water.
      **_: The rest of the case.
    """
    scene = Scene(dimension=3, reynolds=RANGE, fidelity=run.pick(TINY, "standard"))
    flow, particle = Flow(scene), Particle(density, WATER, 1e-6 * size)
    settled = settle(flow, family_shape(parameters, dimension=3), particle)
    return {
        "reynolds": settled.reynolds,
        "velocity": 1e3 * settled.velocity,
        "drift": settled.drift,
        "stokes": particle.archimedes / 18 / settled.reynolds - 1,
        "curve": _by_curve(particle) / settled.reynolds - 1,
        "estimate": settled.solution.estimated_error,
        "flows": settled.flows,
    }


def sphere_drag(reynolds: float) -> float:
    """Return Cd of a sphere (Clift, Grace and Weber 1978), for Re up to 260."""
    if reynolds < 0.01:
        return 24 / reynolds * (1 + 3 / 16 * reynolds)
    if reynolds <= 20:
        power = 0.82 - 0.05 * math.log10(reynolds)
        return 24 / reynolds * (1 + 0.1315 * reynolds**power)
    return 24 / reynolds * (1 + 0.1935 * reynolds**0.6305)


def _by_curve(particle: Particle) -> float:
    """Re at which the sphere of the particle's volume falls."""

    def excess(log_re):
        re = math.exp(log_re)
        return math.log(sphere_drag(re) * re**2 / (4 / 3 * particle.archimedes))

    return math.exp(brentq(excess, math.log(1e-12), math.log(RANGE[1])))


COLUMNS = columns(
    "particle {name} | size, um {size:g} | Re {reynolds:.3g} | speed, mm/s {velocity:.4g}"
    " | drift from the vertical, degrees {drift:z.1f}"
    " | error of Stokes's law {stokes:+.1%} | of the sphere's drag curve {curve:+.1%}"
    " | estimated error of Cd {estimate:.2%} | flows {flows}"
)
STUDIES = {"settling": Study([Table(particles, measure, COLUMNS, tiny="last")])}
