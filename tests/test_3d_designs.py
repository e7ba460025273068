"""3-D surrogates, their designs of least drag, and the files and pictures of a run."""

import itertools

import imageio.v3 as imageio
import matplotlib as mpl
import numpy as np
import pytest
from conftest import ROUGH_3D
from pictures import pixels

from shapeopt import Problem, Settling, load_run, optimise, save_run
from shapeopt.problem.conflicts import candidates
from shapeopt.render.bodies_3d import FRICTION, PRESSURE, TURNS, render_bodies, solved_panel
from shapeopt.render.pictures import Panel
from shapeopt.search import following as following_module
from shapeopt.search.following import following
from shapeopt.search.propose import Proposal
from surrogate import Family, Flow, InvalidInput, Scene, load, train
from surrogate.flow.output.meshes import pv

FAMILY = Family(dimension=3)


# A proposal of a body with five parameters, of which nothing is known but its work.
PROPOSAL = Proposal(
    np.ones(5), 1.0, np.zeros(5), np.zeros(0), np.zeros((0, 5)), 0.0, 1.0, np.ones((1, 5)), 7
)


@pytest.fixture(scope="module")
def slender():
    """Few parameters, so that few bodies suffice."""
    family = Family(dimension=3, aspect=(1, 3), flatness=(1, 1.7))
    return Scene(dimension=3, reynolds=(5, 40), family=family, fidelity=ROUGH_3D)


@pytest.fixture(scope="module")
def network(slender, tmp_path_factory):
    folder = tmp_path_factory.mktemp("3d") / "net"
    train(slender, "hig", samples=12, preset="quick", out=folder, progress=False)
    return folder


@pytest.mark.slow
def test_a_3d_surrogate_is_trained_and_saved_and_agrees_with_the_flow(slender, network):
    surrogate = load(network)
    assert surrogate.scene == slender
    assert surrogate.record["drag_error_mean"] < 0.01
    found = float(surrogate.drag([2.0, 1.5], 20.0))
    assert found == pytest.approx(float(Flow(slender).drag([2.0, 1.5], 20.0)), rel=0.02)


@pytest.mark.parametrize(("reynolds", "drag"), [(0.1, 244.176), (10, 4.3079), (100, 1.0881)])
def test_golden_sphere_by_the_shipped_surrogate(reynolds, drag):
    """Not among its training bodies; the flow it was trained by is within 0.5 %."""
    net = load("pretrained:space")
    assert float(net.drag(FAMILY.ellipse(1.0), reynolds)) == pytest.approx(drag, rel=0.01)


def test_golden_least_drags_by_the_shipped_surrogate():
    """Pironneau 1973 in Stokes flow; axisymmetric elements at Re 40."""
    net = load("pretrained:space")
    for reynolds, ratio, aspect in ((0.1, 0.95425, 2.0), (40.0, 0.79645, 3.69)):
        design = optimise(Problem(net.scene, reynolds), net)
        sphere = float(net.drag(FAMILY.ellipse(1.0), reynolds))
        assert design.drag / sphere == pytest.approx(ratio, abs=0.006)
        assert design.parameters[0] == pytest.approx(aspect, rel=0.1)
        assert design.parameters[1] < 1.05  # nothing is gained by flattening


def test_exact_terminal_velocity_where_the_force_is_a_power_of_re():
    """Newton's method in log Re is exact there: C Re^2 = 4/3 Ar after one step."""
    scene, archimedes = Scene(dimension=3, reynolds=(1, 40)), 300.0

    def loads(problem):  # Cd and Cl whose force is 25 Re^-0.7
        force = 25 * problem.scenarios.reynolds[0] ** -0.7 * np.array([0.8, 0.6])
        return force, -0.7 * force

    first = Problem(scene, Settling(archimedes))
    second = following(first, *loads(first))
    exact = (4 / 3 * archimedes / 25) ** (1 / 1.3)
    assert second.objective.reynolds == pytest.approx(exact, rel=1e-12)
    assert following(second, *loads(second)) is None
    for too_much, words in ((1e4, "above Re 40"), (10.0, "below Re 1")):
        edge = Problem(scene, Settling(too_much))  # the sphere's Re is outside the scene
        with pytest.raises(InvalidInput, match=f"settles {words}, where the scene ends"):
            following(edge, *loads(edge))


