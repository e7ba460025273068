"""March the flow in time with jax-cfd: drag, shedding frequency, a GIF; an independent check.

python scripts/march_flow.py --aspect 1 --reynolds 20 --out out/march20
python scripts/march_flow.py --aspect 1 --reynolds 100 --time 160 --out out/march100 --json

From 0.7 of the estimated onset of shedding on, the flow starts with a vortex that breaks its
symmetry, and the lift tells whether disturbances grow: sheds is true where its oscillation grows or
keeps its amplitude, false where it decays or the flow lies below these Re, null where the time is
too short to tell; growth_rate is that of the amplitude in U / D, in the later half of the time. cd
is the mean over the later half where the flow sheds, else the last one. The same command again
prints the stored result, except with --table.
"""

import contextlib
import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from shapeopt.commands.arguments import (
    add_body_arguments,
    body_record,
    body_settings,
    shape_of,
)
from shapeopt.commands.cli import Parser, emit
from shapeopt.commands.reference import add_reynolds_arguments, reference_record, reynolds_of
from shapeopt.commands.sweep import check_outputs, write_table
from shapeopt.render.pictures import render_march
from surrogate.arrays import AnyArray
from surrogate.body.measures import mean_thickness
from surrogate.errors import InvalidInput, NotConverged
from surrogate.files import JsonObject, check_target, whole_files
from surrogate.flow.check.march import Box, growth_rate, make_marcher, march, start, strouhal
from surrogate.flow.flow import Flow
from surrogate.flow.grid.domain_2d import Domain2D
from surrogate.progress import print_message, progress_bar
from surrogate.repeats import check_record
from surrogate.scene.limits import onset_of
from surrogate.scene.scene import Scene
from surrogate.scene.stream import Tunnel

FRAMES = 60  # of the GIF
NODES = 200  # markers of the body
LONGEST = 4.0  # body in D, so that markers are closer than cells
LEAST_REYNOLDS = 1.0  # the stable time step falls with Re
NEAR = 0.7  # Re over the estimated onset from which it is asked whether the flow sheds
KICK = 0.5  # velocity of the vortex that breaks the symmetry, over U
# Growth rates in U / D: above the first an oscillation keeps its amplitude, below the second it
# decays; between them it may still fall towards that of vortices shed just above the onset.
SLOWEST, DECAYING = -0.002, -0.006
SILENT = 1e-4  # amplitude of Cl below which nothing sheds
RECORD, GIF = "march.json", "march.gif"


def main(argv: Sequence[str] | None = None) -> JsonObject:
    """Parse the arguments, march in time, compare with the steady flow, and render.

    Symmetric bodies whose flow does not shed are compared with the steady flow.
    """
    arguments = _parser().parse_args(argv)
    check_outputs(arguments.table, None)
    shape = shape_of(arguments)
    reynolds = reynolds_of(arguments, shape.chord, dimension=2)
    if len(reynolds) != 1:
        raise InvalidInput("--reynolds: one number; run once for each")
    re, out = reynolds[0], Path(arguments.out)
    near = re > NEAR * onset_of(shape)
    duration = (160.0 if near else 60.0) if arguments.time is None else arguments.time
    if not 5 <= duration <= 2000:
        raise InvalidInput(f"--time {duration:g}: from 5 to 2000 D / U")
    markers = shape.draw(NODES)
    box = _box_for(markers, re, arguments.height)
    asked = {"body": body_settings(arguments), "incidence": shape.incidence, "reynolds": re}
    asked |= {"height": arguments.height, "time": duration}
    stored = _stored(out, asked, arguments.overwrite)
    if stored is not None and not arguments.table:
        print_message(f"{out}: this march is done already; --overwrite repeats it")
        return emit(stored, arguments.json, _text(stored))
    steps = max(1, round(duration / box.step / FRAMES))  # of a frame
    duration = FRAMES * steps * box.step
    drag, lift, frames = _march(box, markers, re, steps, kick=KICK if near else 0.0)
    result = {
        "body": body_record(arguments),
        "incidence": shape.incidence,
        **reference_record(re, shape),
        "height": arguments.height,
        "time": duration,
        "blockage": float(np.ptp(markers[:, 1]) / arguments.height),
        **_findings(drag, lift, box.step, near),
        "cd_steady": None,
        "gif": str(out / GIF),
        "settings": asked,
    }
    if shape.symmetric and result["sheds"] is False:  # the same blockage, between slip walls
        tunnel = Flow(Scene(Tunnel(box.height), (re, re)))
        with contextlib.suppress(InvalidInput, NotConverged):  # the march is an answer without it
            steady = tunnel.solve(shape, re, estimate=False, allow_unsteady=True)
            result["cd_steady"] = steady.drag
    captions = [f"Re {re:g}, t = {duration * (k + 1) / FRAMES:.1f} D / U" for k in range(FRAMES)]
    if arguments.table:
        times = (box.step * np.arange(1, len(drag) + 1)).tolist()
        columns = zip(times, drag.tolist(), lift.tolist(), strict=True)
        write_table([{"time": t, "cd": cd, "cl": cl} for t, cd, cl in columns], arguments.table)
    with whole_files(out, RECORD) as part:
        render_march(box.lattice, markers, frames, captions, part / GIF)
        (part / RECORD).write_text(json.dumps(result, indent=1) + "\n")
    return emit(result, arguments.json, _text(result))


