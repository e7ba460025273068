"""Pictures of optimised shapes: before and after, side by side (.png), or the evolution (.gif).

Of a run in space the .gif is a turntable of the optimum in its flow, and bodies are coloured by
pressure, with --surface by friction.

python scripts/render_shapes.py --runs out/re1 out/re40 --out out/shapes.png
python scripts/render_shapes.py --runs out/re40 --out out/re40.gif
python scripts/render_shapes.py --runs out/re1 out/re40 --surface --out out/loads.png
python scripts/render_shapes.py --runs out/re1 out/re10 out/re40 --family --out out/family.png
"""

import functools
from collections.abc import Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from shapeopt.commands.cli import Parser, emit
from shapeopt.render.bodies_3d import FRICTION, PRESSURE, render_bodies, render_turntable
from shapeopt.render.pictures import render_evolution
from shapeopt.render.plots import plot_family, plot_surfaces
from shapeopt.render.sheets import before_and_after, render_panels, solve_run
from shapeopt.render.signature import check_picture
from shapeopt.runs import load_run, run_scene
from surrogate.errors import InvalidInput
from surrogate.model.store import load
from surrogate.progress import progress_bar


def main(argv: Sequence[str] | None = None) -> dict[str, Any]:
    """Parse, solve the flows to be shown, render."""
    arguments = _parser().parse_args(argv)
    out = check_picture(arguments.out, ".png", ".gif")
    records = [load_run(folder) for folder in arguments.runs]
    dimensions = {run_scene(record).dimension for record in records}
    if len(dimensions) > 1:
        raise InvalidInput("--runs: some are of the plane, some of space; render them apart")
    dimension = dimensions.pop()
    if out.suffix == ".gif" and (arguments.family or (arguments.surface and dimension == 2)):
        raise InvalidInput(f"{out}: --family, and in the plane --surface, make a .png")
    load_shown = FRICTION if arguments.surface else PRESSURE
    with progress_bar("rendering") as progress:
        if out.suffix == ".gif" and dimension == 3:
            render_turntable(_only(records, out, before_and_after)[1], out, load_shown)
        elif out.suffix == ".gif":
            _only(records, out, functools.partial(_evolution, out=out))
        elif arguments.family:
            plot_family(_verified(records), out)
        elif arguments.surface and dimension == 3:
            render_bodies(_each(before_and_after, records, progress), out, load_shown)
        elif arguments.surface:
            loads = _each(_surfaces, records, progress)
            plot_surfaces(list(zip(records, loads, strict=True)), out)
        else:
            render_panels(_each(before_and_after, records, progress), out)
        progress(1.0, str(out))
    return emit({"out": str(out), "runs": arguments.runs}, arguments.json, f"-> {out}")


def _each(solve, records, progress):
    """Solve every run's flows."""
    found = []
    for k, record in enumerate(records):
        found.append(solve(record))
        progress((k + 1) / (len(records) + 1), f"Re {record['reynolds']:g}")
    return found


def _surfaces(record):
    return tuple(solution.surface() for solution in solve_run(record))


def _verified(records):
    if len(records) < 2:
        raise InvalidInput("--family: shows several runs; give two --runs folders or more")
    for record in records:
        if record.get("cd_verified") is None or record.get("cd_start") is None:
            raise InvalidInput(f"--family: the run at Re {record['reynolds']:g} is not verified")
        if len(record.get("cases", [])) > 1:
            raise InvalidInput("--family: shows the drag at one Re a run; one here is of several")
    return records


def _only(records, out, draw):
    if len(records) != 1:
        raise InvalidInput(f"{out}: a .gif shows one run; give one --runs folder")
    return draw(records[0])


def _evolution(record, out):
    path = np.array(record["path"])
    captions = [f"Re {record['reynolds']:g}, step {k}" for k in range(len(path))]
    if record["surrogate"] != "none":
        surrogate = load(record["surrogate"])
        if surrogate.scene != run_scene(record):
            raise InvalidInput(f"{record['surrogate']}: is of another scene than its run")
        network = surrogate.network
        reynolds = jnp.asarray(record["reynolds"])
        drags = jax.vmap(network.drag, in_axes=(0, None))(jnp.asarray(path), reynolds)
        captions = [f"{c}, Cd {d:.4f} (surrogate)" for c, d in zip(captions, drags, strict=True)]
    render_evolution(run_scene(record).family, path, captions, out)


def _parser():
    parser = Parser(__doc__)
    parser.add_argument("--runs", required=True, nargs="+", help="folders of optimize_shape.py")
    parser.add_argument("--out", required=True, help="picture, .png or .gif")
    kind = parser.add_mutually_exclusive_group()
    kind.add_argument(
        "--surface",
        action="store_true",
        help="pressure and friction along the body; in space bodies by friction",
    )
    kind.add_argument("--family", action="store_true", help="the optima of several runs over Re")
    return parser