def test_problems_that_do_not_follow_count_one_search(monkeypatch):
    """The drag at a given Re is done after one round, the settling speed here after three."""
    scene, begin = Scene(dimension=3, reynolds=(1, 40)), iter((9.0, 8.0))
    problems = [Problem(scene, 20.0), Problem(scene, Settling(300.0))]

    def proposed(problems, model, devices):
        return [PROPOSAL for _ in problems]

    def next_one(model, problem, proposal):
        reynolds = next(begin, None) if not problem.objective.fixed else None
        return reynolds and Problem(scene, Settling(300.0, reynolds))

    monkeypatch.setattr(following_module, "propose_all", proposed)
    monkeypatch.setattr(following_module, "_following", next_one)
    last, found = following_module.follow_all(problems, load("pretrained:space").network)
    assert last[0] == problems[0]
    assert last[1].objective.reynolds == 8
    assert [one.calls for one in found] == [7, 21]


@pytest.mark.parametrize(
    ("scene", "archimedes", "message"),
    [
        (Scene(), 100.0, "needs a scene of 3-D bodies"),
        (Scene(dimension=3), -1.0, "Archimedes number -1: from"),
        (Scene(dimension=3), np.inf, "Archimedes number inf"),
    ],
)
def test_what_cannot_settle_is_refused(scene, archimedes, message):
    with pytest.raises(InvalidInput, match=message):
        Problem(scene, Settling(archimedes))


@pytest.mark.slow
def test_no_body_settles_faster_by_the_surrogate():
    """At the Re found the force on every other body at that incidence exceeds the weight."""
    net, archimedes = load("pretrained:particle"), 1000.0
    held = {"incidence": (45.0, 45.0)}
    design = optimise(Problem(net.scene, Settling(archimedes), within=held), net)
    reynolds = design.problem.objective.nominal
    thrust = np.hypot(*design.loads[:2]) * reynolds**2
    assert thrust == pytest.approx(4 / 3 * archimedes, rel=1e-4)
    assert design.kkt_residual < 1e-4
    low, high = net.scene.family.bounds.T
    others = np.random.default_rng(0).uniform(low, high, (500, len(low)))
    others[:, 3] = 45.0
    forces = np.hypot(*np.asarray(net.loads(others, reynolds))[:, :2].T)
    assert forces.min() * reynolds**2 > thrust
    with pytest.raises(InvalidInput, match="above Re 100, where the scene ends; at most"):
        optimise(Problem(net.scene, Settling(1e5), within=held), net)


@pytest.mark.slow
def test_the_fastest_body_is_one_of_the_flow(tmp_path):
    """The flow's force balances the weight, at an optimum of the flow; the run says so."""
    family = Family(dimension=3, aspect=(0.6, 2.0), incidence=(0, 90))
    flow = Flow(Scene(dimension=3, reynolds=(5, 40), family=family, fidelity=ROUGH_3D))
    held = {"incidence": (45.0, 45.0)}
    design = optimise(Problem(flow.scene, Settling(400.0), within=held), flow)
    reynolds = design.problem.objective.nominal
    found = flow.solve(design.parameters, reynolds, estimate=False)
    thrust = np.hypot(found.drag, found.lift) * reynolds**2
    assert thrust == pytest.approx(4 / 3 * 400, rel=2e-4)
    assert design.kkt_residual < 1e-3
    slower = flow.solve(np.array([1.6, 45.0]), reynolds, estimate=False)
    assert np.hypot(slower.drag, slower.lift) > np.hypot(found.drag, found.lift)
    record = save_run(tmp_path / "run", design)
    assert record["objective"]["archimedes"] == 400
    assert record["reynolds"] == reynolds
    assert record["cd_verified"] == pytest.approx(found.drag, rel=1e-6)


