"""Fields, files, pictures and forces of a solved flow, in Python and by the commands."""

import json
import pickle
import re
import shutil

import imageio.v3 as imageio
import jax.numpy as jnp
import numpy as np
import pytest
import render_shapes
import solve_drag
from conftest import ROUGH_3D
from matplotlib.figure import Figure
from pictures import LENS, pixels
from scipy.interpolate import RegularGridInterpolator

from shapeopt.commands import solve_drag as command
from shapeopt.commands.arguments import body_settings
from shapeopt.commands.cli import run
from surrogate import Family, Flow, InvalidInput, Scene, contour_shape, family_shape, load, naca4
from surrogate.flow.grid.lattice import Lattice
from surrogate.flow.grid.wall_2d import outward
from surrogate.flow.output.folder import read_flow, read_surface
from surrogate.flow.output.meshes import pv
from surrogate.flow.output.picture import _draw_eddies, _Plane
from surrogate.flow.surface.pressure import head_loss

FILES = {"flow.json", "contour.csv", "contour.vtp", "fields.npz", "fields.vti", "flow.png"}


@pytest.fixture(scope="module")
def cylinder():
    scene = Scene(fidelity="draft")
    return Flow(scene).solve(family_shape({"aspect": 1.0}), 20.0, estimate=False)


@pytest.fixture(scope="module")
def written(cylinder, tmp_path_factory):
    """The folder of a flow."""
    return cylinder.write(tmp_path_factory.mktemp("written") / "flow")


@pytest.fixture(scope="module")
def ellipsoid():
    body = family_shape({"aspect": 1.6, "flatness": 1.4}, dimension=3)
    return Flow(Scene(dimension=3, fidelity=ROUGH_3D)).solve(body, 20.0, estimate=False)


@pytest.fixture(scope="module")
def turned(tmp_path_factory):
    """The folder of a 3-D flow at incidence."""
    body = family_shape({"aspect": 1.8, "incidence": 40.0}, dimension=3)
    solution = Flow(Scene(dimension=3, fidelity=ROUGH_3D)).solve(body, 40.0, estimate=False)
    return solution.write(tmp_path_factory.mktemp("turned") / "flow")


def test_divergence_of_the_faces_velocity_vanishes_near_the_body(cylinder):
    """Farther off it is that of the far field's response, interpolated from coarse grids."""
    u, v = cylinder.velocity
    dx, dy = cylinder.domain.lattice.step
    divergence = np.diff(u, axis=0)[1:-1, 2:-1] / dx + np.diff(v, axis=1)[2:-1, 1:-1] / dy
    near = np.ix_(np.abs(cylinder.x[1:-1]) < 2.5, np.abs(cylinder.y[1:-1]) < 2)
    assert np.abs(divergence[near]).max() < 1e-3


def test_fields_are_symmetric_and_rest_on_the_body(cylinder):
    s = cylinder
    assert s.u.shape == s.v.shape == s.p.shape == s.vorticity.shape == (len(s.x), len(s.y))
    np.testing.assert_allclose(s.u, s.u[:, ::-1], atol=1e-9)
    np.testing.assert_allclose(s.v, -s.v[:, ::-1], atol=1e-9)
    np.testing.assert_allclose(s.vorticity, -s.vorticity[:, ::-1], atol=1e-8)
    upper = np.argmin(abs(s.x)), np.argmin(abs(s.y - 0.6))
    assert s.vorticity[upper] < -1  # clockwise above the body
    dx, dy = s.domain.lattice.step
    assert s.fields.inside.sum() * dx * dy == pytest.approx(np.pi / 4, rel=0.05)
    assert np.abs(s.u[s.fields.inside]).max() < 0.5
    assert s.u[0].mean() == pytest.approx(1.0, abs=0.08)
    with pytest.raises(AttributeError, match="2-D flow has none"):
        _ = s.w
    with pytest.raises(InvalidInput, match="surface is for 2-D ones"):
        s.skin_loads(np.zeros((1, 3)), np.ones((1, 3)))


