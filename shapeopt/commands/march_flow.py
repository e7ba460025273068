"""March the flow in time with jax-cfd: drag, shedding frequency, a GIF; an independent check.

python scripts/march_flow.py --aspect 1 --reynolds 20 --out out/march20
python scripts/march_flow.py --aspect 1 --reynolds 100 --time 160 --out out/march100 --json
"""

import json
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from shapeopt.commands.arguments import add_body_arguments, body_record, shape_of
from shapeopt.commands.cli import Parser, emit
from shapeopt.commands.reference import add_reynolds_arguments, reference_record, reynolds_of
from shapeopt.render.pictures import render_march
from surrogate.arrays import AnyArray
from surrogate.body.measures import mean_thickness
from surrogate.errors import InvalidInput, NotConverged
from surrogate.files import JsonObject, check_target, whole_file
from surrogate.flow.check.march import Box, make_marcher, march, start, strouhal
from surrogate.flow.flow import Flow
from surrogate.flow.grid.domain_2d import Domain2D
from surrogate.progress import progress_bar
from surrogate.scene.limits import onset_of
from surrogate.scene.scene import Scene
from surrogate.scene.stream import Tunnel

FRAMES = 60  # of the GIF
NODES = 200  # markers of the body
LONGEST = 4.0  # body in D, so that markers are closer than cells
LEAST_REYNOLDS = 1.0  # the stable time step falls with Re


def main(argv: Sequence[str] | None = None) -> JsonObject:
    """Parse the arguments, march in time, compare with the steady flow, and render.

    The comparison is for symmetric bodies of the family below the onset of instability.
    """
    arguments = _parser().parse_args(argv)
    shape = shape_of(arguments)
    reynolds = reynolds_of(arguments, shape.chord, dimension=2)
    if len(reynolds) != 1:
        raise InvalidInput("--reynolds: one number; run once for each")
    re, out = reynolds[0], Path(arguments.out)
    sheds = re > onset_of(shape)
    duration = (160.0 if sheds else 60.0) if arguments.time is None else arguments.time
    if re < LEAST_REYNOLDS:
        raise InvalidInput(f"--reynolds {re:g}: from 1, below which time steps are too small")
    if not 5 <= duration <= 2000:
        raise InvalidInput(f"--time {duration:g}: from 5 to 2000 D / U")
    if not 6 <= arguments.height <= 64:
        raise InvalidInput(f"--height {arguments.height:g}: from 6 to 64 D")
    box = Box(height=arguments.height, step=min(0.02, 0.2 * re / 12**2))
    markers = shape.draw(NODES)
    length, height = np.ptp(markers, axis=0)
    cells = float(mean_thickness(markers)) * box.cells
    if max(length, 2 * height) > LONGEST or cells < Domain2D.MIN_THICKNESS:
        raise InvalidInput(
            f"body: {length:.3g} x {height:.3g} D; up to {LONGEST:g} x {LONGEST / 2:g} D and "
            f"from {Domain2D.MIN_THICKNESS:g} cells thick can be marched"
        )
    check_target(out, "march.json", ("blockage", "gif"), others=("march.gif",))
    steps = max(1, round(duration / box.step / FRAMES))  # of a frame
    duration = FRAMES * steps * box.step
    drag, lift, frames = _march(box, markers, re, steps, kick=0.5 if sheds else 0.0)
    late = len(drag) // 2
    result = {
        "body": body_record(arguments),
        "incidence": shape.incidence,
        **reference_record(re, shape),
        "height": arguments.height,
        "blockage": float(height / arguments.height),
        "time": duration,
        "cd": float(drag[-1]),
        "cd_mean": float(drag[late:].mean()),
        "cl_mean": float(lift[late:].mean()),
        "cl_amplitude": float(np.ptp(lift[late:]) / 2),
        "strouhal": _strouhal(lift[late:], box.step) if sheds else None,
        "cd_steady": None,
        "gif": str(out / "march.gif"),
    }
    if shape.symmetric and not sheds:  # the same blockage, between slip walls
        tunnel = Flow(Scene(Tunnel(box.height), (re, re)))
        result["cd_steady"] = tunnel.solve(shape, re, estimate=False).drag
    captions = [f"Re {re:g}, t = {duration * (k + 1) / FRAMES:.1f} D / U" for k in range(FRAMES)]
    render_march(box.lattice, markers, frames, captions, out / "march.gif")
    with whole_file(out / "march.json") as part:
        part.write_text(json.dumps(result, indent=1) + "\n")
    return emit(result, arguments.json, _text(result))


def _march(
    box: Box, markers: AnyArray, re: float, steps: int, kick: float
) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
    """Histories of drag and lift at all time steps, and the velocity at every frame."""
    marcher, velocity = make_marcher(box, markers, re), start(box, kick)
    drags, lifts, frames = [], [], []
    with progress_bar("marching") as progress:
        for k in range(FRAMES):
            velocity, record = march(box, marcher, velocity, steps)
            drags.append(np.asarray(record.drag))
            lifts.append(np.asarray(record.lift))
            if not np.all(np.isfinite(drags[-1])):
                raise NotConverged(f"march at Re {re:g}: diverged; a lower Re would help")
            frames.append(np.asarray(velocity))
            time = (k + 1) * steps * box.step
            progress((k + 1) / FRAMES, f"t {time:.0f}: Cd {drags[-1][-1]:.4f}")
    return np.concatenate(drags), np.concatenate(lifts), frames


def _strouhal(lift: np.ndarray, step: float) -> float | None:
    value = strouhal(lift, step)
    return value if math.isfinite(value) else None  # JSON has no NaN


def _text(r: JsonObject) -> str:
    line = f"Re {r['reynolds']:g}, blockage {r['blockage']:.3f}: Cd {r['cd_mean']:.4f}"
    if r["strouhal"] is not None:
        lift = f"Cl {r['cl_mean']:.3f} +- {r['cl_amplitude']:.3f}"
        line += f" on average, {lift}, Strouhal number {r['strouhal']:.4f}"
    if r["cd_steady"] is not None:
        gap = 100 * (r["cd"] / r["cd_steady"] - 1)
        line += (
            f", {r['cd']:.4f} at the end; the steady flow has {r['cd_steady']:.4f} ({gap:+.2f} %)"
        )
    return f"{line} -> {r['gif']}"


def _parser() -> Parser:
    parser = Parser(__doc__)
    add_body_arguments(parser)
    add = parser.add_argument
    add_reynolds_arguments(parser)
    add("--time", type=float, help="duration in D / U, 5 to 2000 (60; with shedding 160)")
    add("--height", type=float, default=16.0, help="of the periodic domain in D, 6 to 64 (16)")
    add("--out", required=True, help="folder of march.gif and march.json")
    return parser
