"""The free fall of a 3-D body in its plane of symmetry, by the loads of a surrogate.

python scripts/free_fall.py --aspect 2 --particle 1.2,1e-6,5e-4 --tilt 60 --seconds 2
python scripts/free_fall.py --aspect 0.5 --particle 1.2,1e-6,5e-4 --plot out/fall.png

The body starts at rest. Its loads are those of steady motion at the momentary incidence and Re;
left out are what rotation does to drag and lift, and the memory of the flow. The incidence in
table and plot is the angle from the axis to the velocity, -180 to 180 degrees; beyond +-90 the
tail is ahead. The horizontal and the upward velocity are u and w, the speed is "velocity", in m/s.
"""

import math
from collections.abc import Sequence

from shapeopt.commands.arguments import add_family_arguments, check_aspect, family_named
from shapeopt.commands.cli import Parser, emit
from shapeopt.commands.particle import add_particle_argument, particle_line, particle_of
from shapeopt.commands.sweep import check_outputs, write_table
from shapeopt.free_fall import Fall, fall
from shapeopt.orientation import moment_is_known, orientations
from surrogate.body.parameters import INCIDENCE, PARAMETERS
from surrogate.files import JsonObject
from surrogate.model.store import load

NEGLIGIBLE = 1e-6  # relative size of what is printed as zero
NAMES = [name for name, p in PARAMETERS.items() if p.keeps_mirror_plane]


def main(argv: Sequence[str] | None = None) -> JsonObject:
    """Parse the arguments, integrate the fall and report it."""
    arguments = _parser().parse_args(argv)
    check_aspect(arguments)
    particle = particle_of(arguments.particle)
    check_outputs(arguments.table, arguments.plot)
    surrogate = load(arguments.surrogate)
    named = family_named(arguments, NAMES) | {INCIDENCE.name: 0.0}
    body = surrogate.scene.family.parameters(named)
    found = fall(surrogate, body, particle, arguments.seconds, arguments.tilt)
    reynolds = max(float(found.reynolds[-1]), surrogate.scene.reynolds[0])
    known = moment_is_known(surrogate, body, reynolds)
    stable = None
    if known:
        stable = [o.incidence for o in orientations(surrogate, body, reynolds) if o.stable]
    horizontal, upward = found.velocity[-1].tolist()
    result = {
        "seconds": float(found.time[-1]),
        "x": float(found.x[-1]),
        "z": float(found.z[-1]),
        "velocity": math.hypot(horizontal, upward),
        "u": horizontal,
        "w": upward,
        "reynolds": float(found.reynolds[-1]),
        "tilt": float(found.tilt[-1]),
        "incidence": float(found.incidence[-1]),
        "stable_incidences": stable,
        "moment_is_known": known,
        "parameters": surrogate.scene.family.named(body),
        "surrogate": arguments.surrogate,
    }
    if arguments.table:
        write_table(_rows(found), arguments.table)
    if arguments.plot:
        from shapeopt.render.falls import plot_fall  # matplotlib takes half a second to import

        shape = surrogate.scene.family.body_class, body
        plot_fall(found, *shape, particle, arguments.plot)
    sideways, axis = _rounded(horizontal, upward), _rounded(result["tilt"], 90)
    text = (
        f"{particle_line(particle)}\n"
        f"after {found.time[-1]:.4g} s: Re {result['reynolds']:.4g}, {abs(upward):.4g} m/s "
        f"{'down' if upward < 0 else 'up'} and {sideways:.4g} m/s sideways, axis {axis:.1f} "
        f"degrees above the horizontal\nincidences that are stable at Re {reynolds:.4g}, of either "
        "sign: "
    )
    if stable is None:
        text += (
            "not known, as the largest moment is below the largest bound of the surrogate's error"
        )
    else:
        text += ", ".join(f"{degrees:.3g}" for degrees in stable) or "none"
    return emit(result, arguments.json, text)


def _rounded(value: float, scale: float) -> float:
    """Return a value without what is rounding error beside a scale, and without a minus zero."""
    return 0.0 if abs(value) < NEGLIGIBLE * abs(scale) else value


def _rows(found: Fall) -> list[JsonObject]:
    """Return the motion as rows of a table, in SI units and degrees."""
    names = ("time", "x", "z", "tilt", "incidence", "reynolds")
    columns = [getattr(found, name).tolist() for name in names]
    rows = [dict(zip(names, row, strict=True)) for row in zip(*columns, strict=True)]
    speeds = found.velocity.tolist()
    return [row | {"u": u, "w": w} for row, (u, w) in zip(rows, speeds, strict=True)]


def _parser() -> Parser:
    parser = Parser(__doc__)
    models = "folder, or pretrained:particle (the default); of 3-D bodies at 0 to 90 degrees"
    parser.add_argument("--surrogate", default="pretrained:particle", help=models)
    add_family_arguments(parser, NAMES)
    add = parser.add_argument
    add_particle_argument(parser, required=True)
    add("--seconds", type=float, default=1.0, help="duration (1)")
    add("--tilt", type=float, default=45.0, help="degrees of the axis above the horizontal (45)")
    add("--table", help="CSV file of the motion")
    add("--plot", help="PNG, SVG or PDF file: the path with the body on it, Re and incidence")
    return parser