def test_pressure_agrees_with_the_surface_and_with_bernoulli(cylinder):
    s, surface = cylinder, cylinder.surface()
    found = RegularGridInterpolator((s.x, s.y), 2 * s.p, method="cubic")
    distance = 1.5 / 10
    outward = surface.markers / np.linalg.norm(surface.markers, axis=1, keepdims=True)
    near = found(surface.markers + distance * outward)
    assert np.abs(near - surface.cp).max() < 0.35 * np.ptp(surface.cp)
    assert np.corrcoef(near, surface.cp)[0, 1] > 0.98
    far = np.array([s.x[-1] - 1.5, 3.0])  # where the pressure is that of the Oseenlet
    expected = -s.drag * far[0] / (2 * np.pi * far @ far)
    assert found(far[None])[0] == pytest.approx(expected, abs=0.03)
    ahead = np.array([[-2.0, 0.0]])  # upstream the total head is the stream's
    speed = RegularGridInterpolator((s.x, s.y), s.u)(ahead)
    assert found(ahead)[0] == pytest.approx(1 - speed[0] ** 2, abs=0.01)


def test_surface_loads_add_up_to_the_drag():
    """Integrated pressure and friction against the drag of the zeroth mode."""
    solution = Flow(Scene()).solve(family_shape(Family().named(LENS)), 20.0, estimate=False)
    surface = solution.surface()
    normal = np.asarray(outward(jnp.asarray(surface.markers)))
    loads = -surface.cp * normal[:, 0] + surface.cf * normal[:, 1]
    assert 2 * np.pi * loads.mean() == pytest.approx(solution.drag, rel=0.05)


def test_few_points_of_a_surface_are_those_of_many():
    """Of a section, whose contour is smoothed the more the fewer markers it has."""
    section = contour_shape(naca4("0015"))
    found = Flow(Scene(fidelity="draft")).solve(section, 20.0, estimate=False)
    few, many = (found.surface(points) for points in (16, 4096))
    for one, other in zip(few[:3], many[:3], strict=True):
        np.testing.assert_allclose(one, other[::256], atol=0.01 * np.ptp(other))


def test_pressure_falls_along_a_tunnel_by_the_drag():
    """In slow flow half of the fall is upstream: Cp ahead and behind add up to -Cd / height."""
    flow = Flow(Scene(stream="tunnel:8", fidelity="draft"))
    found = flow.solve(family_shape({"aspect": 1.0}), 0.01, estimate=False)
    cp = found.surface(100).cp
    assert 8 * (cp[0] + cp[50]) / found.drag == pytest.approx(-1, abs=0.03)
    assert (cp[0] - cp[50]) / found.drag > 0.5


@pytest.mark.parametrize("reynolds", [1e-3, 0.1, 1.0])
def test_the_mean_head_upstream_in_a_tunnel_is_the_streams(reynolds, generator):
    """Of any forces: its equation, averaged from wall to wall, has no source there."""
    height = 4.0
    lattice = Lattice((64, 32), (0.125, 0.125), 32, periodic=True)
    forces = np.zeros((2, *lattice.shape))
    forces[:, 34:42, 12:22] = generator.normal(1.0, 1.0, (2, 8, 10))
    rows = (np.arange(32) + 0.51) * height / 32 - height / 2
    losses = [head_loss(lattice, forces, (-2.03, y), reynolds, height) for y in rows]
    assert abs(np.mean(losses)) < 2e-3 * np.ptp(losses)


