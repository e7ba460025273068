"""Pictures of optimised shapes: reference body and optimum (.png), or the search's path (.gif).

Of a 3-D run the .gif is a turntable of the optimum in its flow, and bodies are coloured by
pressure, with --surface by friction.

python scripts/render_shapes.py --runs out/re1 out/re40 --out out/shapes.png
python scripts/render_shapes.py --runs out/flow --out out/flow.png  # of solve_drag.py --out
python scripts/render_shapes.py --runs out/re40 --out out/re40.gif
python scripts/render_shapes.py --runs out/re1 out/re40 --surface --out out/loads.png
python scripts/render_shapes.py --runs out/re1 out/re10 out/re40 --family --out out/family.png
"""

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from shapeopt.commands.cli import Parser, emit
from shapeopt.render.bodies_3d import FRICTION, PRESSURE, render_turntable
from shapeopt.render.pictures import render_evolution
from shapeopt.render.plots import plot_family, plot_surfaces
from shapeopt.render.sheets import before_and_after, render_panels, solve_run
from shapeopt.runs import load_run, run_scene
from surrogate.errors import InvalidInput
from surrogate.files import JsonObject, check_file
from surrogate.flow.output.folder import is_flow, read_flow
from surrogate.flow.output.picture import draw_flows
from surrogate.model.store import load
from surrogate.progress import Update, progress_bar


def main(argv: Sequence[str] | None = None) -> JsonObject:
    """Parse the arguments, solve the flows, render."""
    arguments = _parser().parse_args(argv)
    out = check_file(arguments.out, ".png", ".gif")
    flows = [is_flow(folder) for folder in arguments.runs]
    if any(flows):
        return _flows(arguments, out, all(flows))
    records = [load_run(folder) for folder in arguments.runs]
    dimensions = {run_scene(record).dimension for record in records}
    if len(dimensions) > 1:
        raise InvalidInput("--runs: some are 2-D, some 3-D; render them separately")
    dimension = dimensions.pop()
    gif = out.suffix == ".gif"
    if gif and (arguments.family or (arguments.surface and dimension == 2)):
        raise InvalidInput(f"{out}: --family, and in 2-D --surface, need a .png")
    if gif and len(records) > 1:
        raise InvalidInput(f"{out}: a .gif shows one run; give one --runs folder")
    load_shown = FRICTION if arguments.surface else PRESSURE
    with progress_bar("rendering") as progress:
        if gif and dimension == 3:
            render_turntable(before_and_after(records[0])[1], out, load_shown)
        elif gif:
            _evolution(records[0], out)
        elif arguments.family:
            plot_family(_verified(records), out)
        elif arguments.surface and dimension == 2:
            surfaces = [[s.surface() for s in solve_run(r)] for r in _tracked(records, progress)]
            plot_surfaces(list(zip(records, surfaces, strict=True)), out)
        else:
            rows = [before_and_after(record) for record in _tracked(records, progress)]
            render_panels(rows, out, load_shown)
        progress(1.0, str(out))
    return emit({"out": str(out), "runs": arguments.runs}, arguments.json, f"-> {out}")


def _flows(arguments: argparse.Namespace, out: Path, all_flows: bool) -> JsonObject:
    """Draw folders of solved flows, one row each."""
    if not all_flows:
        raise InvalidInput("--runs: some are flows, some runs; render them separately")
    if arguments.surface or arguments.family or out.suffix == ".gif":
        raise InvalidInput(f"{out}: flows are drawn as a .png, without --surface and --family")
    draw_flows([read_flow(folder).picture for folder in arguments.runs], out)
    return emit({"out": str(out), "runs": arguments.runs}, arguments.json, f"-> {out}")


def _tracked(records: list[JsonObject], progress: Update) -> Iterator[JsonObject]:
    """The records, with progress reported after each."""
    for k, record in enumerate(records):
        yield record
        progress((k + 1) / (len(records) + 1), f"Re {record['reynolds']:g}")


def _verified(records: list[JsonObject]) -> list[JsonObject]:
    if len(records) < 2:
        raise InvalidInput("--family: needs two --runs folders or more")
    for record in records:
        if record.get("cd_verified") is None or record.get("cd_start") is None:
            raise InvalidInput(f"--family: the run at Re {record['reynolds']:g} is not verified")
        if len(record.get("cases", [])) > 1:
            raise InvalidInput("--family: needs runs at one Reynolds number each; one has several")
    return records


def _evolution(record: JsonObject, out: Path) -> None:
    path = np.array(record["path"])
    captions = [f"Re {record['reynolds']:g}, step {k}" for k in range(len(path))]
    if record["surrogate"] != "none":
        surrogate = load(record["surrogate"])
        if surrogate.scene != run_scene(record):
            raise InvalidInput(f"{record['surrogate']}: has another scene than its run")
        network = surrogate.network
        reynolds = jnp.asarray(record["reynolds"])
        drags = jax.vmap(network.drag, in_axes=(0, None))(jnp.asarray(path), reynolds)
        captions = [f"{c}, Cd {d:.4f} (surrogate)" for c, d in zip(captions, drags, strict=True)]
    render_evolution(run_scene(record).family, path, captions, out)


def _parser() -> Parser:
    parser = Parser(__doc__)
    parser.add_argument(
        "--runs", required=True, nargs="+", help="folders of optimize_shape.py or solve_drag.py"
    )
    parser.add_argument("--out", required=True, help="picture, .png or .gif")
    add = parser.add_mutually_exclusive_group().add_argument
    surface = "pressure and friction along the contour; 3-D: colour by friction"
    add("--surface", action="store_true", help=surface)
    add("--family", action="store_true", help="the optima of several runs over Re")
    return parser
