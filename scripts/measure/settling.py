"""How fast particles fall: by the flow, by Stokes, by the standard curve of the sphere.

python scripts/measure/settling.py
"""

import math
import sys
from collections.abc import Callable

from scipy.optimize import brentq
from study import TINY, Result, Study, run_study, table_of_rows

from surrogate import Flow, Scene, family_shape
from surrogate.flow.settling import RANGE, Particle, settle

WATER = 1e-6  # m^2/s
QUARTZ, POLYESTER, POLYETHYLENE = 2.65, 1.38, 0.95  # densities over that of water
GRAINS = (5e-6, 20e-6, 63e-6, 125e-6, 250e-6, 400e-6)  # m
PARTICLES = {  # parameters of the family, density ratio, size
    "flake of quartz": ({"aspect": 0.5}, QUARTZ, 250e-6),
    "spindle of quartz": ({"aspect": 3.0}, QUARTZ, 250e-6),
    "fragment of polyester": ({"aspect": 0.7, "flatness": 1.5}, POLYESTER, 300e-6),
    "fibre of polyester": ({"aspect": 4.0}, POLYESTER, 100e-6),
    "pellet of polyethylene, rising": ({"aspect": 0.8}, POLYETHYLENE, 500e-6),
}
HEADS = "particle | size, um | Re | velocity, mm/s | Stokes's law for its sphere is off by"
HEADS += " | the curve of its sphere by | estimated error of Cd | flows"
FORMS = "{name} | {size:g} | {reynolds:.3g} | {velocity:.4g} | {stokes:+.1%} | {curve:+.1%}"
FORMS += " | {estimate:.2%} | {flows}"


def measure(tiny: bool, progress: Callable) -> Result:
    """Spheres of many sizes, then other bodies, which fall or rise along their axis."""
    chosen = [("sphere of quartz", {"aspect": 1.0}, QUARTZ, size) for size in GRAINS]
    chosen += [(name, *particle) for name, particle in PARTICLES.items()]
    flow = Flow(Scene(dimension=3, reynolds=RANGE, fidelity=TINY if tiny else "standard"))
    rows = []
    for k, (name, body, density, size) in enumerate(chosen[-1:] if tiny else chosen):
        progress(k / len(chosen), f"{name}, {1e6 * size:g} um")
        particle = Particle(density, WATER, size)
        settled = settle(flow, family_shape(body, dimension=3), particle)
        rows.append(
            {
                "name": name,
                "size": 1e6 * size,
                "reynolds": settled.reynolds,
                "velocity": 1e3 * settled.velocity,
                "stokes": particle.archimedes / 18 / settled.reynolds - 1,
                "curve": _by_curve(particle) / settled.reynolds - 1,
                "estimate": settled.solution.estimated_error,
                "flows": settled.flows,
            }
        )
    return {"rows": rows}


def sphere_drag(reynolds: float) -> float:
    """Cd of a sphere (Clift, Grace and Weber 1978), Re up to 260."""
    if reynolds < 0.01:
        return 24 / reynolds * (1 + 3 / 16 * reynolds)
    if reynolds <= 20:
        power = 0.82 - 0.05 * math.log10(reynolds)
        return 24 / reynolds * (1 + 0.1315 * reynolds**power)
    return 24 / reynolds * (1 + 0.1935 * reynolds**0.6305)


def _by_curve(particle: Particle) -> float:
    """Re of the sphere of the particle's volume."""

    def surplus(log_re):
        re = math.exp(log_re)
        return math.log(sphere_drag(re) * re**2 / (4 / 3 * particle.archimedes))

    return math.exp(brentq(surplus, math.log(1e-12), math.log(RANGE[1])))


STUDY = Study("settling", measure, table_of_rows(HEADS, FORMS))

if __name__ == "__main__":
    sys.exit(run_study(STUDY))