def test_a_flow_is_written_whole_and_read_back(cylinder, tmp_path):
    assert cylinder.write(tmp_path / "flow") == tmp_path / "flow"
    assert {path.name for path in (tmp_path / "flow").iterdir()} == FILES
    mesh = pv.read(tmp_path / "flow" / "fields.vti")
    i, j = 30, 12
    here = mesh.points.reshape(len(cylinder.y), len(cylinder.x), 3)[j, i]
    np.testing.assert_allclose(here, [cylinder.x[i], cylinder.y[j], 0], atol=1e-6)
    for name in ("u", "v", "p", "vorticity"):
        values = mesh[name].reshape(len(cylinder.y), len(cylinder.x)).T
        np.testing.assert_allclose(values, getattr(cylinder, name), atol=1e-12)
    stored = read_flow(tmp_path / "flow")
    np.testing.assert_array_equal(stored.fields.p, cylinder.p)
    np.testing.assert_allclose(stored.contour[:, 2], cylinder.surface().cp, atol=1e-8)
    pixels(tmp_path / "flow" / "flow.png")
    assert cylinder.mesh() == mesh
    np.testing.assert_allclose(cylinder.surface_mesh()["Cf"], stored.contour[:, 3], atol=1e-8)
    cylinder.write(tmp_path / "flow")  # its own folder may be written again
    fields = tmp_path / "flow" / "fields.npz"
    fields.write_bytes(fields.read_bytes()[: fields.stat().st_size // 2])
    with pytest.raises(InvalidInput, match="flow: cannot be read"):
        read_flow(tmp_path / "flow")


def change_record(folder, **values):
    record = json.loads((folder / "flow.json").read_text())
    (folder / "flow.json").write_text(json.dumps(record | values))


def change_fields(folder, **arrays):
    with np.load(folder / "fields.npz") as file:
        np.savez(folder / "fields.npz", **(dict(file) | arrays))


DAMAGES = {
    "no contour": lambda folder: (folder / "contour.csv").write_text("x,y,Cp,Cf\n"),
    "one point": lambda folder: (folder / "contour.csv").write_text("x,y,Cp,Cf\n1,2,3,4\n"),
    "no Cd": lambda folder: change_record(folder, cd=None),
    "Cl that is none": lambda folder: change_record(folder, cl="a"),
    "incidence that is none": lambda folder: change_record(folder, incidence="x"),
    "another grid": lambda folder: change_fields(folder, p=np.zeros((3, 3))),
    "no cells": lambda folder: change_fields(folder, x=np.zeros(0)),
}


@pytest.mark.parametrize("damage", DAMAGES.values(), ids=list(DAMAGES))
def test_a_damaged_folder_is_refused(written, tmp_path, damage):
    folder = tmp_path / "flow"
    shutil.copytree(written, folder)
    damage(folder)
    for digests in ({}, {"files_sha256": {}}):  # as of this version and of earlier ones
        change_record(folder, **digests)
        with pytest.raises(InvalidInput, match="flow: cannot be read"):
            read_flow(folder)


def test_files_of_another_flow_are_refused(written, tmp_path):
    folder = tmp_path / "flow"
    shutil.copytree(written, folder)
    with np.load(folder / "fields.npz") as file:
        change_fields(folder, p=file["p"] + 1)
    with pytest.raises(InvalidInput, match=r"fields\.npz is not what was written with flow\.json"):
        read_flow(folder)
    (folder / "contour.vtp").write_bytes(b"another body")
    with pytest.raises(InvalidInput, match=r"contour\.vtp is not what was written"):
        read_surface(folder)


def test_a_foreign_folder_is_refused_and_kept(cylinder, tmp_path):
    (tmp_path / "thesis.txt").write_text("mine")
    with pytest.raises(InvalidInput, match="choose another folder"):
        cylinder.write(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.txt"]


@pytest.mark.slow
def test_a_3d_flow_is_written_and_read_back(ellipsoid, tmp_path):
    s = ellipsoid
    assert s.w.shape == (len(s.x), len(s.y), len(s.z))
    assert s.vorticity.shape == (3, *s.w.shape)
    volume = s.fields.inside.sum() * s.domain.lattice.step[0] ** 3
    assert volume == pytest.approx(np.pi / 6, rel=0.1)
    s.write(tmp_path / "flow")
    mesh = pv.read(tmp_path / "flow" / "fields.vti")
    assert mesh.dimensions == s.w.shape
    np.testing.assert_allclose(mesh["w"].reshape(s.w.shape, order="F"), s.w, atol=1e-6)
    skin = pv.read(tmp_path / "flow" / "contour.vtp")
    side = read_flow(tmp_path / "flow").contour
    nose, tail = np.argmin(side[:, 0]), np.argmax(side[:, 0])
    assert side[nose, 2] == pytest.approx(skin["Cp"].max(), rel=0.02)
    assert side[nose, 2] > 1 > 0 > side[tail, 2]
    pixels(tmp_path / "flow" / "flow.png")


@pytest.mark.slow
def test_a_3d_flow_at_incidence_is_written_with_its_body_nose_up(turned):
    stored = read_flow(turned)
    x, z = stored.contour[:, :2].T
    nose = np.argmax(np.where(x < 0, np.hypot(x, z), 0.0))  # the farthest point ahead
    assert np.rad2deg(np.arctan2(z[nose], -x[nose])) == pytest.approx(40, abs=1)
    assert stored.picture.title.startswith("Re 40    incidence 40\N{DEGREE SIGN}    Cd ")
    ahead = read_surface(turned)
    front = ahead["Cp"][ahead.points @ [-1, 0, -0.5] > 0.4]  # below the nose, to the stream
    assert front.mean() > 0.3 > 0 > ahead["Cp"][ahead.points @ [1, 0, 0.5] > 0.4].mean()
    pixels(turned / "flow.png")


@pytest.mark.slow
def test_pictures_of_a_3d_flow_at_incidence(turned, tmp_path, monkeypatch):
    """The body by pressure and by friction, its plane of symmetry, and turned around."""
    monkeypatch.setattr("shapeopt.render.bodies_3d.TURNS", 3)
    shown = []
    for words in ([], ["--surface"], ["--plane"]):
        out = tmp_path / "picture.png"
        assert run(render_shapes.main, ["--runs", str(turned), *words, "--out", str(out)]) == 0
        shown.append(pixels(out))
    assert np.any(shown[0][1] != shown[1][1], axis=1).mean() > 0.01
    assert shown[2][0] != shown[0][0]
    out = tmp_path / "turning.gif"
    assert run(render_shapes.main, ["--runs", str(turned), "--out", str(out)]) == 0
    frames = imageio.imread(out)
    assert len(frames) == 3
    assert min(np.mean(frames[0] != frame) for frame in frames[1:]) > 0.02
    (turned / "contour.vtp").rename(tmp_path / "away.vtp")
    with pytest.raises(InvalidInput, match="cannot be read"):
        read_surface(turned)
    (tmp_path / "away.vtp").rename(turned / "contour.vtp")


def test_both_eddies_of_a_wake_above_the_axis_are_drawn():
    """Reversed flow between two vortices at y = 0.5 and 1.1, as behind a body at incidence."""
    x, y = np.linspace(-1, 3, 81), np.linspace(-1.4, 2.4, 77)
    at = np.meshgrid(x, y, indexing="ij")
    u, v, spin = np.full_like(at[0], 0.02), np.zeros_like(at[0]), np.zeros_like(at[0])
    for centre, turning in ((0.5, 1.0), (1.1, -1.0)):
        east, north = at[0] - 1.2, at[1] - centre
        near = turning * np.exp(-(east**2 + north**2) / 0.1)
        u, v, spin = u - north * near, v + east * near, spin + near
    body, figure = 0.1 * np.array([[1, 0], [0, 1], [-1, 0], [0, -1]]), Figure()
    axis = figure.subplots()
    _draw_eddies(axis, _Plane(x, y, u, v, spin, spin), body, (-1, 3, -1.4, 2.4))
    points = np.concatenate([p for line in axis.collections for p in line.get_segments()])
    heights = points[:, 1]
    assert heights.min() < 0.5 < 0.75 < heights.max()
    assert np.mean(heights < 0.8) > 0.2
    assert np.mean(heights > 0.8) > 0.2


def test_an_eddy_in_two_strips_is_drawn():
    """The middle one of their cells lies between them, in no reversed flow."""
    x, y = np.linspace(-1, 3, 81), np.linspace(-1.4, 1.4, 57)
    u, still = np.full((81, 57), 0.5), np.zeros((81, 57))
    u[[50, 53], 10:20] = -0.1
    axis = Figure().subplots()
    body = 0.1 * np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])
    _draw_eddies(axis, _Plane(x, y, u, still, np.ones_like(u), still), body, (-1, 3, -1.4, 1.4))
    assert axis.collections


def test_forces_in_newtons(cylinder):
    air = {"speed": 0.3, "diameter": 1e-3, "density": 1.2}
    forces = cylinder.forces(**air, viscosity=1.5e-5)
    assert forces.drag == pytest.approx(cylinder.drag * 0.5 * 1.2 * 0.3**2 * 1e-3)
    with pytest.raises(InvalidInput, match="U D / nu = 10"):
        cylinder.forces(**air, viscosity=3e-5)
    for wrong in (0.0, 1e200, 1e-200):
        words = re.escape(f"density {wrong:g}: from 1e-12 to 1e+12")
        with pytest.raises(InvalidInput, match=words):
            cylinder.forces(**air | {"density": wrong})


def test_forces_in_newtons_by_a_surrogate():
    air, net = {"speed": 0.3, "diameter": 1e-3, "density": 1.2}, load("pretrained:particle")
    body = {"aspect": 2.0, "incidence": 30.0}
    loads, forces = net.loads(body, 20.0), net.forces(body, 20.0, **air, viscosity=1.5e-5)
    unit = 0.5 * 1.2 * 0.3**2 * np.pi / 4 * 1e-6
    found = np.array([forces.drag, forces.lift, forces.moment / 1e-3])
    np.testing.assert_allclose(found, unit * loads)
    assert forces.drag_pressure is forces.drag_friction is None
    with pytest.raises(InvalidInput, match="U D / nu = 10"):
        net.forces(body, 20.0, **air, viscosity=3e-5)


def test_a_solution_is_pickled_with_its_body(cylinder):
    copy = pickle.loads(pickle.dumps(cylinder))
    np.testing.assert_array_equal(copy.surface().cp, cylinder.surface().cp)
    assert copy.shape.chord == cylinder.shape.chord


@pytest.mark.parametrize("stream", ["unbounded", "tunnel:8"])
def test_a_section_at_incidence_is_written(stream, tmp_path):
    wing = contour_shape(naca4("2418"), 10.0)
    solution = Flow(Scene(stream=stream, fidelity="draft")).solve(wing, 20.0, estimate=False)
    solution.write(tmp_path / "wing")
    pixels(tmp_path / "wing" / "flow.png")


def test_flows_by_the_commands(tmp_path, capsys, no_estimates):
    out, sheet = tmp_path / "flows", tmp_path / "sheet.png"
    words = ["--aspect", "1.5", "--fidelity", "draft", "--reynolds", "5,20", "--json"]
    words += ["--out", str(out), "--fluid", "0.3,0.001,1.2"]
    assert run(solve_drag.main, words) == 0
    rows = json.loads(capsys.readouterr().out.splitlines()[-1])["results"]
    assert [row["out"] for row in rows] == [str(out / "re5"), str(out / "re20")]
    for row in rows:
        assert row["forces_N"]["drag"] == pytest.approx(row["cd"] * 0.5 * 1.2 * 0.09 * 1e-3)
    assert {path.name for path in (out / "re20").iterdir()} == FILES
    record = json.loads((out / "re20" / "flow.json").read_text())
    assert record["settings"]["body"]["parameters"]["aspect"] == 1.5
    assert record["forces_N"] == rows[1]["forces_N"]
    assert run(solve_drag.main, words) == 0  # the same flows again
    other = ["2" if word == "1.5" else word for word in words]
    assert run(solve_drag.main, other) == 2
    said = "holds another flow (body parameters aspect 1.5, not 2); overwrite (--overwrite)"
    assert said in capsys.readouterr().err
    assert run(solve_drag.main, [*words, "--dimension", "3"]) == 2
    assert "holds another flow (dimension 2, not 3)" in capsys.readouterr().err
    assert run(solve_drag.main, [*other, "--overwrite"]) == 0
    assert json.loads((out / "re20" / "flow.json").read_text())["parameters"]["aspect"] == 2
    assert run(render_shapes.main, ["--runs", str(out), "--out", str(sheet)]) == 2
    assert "holds several flows; give them" in capsys.readouterr().err
    (out / "run.json").write_text("{}")  # of a run, beside which flows may lie
    assert run(render_shapes.main, ["--runs", str(out), "--out", str(sheet)]) == 2
    assert "run.json is damaged" in capsys.readouterr().err
    runs = [str(out / "re5"), str(out / "re20")]
    assert run(render_shapes.main, ["--runs", *runs, "--out", str(sheet)]) == 0
    pixels(sheet)
    for words in (["--family"], ["--surface"]):
        assert run(render_shapes.main, ["--runs", *runs, *words, "--out", str(sheet)]) == 2
    gif = ["--runs", runs[0], "--out", str(tmp_path / "x.gif")]
    assert run(render_shapes.main, gif) == 2
    assert "2-D flows are drawn as a .png" in capsys.readouterr().err
    assert rows[0]["viscosity"] == pytest.approx(0.3 * 1e-3 / 5)
    wrong = ["--aspect", "1", "--reynolds", "5", "--fluid", "0.3,0.001,1.2,1.5e-5"]
    assert run(solve_drag.main, wrong) == 2
    assert "U D / nu = 20" in capsys.readouterr().err


def test_a_contour_is_known_again_by_its_points(tmp_path):
    file = tmp_path / "c.csv"
    arguments = command._parser().parse_args(["--contour", str(file), "--reynolds", "5"])
    found = []
    for aspect in (1.0, 1.0, 2.0):
        np.savetxt(file, family_shape({"aspect": aspect}).draw(60), delimiter=",")
        found.append(body_settings(arguments))
    assert found[0] == found[1] != found[2]
