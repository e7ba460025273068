"""What people look at: loads along a body, files for other programs, pictures."""

import json
import os
import subprocess
import sys
from pathlib import Path

import imageio.v3 as imageio
import jax.numpy as jnp
import numpy as np
import pytest
import render_shapes
from conftest import ARCHED, TINY, without_estimates
from matplotlib.figure import Figure
from pages import surrogate_of
from pictures import LENS, pixels, record_of

from shapeopt import Design, Problem, save_run
from shapeopt.commands import design_sheet
from shapeopt.commands.cli import run
from shapeopt.export.files import write_contour_csv, write_contour_vtp, write_solid_stl
from shapeopt.export.solid import solid
from shapeopt.records import run_body, run_scene
from shapeopt.render.figures import draw_body
from shapeopt.render.mesh import flow_mesh
from shapeopt.render.over_lift import plot_over_lift
from shapeopt.render.pictures import (
    VIEW,
    Panel,
    _stream_levels,
    _streamlines,
    render_evolution,
    render_flows,
)
from shapeopt.render.plots import plot_family, plot_surfaces
from shapeopt.render.polar import plot_polar
from shapeopt.render.sheets import before_and_after, solve_run
from surrogate import Family, Flow, Scene, save
from surrogate.flow.output.meshes import pv

FAMILY = Family()
SIX = {"kind": "Robust", "number_of_cases": 6}  # objective over six cases
ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def flows(tiny_scene):
    """The cylinder and an ellipse, solved at Re 20."""
    flow = Flow(tiny_scene)
    return [flow.solve(FAMILY.ellipse(aspect), 20.0, estimate=False) for aspect in (1.0, 1.5)]


@pytest.fixture(scope="module")
def surfaces(flows):
    return tuple(solution.surface(96) for solution in flows)


