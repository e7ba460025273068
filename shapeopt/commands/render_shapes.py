"""Pictures of optimised shapes, reference body and optimum, and of flows of solve_drag.py --out.

3-D bodies are coloured by pressure, with --surface by friction, and the .gif is a turntable of
the optimum, or of the flow's body. In 2-D the .gif is the search's path. --plane draws vorticity,
pressure and streamlines with eddies, in 3-D in the plane of symmetry.

python scripts/render_shapes.py --runs out/re1 out/re40 --out out/shapes.png
python scripts/render_shapes.py --runs out/flow --out out/body.png  # of solve_drag.py --out
python scripts/render_shapes.py --runs out/flow --out out/turning.gif
python scripts/render_shapes.py --runs out/flow out/other --plane --out out/planes.png
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
from shapeopt.records import (
    RECORD,
    is_by_chord,
    load_run,
    reynolds_text,
    run_reference,
    run_reynolds,
    run_scene,
    surrogate_name,
)
from shapeopt.render.bodies_3d import (
    FRICTION,
    PRESSURE,
    render_bodies,
    render_turntable,
    solved_panel,
    stored_panel,
)
from shapeopt.render.pictures import render_evolution
from shapeopt.render.plots import plot_family, plot_surfaces
from shapeopt.render.sheets import (
    before_and_after,
    is_compared,
    render_panels,
    several_cases,
    solve_run,
)
from surrogate.errors import InvalidInput
from surrogate.files import JsonObject, check_file
from surrogate.flow.output.folder import flow_as_stored, is_flow, read_flow
from surrogate.flow.output.picture import draw_flows
from surrogate.model.store import load
from surrogate.progress import Update, progress_bar


def main(argv: Sequence[str] | None = None) -> JsonObject:
    """Parse the arguments, solve the flows and render them."""
    arguments = _parser().parse_args(argv)
    out = check_file(arguments.out, ".png", ".gif")
    flows = [is_flow(folder) for folder in arguments.runs]
    if any(flows):
        return _flows(arguments, out, all(flows))
    for folder in arguments.runs:
        _check_one_flow(folder)
    records = [load_run(folder) for folder in arguments.runs]
    dimensions = {run_scene(record).dimension for record in records}
    if len(dimensions) > 1:
        raise InvalidInput("--runs: some are 2-D, some 3-D; render them separately")
    dimension = dimensions.pop()
    gif = out.suffix == ".gif"
    if gif and (arguments.family or arguments.plane or (arguments.surface and dimension == 2)):
        raise InvalidInput(f"{out}: --family, --plane, and in 2-D --surface, need a .png")
    if gif and len(records) > 1:
        raise InvalidInput(f"{out}: a .gif shows one run; give one --runs folder")
    load_shown = FRICTION if arguments.surface else PRESSURE
    with progress_bar("rendering") as progress:
        if gif and dimension == 3:
            render_turntable(solved_panel(before_and_after(records[0])[1]), out, load_shown)
        elif gif:
            _evolution(records[0], out)
        elif arguments.family:
            _check_objectives(records)
            plot_family(_verified(records), out)
        elif arguments.plane:
            panels = [p for r in _tracked(records, progress) for p in before_and_after(r)]
            pictures = [flow_as_stored(p.solution).picture._replace(title=p.title) for p in panels]
            draw_flows(pictures, out)
        elif arguments.surface and dimension == 2:
            surfaces = [[s.surface() for s in solve_run(r)] for r in _tracked(records, progress)]
            plot_surfaces(list(zip(records, surfaces, strict=True)), out)
        else:
            rows = [before_and_after(record) for record in _tracked(records, progress)]
            render_panels(rows, out, load_shown)
        progress(1.0, str(out))
    return emit({"out": str(out), "runs": arguments.runs}, arguments.json, f"-> {out}")


def _check_objectives(records: list[JsonObject]) -> None:
    """Raise InvalidInput unless all runs have the same kind of objective."""
    kinds = {record["objective"]["kind"] for record in records}
    if len(kinds) > 1:
        words = ", ".join(sorted(kinds))
        raise InvalidInput(f"--family: runs of one objective; these are of {words}")
    if len({is_by_chord(record) for record in records}) > 1:
        raise InvalidInput("--family: some runs are by the chord, some by D; draw them separately")


def _check_one_flow(folder: str) -> None:
    """Raise InvalidInput where a folder is no run but that of several flows, as of a sweep."""
    if (Path(folder) / RECORD).is_file():
        return
    if found := sorted(path.parent.name for path in Path(folder).glob("*/flow.json")):
        raise InvalidInput(f"{folder}: holds several flows; give them, as {folder}/{found[0]}")


def _flows(arguments: argparse.Namespace, out: Path, all_flows: bool) -> JsonObject:
    """Draw folders of solved flows, one row each: bodies in 3-D, or the plane of the flow."""
    if not all_flows:
        raise InvalidInput("--runs: some are flows, some runs; render them separately")
    flows, gif = [read_flow(folder) for folder in arguments.runs], out.suffix == ".gif"
    in_3d = all(flow.record["dimension"] == 3 for flow in flows)
    if arguments.family:
        raise InvalidInput("--family: is of runs of optimize_shape.py")
    if (arguments.surface or gif) and not in_3d:
        raise InvalidInput(f"{out}: 2-D flows are drawn as a .png without --surface")
    if gif and (arguments.plane or len(flows) > 1):
        raise InvalidInput(f"{out}: a .gif shows one flow without --plane")
    shown = FRICTION if arguments.surface else PRESSURE
    if gif:
        render_turntable(stored_panel(arguments.runs[0]), out, shown)
    elif in_3d and not arguments.plane:
        render_bodies([[stored_panel(folder)] for folder in arguments.runs], out, shown)
    else:
        draw_flows([flow.picture for flow in flows], out)
    return emit({"out": str(out), "runs": arguments.runs}, arguments.json, f"-> {out}")


def _tracked(records: list[JsonObject], progress: Update) -> Iterator[JsonObject]:
    """Yield the records, and report progress after each."""
    for k, record in enumerate(records):
        yield record
        progress((k + 1) / (len(records) + 1), reynolds_text(record))


def _verified(records: list[JsonObject]) -> list[JsonObject]:
    if len(records) < 2:
        raise InvalidInput("--family: needs two --runs folders or more")
    for record in records:
        at = f"--family: the run at {reynolds_text(record)}"
        if record["cd_verified"] is None:
            raise InvalidInput(f"{at} is not verified")
        if not record["about_lift"] and is_by_chord(record):
            raise InvalidInput(f"{at} is by the chord: its drag is compared with no other body's")
        if not (is_compared(record) or record["about_lift"]):
            body = run_scene(record).family.round_body
            raise InvalidInput(f"{at} has no drag of the {body}, whose flow did not converge")
        if cases := several_cases(record):
            raise InvalidInput(f"{at} is of {cases} cases; runs of one case each are drawn")
    return records


def _evolution(record: JsonObject, out: Path) -> None:
    path = np.array(record["path"])
    captions = [f"{reynolds_text(record)}, step {k}" for k in range(len(path))]
    if name := surrogate_name(record):
        surrogate = load(name)
        if surrogate.scene != run_scene(record):
            raise InvalidInput(f"{name}: has another scene than its run")
        model = run_reference(record).model(surrogate.network)
        reynolds = jnp.asarray(run_reynolds(record))
        drags = jax.vmap(model.loads, in_axes=(0, None))(jnp.asarray(path), reynolds)[:, 0]
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
    plane = "vorticity, pressure and streamlines; 3-D: in the plane of symmetry"
    add("--plane", action="store_true", help=plane)
    return parser