def _box_for(markers: AnyArray, re: float, height: float) -> Box:
    """Return the box in which a body is marched.

    Raises:
      InvalidInput: the body, the Reynolds number or the height cannot be marched.
    """
    if re < LEAST_REYNOLDS:
        raise InvalidInput(f"--reynolds {re:g}: from 1, below which time steps are too small")
    if not 6 <= height <= 64:
        raise InvalidInput(f"--height {height:g}: from 6 to 64 D")
    box = Box(height=height, step=min(0.02, 0.2 * re / 12**2))
    long, high = np.ptp(markers, axis=0)
    cells = float(mean_thickness(markers)) * box.cells
    if max(long, 2 * high) > LONGEST or cells < Domain2D.MIN_THICKNESS:
        raise InvalidInput(
            f"body: {long:.3g} x {high:.3g} D; up to {LONGEST:g} x {LONGEST / 2:g} D and from "
            f"{Domain2D.MIN_THICKNESS:g} cells thick can be marched"
        )
    return box


def _march(
    box: Box, markers: AnyArray, re: float, steps: int, kick: float
) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
    """Return drag and lift at all time steps, and the velocity at every frame."""
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


def _findings(drag: np.ndarray, lift: np.ndarray, step: float, near: bool) -> JsonObject:
    """Return the coefficients of a march, whether it sheds vortices, and how fast these grow."""
    late = slice(len(drag) // 2, None)
    mean, rate = float(drag[late].mean()), growth_rate(lift, step) if near else None
    amplitude = float(np.ptp(lift[late]) / 2)
    if not near or amplitude < SILENT or (rate is not None and rate < DECAYING):
        sheds = False
    else:
        sheds = True if rate is not None and rate > SLOWEST else None
    return {
        "cd": mean if sheds else float(drag[-1]),
        "cd_mean": mean,
        "cl_mean": float(lift[late].mean()),
        "cl_amplitude": amplitude,
        "growth_rate": rate,
        "sheds": sheds,
        "strouhal": strouhal(lift[late], step) if sheds else None,
    }


def _stored(out: Path, asked: JsonObject, overwrite: bool) -> JsonObject | None:
    """Return the record of the march that a folder holds if it is of these settings, else None.

    Raises:
      InvalidInput: it holds another march and ``overwrite`` is not set, or something else.
    """
    check_target(out, RECORD, ("blockage", "gif"), others=(GIF,))
    record = None if overwrite else check_record(out / RECORD, "march", asked)
    return record | {"gif": str(out / GIF)} if record and (out / GIF).is_file() else None


def _text(r: JsonObject) -> str:
    line = f"Re {r['reynolds']:g}, blockage {r['blockage']:.3f}: Cd {r['cd']:.4f}"
    if r["strouhal"] is not None:
        lift = f"Cl {r['cl_mean']:.3f} +- {r['cl_amplitude']:.3f}"
        line += f" on average, {lift}, Strouhal number {r['strouhal']:.4f}"
    if r["growth_rate"] is not None:
        grows = {True: "sheds vortices", False: "does not shed", None: "sheds or not: more --time"}
        grows = grows[r["sheds"]]
        line += f"; {grows}: the lift's amplitude changes at the rate {r['growth_rate']:+.4f} U / D"
    elif r["sheds"] is None:
        line += "; sheds or not: undecided without a growth rate of the lift, more --time"
    if r["cd_steady"] is not None:
        gap = 100 * (r["cd"] / r["cd_steady"] - 1)
        line += f"; the steady flow has {r['cd_steady']:.4f} ({gap:+.2f} %)"
    return f"{line} -> {r['gif']}"


def _parser() -> Parser:
    parser = Parser(__doc__)
    add_body_arguments(parser, several=False)
    add = parser.add_argument
    add_reynolds_arguments(parser, several=False)
    add(
        "--time",
        type=float,
        help="duration in D / U, 5 to 2000 (60; near the onset and beyond 160)",
    )
    add(
        "--height",
        type=float,
        default=16.0,
        help="height of the periodic domain in D, 6 to 64 (16)",
    )
    add("--out", required=True, help="folder of march.gif and march.json")
    add("--table", help="CSV file of Cd and Cl at all time steps")
    add("--overwrite", action="store_true", help="replace another march that is there")
    return parser