def test_surface_pressure_of_the_cylinder(surfaces):
    """Stagnation pressure at the nose, suction at the side, symmetric in the centre line."""
    cp = surfaces[0].cp
    assert 1.0 < cp[0] < 1.7  # above 1 at a finite Reynolds number
    assert -1.2 < cp[len(cp) // 4] < -0.5
    np.testing.assert_allclose(cp[1:], cp[1:][::-1], atol=1e-4)
    assert surfaces[0].station[0] == 0
    assert surfaces[0].station[len(cp) // 2] == pytest.approx(1)


def test_solid_is_watertight_with_outward_normals(tmp_path):
    for parameters in (
        FAMILY.ellipse(1.0),
        LENS,
        np.array([1.2, 0.3, 0.2, 0.1]),
    ):  # the last has a waist
        markers = np.asarray(FAMILY.markers(jnp.asarray(parameters), 200))
        for mesh in (solid(markers), pv.read(write_solid_stl(markers, tmp_path / "b.stl"))):
            assert mesh.n_open_edges == 0
            assert mesh.is_manifold
            corners = mesh.points[mesh.regular_faces].astype(float)
            # signed volume by the divergence theorem: positive only if normals point outward
            volume = np.linalg.det(corners).sum() / 6
            assert volume == pytest.approx(np.pi / 4, rel=1e-3)


def test_contour_files_carry_the_loads(surfaces, tmp_path):
    surface = surfaces[0]
    mesh = pv.read(write_contour_vtp(surface.markers, tmp_path / "c.vtp", surface))
    np.testing.assert_allclose(mesh.points[:, :2], surface.markers, atol=1e-6)
    np.testing.assert_array_equal(mesh["Cp"], surface.cp)
    np.testing.assert_array_equal(mesh["Cf"], surface.cf)
    bare = pv.read(write_contour_vtp(surface.markers, tmp_path / "bare.vtp"))
    assert bare.n_points == len(surface.markers)
    assert not bare.point_data.keys()
    rows = np.loadtxt(
        write_contour_csv(surface.markers, tmp_path / "c.csv"), delimiter=",", skiprows=1
    )
    np.testing.assert_allclose(rows, surface.markers, atol=1e-9)


def test_a_run_is_saved_with_all_its_files(flows, runs):
    names = {path.name for path in (runs / "re20").iterdir()}
    assert names == {"run.json", "contour.csv", "contour.vtp", "body.stl"}
    mesh = pv.read(runs / "re20" / "contour.vtp")
    record = json.loads((runs / "re20" / "run.json").read_text())
    body = np.array(list(record["parameters"].values()))
    expected = Flow(Scene.of(record["scene"])).solve(body, 20.0, estimate=False).surface()
    np.testing.assert_allclose(mesh["Cp"], expected.cp, atol=1e-12)
    np.testing.assert_allclose(mesh["Cf"], expected.cf, atol=1e-12)


def test_stream_function_gives_back_the_velocity(flows):
    """Its differences are the flux through the cells' faces; it is level in the body."""
    lattice, velocity = flows[0].domain.lattice.unfolded, flows[0].velocity
    mesh = flow_mesh(lattice, velocity)
    nx, ny, _ = mesh.dimensions
    stream = mesh["stream function"].reshape(ny, nx).T
    dx, dy = lattice.step
    np.testing.assert_allclose(np.diff(stream, axis=1) / dy, velocity[0, 1:-1, 2:-1], atol=1e-8)
    np.testing.assert_allclose(-np.diff(stream, axis=0) / dx, velocity[1, 2:-1, 1:-1], atol=0.01)
    inside = np.linalg.norm(mesh.points, axis=1) < 0.2
    assert np.abs(mesh["stream function"][inside]).max() < 0.02


def test_flow_pictures_show_their_bodies(flows, tmp_path):
    sheets = []
    for k, solution in enumerate(flows):
        panel = Panel(solution, "Re 20", "small print")
        sheets.append(pixels(render_flows([[panel, panel]], tmp_path / f"{k}.png")))
    (size, first), (other_size, second) = sheets
    assert size == other_size
    assert size[0] > 1200
    assert np.any(first != second, axis=1).mean() > 0.02
    rows = pixels(render_flows([[panel], [panel]], tmp_path / "rows.png"))[0]
    assert rows[0] < size[0]
    assert rows[1] > 1.5 * size[1]


def test_flattened_bodies_are_drawn_from_above_too():
    axes = Figure().subplots(1, 2)
    for axis, flatness in zip(axes, (1.0, 2.0), strict=True):
        draw_body(
            axis, np.asarray(FAMILY.outline(FAMILY.ellipse(2.0), 100)), flatness, "k", (3.0, 1.0)
        )
    side, above = axes[1].patches[0].get_path().vertices, axes[1].lines[0].get_xydata()
    assert not axes[0].lines
    np.testing.assert_allclose(above.mean(axis=0), [3.0, 1.0], atol=0.02)
    assert np.ptp(above[:, 1]) == pytest.approx(2 * np.ptp(side[:, 1]))


def test_plots_of_bodies_differ_with_the_bodies(tiny_scene, surfaces, tmp_path):
    records = [record_of(tiny_scene, 5.0), record_of(tiny_scene, 20.0, FAMILY.ellipse(1.5))]
    family = pixels(plot_family(records, tmp_path / "family.png"))
    other = pixels(plot_family([records[0], record_of(tiny_scene)], tmp_path / "other.png"))
    assert family[0] == other[0]
    assert np.any(family[1] != other[1], axis=1).mean() > 0.001
    loads = pixels(plot_surfaces([(records[0], surfaces)], tmp_path / "loads.png"))
    swapped = surfaces[1]._replace(cp=surfaces[0].cp)
    again = pixels(plot_surfaces([(records[0], (surfaces[0], swapped))], tmp_path / "again.png"))
    assert np.any(loads[1] != again[1], axis=1).mean() > 0.001


def test_evolution_has_a_frame_for_every_step(tmp_path):
    bodies = np.array([FAMILY.ellipse(1.0), LENS, FAMILY.ellipse(3.0)])
    gif = render_evolution(FAMILY, bodies, ["start", "then", "end"], tmp_path / "evolution.gif")
    frames = imageio.imread(gif)
    distinct = {frame.tobytes() for frame in frames}
    assert len(distinct) == 3
    assert min(frame.std() for frame in frames) > 10


SILENT = """
import sys
import numpy as np
from shapeopt.render.pictures import Panel, render_evolution, render_flows
from surrogate import Family, Fidelity, Flow, Scene

family = Family()
flow = Flow(Scene(fidelity=Fidelity("tiny", 8, 2.5, 4, 4, 5)))
panel = Panel(flow.solve(family.ellipse(1.0), 20.0, estimate=False), "Re 20")
render_flows([[panel, panel]], sys.argv[1] + "/flows.png")
bodies = np.array([family.ellipse(1.0), family.ellipse(2.0)])
render_evolution(family, bodies, ["a", "b"], sys.argv[1] + "/e.gif")
"""


@pytest.mark.slow
def test_rendering_is_silent_without_a_display(tmp_path):
    """As a user runs it: another process, no display; VTK says nothing."""
    done = subprocess.run(
        [sys.executable, "-c", SILENT, str(tmp_path)],
        capture_output=True,
        text=True,
        check=False,
        cwd=ROOT,
        env={k: v for k, v in os.environ.items() if k != "DISPLAY"} | {"PYTHONPATH": str(ROOT)},
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert (tmp_path / "e.gif").read_bytes().startswith(b"GIF8")
    assert pixels(tmp_path / "flows.png")[0][0] > 1200


@pytest.fixture(scope="module")
def runs(tiny_scene, tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    for reynolds in (5.0, 20.0):
        problem, body = Problem(tiny_scene, reynolds, max_length=1.5), FAMILY.ellipse(2.0)
        path = np.stack([FAMILY.ellipse(1.0), body])
        loads, cost = (1.5, 0.0, 0.0), (0, 2, 100, 1.0)
        design = Design(problem, body, 1.5, loads, 1e-4, 2.0, path, *cost, on_flow=True)
        with without_estimates():
            save_run(folder / f"re{reynolds:g}", design)
    others = {
        "bare": {"cd_verified": None},
        "glide": {"objective": {"kind": "Glide", "number_of_cases": 1}},
        "chord": {"reference": "chord", "chord_reynolds": 30.0},
        "cases": {"objective": SIX},
        "unsteady": {"cd_start": None},
    }
    for name, entries in others.items():
        (folder / name).mkdir()
        (folder / name / "run.json").write_text(json.dumps(record_of(tiny_scene) | entries))
    return folder


def test_the_search_of_a_run_without_a_named_surrogate_is_drawn(tiny_scene, tmp_path):
    """Such runs are of ``save_run`` without a name for the surrogate."""
    (tmp_path / "run.json").write_text(json.dumps(record_of(tiny_scene) | {"surrogate": "unnamed"}))
    gif = tmp_path / "search.gif"
    assert run(render_shapes.main, ["--runs", str(tmp_path), "--out", str(gif)]) == 0
    assert gif.read_bytes().startswith(b"GIF8")


@pytest.mark.parametrize("kind", [[], ["--surface"], ["--family"]])
def test_sheets_by_the_command(runs, kind, tmp_path, capsys):
    folders = [str(runs / "re5"), str(runs / "re20")]
    arguments = ["--runs", *folders, *kind, "--out", str(tmp_path / "sheet.png"), "--json"]
    assert run(render_shapes.main, arguments) == 0
    assert json.loads(capsys.readouterr().out)["runs"] == folders
    pixels(tmp_path / "sheet.png")


@pytest.mark.parametrize(
    ("mistake", "answer"),
    {
        "--runs {runs}/re5 --family --out {out}/x.png": "needs two --runs folders",
        "--runs {runs}/re5 {runs}/bare --family --out {out}/x.png": "Re 20 is not verified",
        "--runs {runs}/re5 {runs}/re20 --family --surface --out {out}/x.png": "not allowed with",
        "--runs {runs}/re5 {runs}/glide --family --out {out}/x.png": "are of AtReynolds, Glide",
        "--runs {runs}/re5 {runs}/chord --family --out {out}/x.png": "some runs are by the chord",
        "--runs {runs}/chord {runs}/chord --family --out {out}/x.png": "Re 30 is by the chord",
        "--runs {runs}/cases {runs}/cases --family --out {out}/x.png": "Re 20 is of 6 cases",
        "--runs {runs}/re5 {runs}/unsteady --family --out {out}/x.png": "no drag of the cylinder",
        "--runs {runs}/re5 --surface --out {out}/x.gif": "need a .png",
        "--runs {runs}/re5 {runs}/re20 --out {out}/x.gif": "a .gif shows one run",
    }.items(),
)
def test_mistakes_with_sheets_get_one_clear_line(runs, mistake, answer, tmp_path, capsys):
    assert run(render_shapes.main, mistake.format(runs=runs, out=tmp_path).split()) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert len(captured.err.strip().splitlines()) == 1, captured.err
    assert answer in captured.err
    assert not list(tmp_path.iterdir())


def test_captions_say_what_is_known(tiny_scene):
    before, after = before_and_after(record_of(tiny_scene))
    assert before.title.startswith("Re 20 ")
    assert f"Cd {after.solution.drag:.4f}" in after.title
    assert after.note == "found by the flow's adjoint, verified by the flow"
    unverified = record_of(tiny_scene) | {"cd_verified": None, "surrogate": "out/full/sip"}
    unverified["until"] = "surrogate"
    assert before_and_after(unverified)[1].note == "found by the surrogate sip, not verified"
    unnamed = record_of(tiny_scene) | {"surrogate": "unnamed", "until": "surrogate"}
    assert before_and_after(unnamed)[1].note.startswith("found by a surrogate, ")
    assert after.title.endswith(" %")
    several = before_and_after(record_of(tiny_scene) | {"objective": SIX})[1].title
    assert several.startswith("Re 20, nominal of 6 cases ")
    assert "%" not in several  # the drags of one case are not the objective


def test_where_the_cylinder_is_not_solved_an_ellipse_is_drawn_beside_the_optimum(tiny_scene):
    record = record_of(tiny_scene) | {"cd_start": None}  # as verification leaves it
    before, after = before_and_after(record)
    assert f"ellipse of aspect {record['parameters']['aspect']:.3g} " in before.title
    assert "%" not in after.title


def lifting(parameters, reynolds=20.0):
    """The record of a run about lift that found ``parameters``, on the small grid."""
    scene = Scene(family=ARCHED, fidelity=TINY)
    return record_of(scene, reynolds, np.array(parameters)) | {"about_lift": True}


def test_captions_of_lifting_bodies_say_lift_and_glide(monkeypatch):
    """The drag over the cylinder's is said only where neither objective nor bounds are on lift.

    Elsewhere the ellipse of the optimum's aspect is drawn beside it.
    """
    flows, titles = solve_run(lifting([2.0, 0.1, 10.0])), {}
    monkeypatch.setattr("shapeopt.render.sheets.solve_run", lambda record: flows)
    for name, about_lift in {"drag": False, "lift": True}.items():
        record = lifting([2.0, 0.1, 10.0]) | {"about_lift": about_lift}
        before, after = before_and_after(record)
        flow, titles[name] = flows[1], after.title
        assert "Cl 0.0000    Cl/Cd 0.000" in before.title
        assert ("cylinder" if name == "drag" else "ellipse of aspect 2 ") in before.title
        assert f"Cl {flow.lift:.4f}    Cl/Cd {flow.lift / flow.drag:.3f}" in after.title
    objective = {"kind": "MultiPoint", "number_of_cases": 3, "lifts": [0.0, 0.1, 0.2]}
    several = lifting([2.0, 0.1, 10.0]) | {"objective": objective}
    before, after = before_and_after(several)
    assert after.title.startswith("Re 20, first of 3 lifts")
    assert "ellipse of aspect 2 " in before.title
    robust = {"kind": "Robust", "number_of_cases": 8, "glide": True}
    robust = lifting([2.0, 0.1, 10.0]) | {"objective": robust, "glide": 0.75}
    assert before_and_after(robust)[1].title.endswith("Cl/Cd of the cases 0.750")
    assert titles.pop("drag").endswith(" %")
    assert not any("%" in title for title in titles.values())


def test_families_of_lifting_bodies_are_drawn_with_their_glide_ratios(tmp_path):
    """Not with their drag over the cylinder's."""
    records = [lifting([2.0, 0.1, 10.0], re) | {"cl_verified": 0.4} for re in (10.0, 20.0)]
    _, first = pixels(plot_family(records, tmp_path / "first.png"))
    other = [record | {"cd_start": 9.0} for record in records]
    assert np.array_equal(first, pixels(plot_family(other, tmp_path / "same.png"))[1])


def test_families_at_fixed_chord_are_drawn_in_chords_beside_a_circle_of_that_chord(
    tmp_path, monkeypatch
):
    drawn = []
    monkeypatch.setattr(
        "shapeopt.render.plots.save_figure", lambda f, path: drawn.append(f) or path
    )
    records = [lifting([aspect, 0.1, 10.0]) | {"cl_verified": 0.4} for aspect in (1.5, 4.0)]
    for record, reynolds in zip(records, (20.0, 40.0), strict=True):
        chord = float(run_scene(record).family.body_class.length(run_body(record)))
        record |= {"reference": "chord", "chord": chord, "chord_reynolds": reynolds}
    plot_family(records, tmp_path / "family.png")
    *bodies, below = drawn[0].axes
    for axis, reynolds in zip(bodies, (20, 40), strict=True):
        outline = axis.patches[0].get_path().vertices
        assert np.ptp(outline[:, 0]) == pytest.approx(1.0, abs=0.03)  # of the turned body
        assert np.ptp(axis.lines[0].get_xdata()) == pytest.approx(1.0, abs=1e-3)
        assert axis.get_title() == f"chord Re {reynolds}"
    assert below.get_xlabel().startswith("chord Reynolds number")


def test_streamlines_at_incidence_follow_the_flow():
    """None is cut off beside the body's plane: each ends at the picture's edge, or is closed."""
    _, after = before_and_after(lifting([2.0, 0.1, 20.0], 40.0))
    flow = after.solution
    mesh = flow_mesh(flow.domain.lattice.unfolded, flow.velocity, refined=3)
    outer, *eddies = _streamlines(mesh, flow.markers)
    of_body, _ = _stream_levels(mesh, flow.markers)
    levels = (outer["stream function"] - of_body) / 0.09 - 0.5
    np.testing.assert_allclose(levels, np.round(levels), atol=0.05)
    field = mesh.clip_box((*VIEW, -1, 1), invert=False).bounds
    for line in outer.split_bodies():
        left, right, low, high = np.abs(np.subtract(line.bounds, field))[:4] < 0.05
        assert left or low or high
        assert right or low or high
    assert eddies
    for eddy in eddies:
        assert eddy.bounds[0] > float(flow.markers[:, 0].min()) - 0.05


def test_the_plot_over_lift_draws_its_bodies(tmp_path):
    """Drawn as given: other bodies, another picture."""
    family = Family(aspect=(1, 4), gamma2=(-0.3, 0.3), incidence=(-4, 20))
    bodies = np.array([[2, 0, 0], [3, 0.3, 0], [2, 0.1, 9], [4, 0.2, 12]])
    rows = [
        {"reynolds": 20.0, "cd": 0.8, "cl": cl, "glide": cl / 0.8, "parameters": family.named(body)}
        for cl, body in zip((0.0, 0.001, 0.2, 0.4), bodies, strict=True)
    ]
    turned = [*rows[:2], rows[2] | {"parameters": rows[1]["parameters"]}]
    (size, first), (other_size, second) = (
        pixels(plot_over_lift(family, drawn, rows[3], tmp_path / "over_lift.png"))
        for drawn in (rows[:3], turned)
    )
    assert size == other_size
    assert 0.0005 < np.any(first != second, axis=1).mean() < 0.1
    _, third = pixels(plot_over_lift(family, rows, None, tmp_path / "over_lift.png"))
    assert np.any(third != first)


@pytest.mark.slow
def test_bodies_over_lift_by_the_command(tmp_path, capsys):
    """Each is within its bound and has no less drag than one with less lift."""
    net = surrogate_of("with lift")
    save(tmp_path / "net", net)
    arguments = ["--surrogate", str(tmp_path / "net"), "--reynolds", "20", "--lifts", "0:0.1:3"]
    out = tmp_path / "over_lift.png"
    assert run(design_sheet.main, [*arguments, "--out", str(out), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    rows, best = result["designs"], result["best_glide"]
    assert [row["lift"] for row in rows] == [0.0, 0.05, 0.1]
    assert all(row["cl"] >= row["lift"] - 1e-6 for row in rows)
    drags = [row["cd"] for row in rows]
    assert drags == sorted(drags)
    for row in (*rows, best):
        loads = net.loads(row["parameters"], 20.0)
        np.testing.assert_allclose([row["cd"], row["cl"], row["cm"]], loads, rtol=1e-9)
        assert best["glide"] >= row["glide"] - 1e-9
    pixels(out)


@pytest.mark.parametrize(
    ("mistake", "words"),
    [
        ("--reynolds 20 --max-length 2 --memory m.json", "--memory: goes with --until flow"),
        ("--reynolds 20 --lifts 0:0.6:7", "lift: the bodies of this scene have no lift"),
        ("--reynolds 20,30 --lifts 0,0.1", "--lifts: goes with one Reynolds number"),
        ("--reynolds 20 --lifts 0,x", "--lifts '0,x': one number, or several with commas"),
        ("--reynolds 20", "--max-length: give it, as 1.2,1.5,2; or --lifts"),
    ],
)
def test_mistakes_with_bodies_over_lift_get_one_clear_line(mistake, words, tmp_path, capsys):
    assert run(design_sheet.main, [*mistake.split(), "--out", str(tmp_path / "x.png")]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    (line,) = captured.err.strip().splitlines()
    assert words in line
    assert not list(tmp_path.iterdir())


def test_polars_have_bars_where_errors_have_bounds(tmp_path):
    def drawn(*bounds):
        names = ("estimated_error", "estimated_lift_error", "estimated_moment_error")
        known = dict(zip(names, bounds, strict=True))
        at = {"reynolds": 10.0, "chord_reynolds": 20.0, "reference": "diameter"} | known
        loads = [
            {"incidence": a, "cd": 2 + a / 9, "cl": a / 9, "cm": a / 30} for a in (0.0, 4.0, 8.0)
        ]
        return pixels(plot_polar([at | row for row in loads], "polar", tmp_path / "polar.png"))[1]

    plain = drawn(None, None, None)
    for one in ((0.2, None, None), (None, 0.3, None), (None, None, 0.1)):
        assert np.any(drawn(*one) != plain)