@pytest.mark.slow
def test_a_bound_on_height_flattens_the_optimum(slender, network, tmp_path):
    """Free, it is a body of revolution; a run is written and read, its files are watertight."""
    surrogate = load(network)
    free = optimise(Problem(slender, 20.0, max_length=1.7), surrogate)
    low = Problem(slender, 20.0, max_length=1.7, max_thickness=0.6)
    flat = optimise(low, surrogate)
    assert free.parameters[1] < 1.1 < 1.2 < flat.parameters[1]
    assert float(slender.family.body_class.thickness(flat.parameters)) <= 0.6 + 1e-6
    run = save_run(tmp_path / "run", flat, surrogate)
    assert load_run(tmp_path / "run")["parameters"] == run["parameters"]
    for name in ("contour.vtp", "body.stl"):
        mesh = pv.read(tmp_path / "run" / name)
        assert mesh.n_open_edges == 0
        assert mesh.is_manifold
        assert mesh.volume == pytest.approx(np.pi / 6, rel=3e-3)
    loads = pv.read(tmp_path / "run" / "contour.vtp")
    assert np.all(np.isfinite(loads["Cp"]))
    assert loads["Cf"].shape == (loads.n_points, 3)
    with pytest.raises(InvalidInput, match=r"max thickness 0\.2: every body"):
        candidates(Problem(slender, 20.0, max_thickness=0.2))


@pytest.mark.slow
def test_every_row_of_bodies_has_its_own_colour_scale(slender, tmp_path):
    """Cp at Re 0.5 is a hundred times that at Re 20: one scale would hide a row."""
    flow = Flow(slender)
    found = [flow.solve(slender.family.ellipse(1.0), re, estimate=False) for re in (0.5, 20.0)]
    rows = [[solved_panel(Panel(flow, f"Re {flow.reynolds:g}"))] for flow in found]
    (width, height), colours = pixels(render_bodies(rows, tmp_path / "rows.png"))
    reds = colours.reshape(height, width, 3).astype(int)
    reds = np.sum((reds[..., 0] > 150) & (reds[..., 2] < 90), axis=1)
    below, above = reds[: height // 2].sum(), reds[height // 2 :].sum()
    assert min(below, above) > 0.2 * max(below, above) > 100


@pytest.mark.slow
def test_pictures_of_a_3d_run(network, slender, tmp_path):
    from shapeopt.commands import render_shapes

    save_run(tmp_path / "run", optimise(Problem(slender, 20.0), load(network)))
    render_shapes.main(["--runs", str(tmp_path / "run"), "--out", str(tmp_path / "pair.png")])
    shown = [pixels(tmp_path / "pair.png")[1]]
    run = ["--runs", str(tmp_path / "run")]
    render_shapes.main([*run, "--surface", "--out", str(tmp_path / "friction.png")])
    shown.append(pixels(tmp_path / "friction.png")[1])
    assert np.mean(np.any(shown[0] != shown[1], axis=-1)) > 0.01  # the bodies have other colours
    render_shapes.main([*run, "--surface", "--out", str(tmp_path / "turn.gif")])
    frames = imageio.imread(tmp_path / "turn.gif")
    assert len(frames) == TURNS
    for one, other in itertools.pairwise(frames[:: TURNS // 4]):
        assert np.mean(one != other) > 0.02  # the body has turned


def test_no_pressure_has_the_middle_colour_whatever_the_ends():
    middle = mpl.colormaps[PRESSURE.colours](0.5)
    for low, high in ((-0.5, 1.5), (-2.0, 0.5), (-1.0, 1.0)):
        zero = PRESSURE.colour_map(low, high)(-low / (high - low))
        assert zero == pytest.approx(middle, abs=0.02)
    assert FRICTION.colour_map(0.5, 2.0) == mpl.colormaps[FRICTION.colours]
