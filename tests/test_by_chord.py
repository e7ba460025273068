"""Designs at fixed chord: loads, bounds and lengths are based on it."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from conftest import SECTIONS, TINY
from pictures import pixels
from scipy.optimize import minimize
from taylor import taylor_rates

from shapeopt import (
    Designer,
    Glide,
    Problem,
    Robust,
    Station,
    load_run,
    optimise,
    optimise_all,
    save_run,
)
from shapeopt.commands.cli import run
from shapeopt.commands.design_sheet import main as design_sheet
from shapeopt.commands.optimize_shape import main as optimize_shape
from shapeopt.problem.constraints import constraint_values
from shapeopt.problem.objective import AtReynolds
from shapeopt.problem.reference import Reference
from shapeopt.problem.scenarios import load_constraints
from shapeopt.render.over_lift import plot_over_lift, section_contour
from shapeopt.render.sheets import before_and_after
from shapeopt.search.optimality import KKT_TOLERANCE, Derivatives, multipliers
from shapeopt.search.propose import without_padding
from shapeopt.search.sheet import row_of
from shapeopt.search.sqp import SqpResult
from shapeopt.stored import design_settings
from surrogate import Flow, InvalidInput, NotConverged, Scene, Tunnel, load

SCENE = Scene(family=SECTIONS, fidelity=TINY, reynolds=(5, 20))
LONG = np.array([3.5, 0.1, 0.05, 0.04])  # of the default family: chord sqrt(3.5)
SECTION = np.array([2.5, 0.1, 0.2, 6.0])


@pytest.fixture(scope="module")
def pretrained():
    return load("pretrained")


def test_loads_and_slopes_by_the_chord_are_those_of_the_model():
    """Slopes by D, as an observation has them, become the Jacobian of the model by the chord."""
    net = load("pretrained:lift")
    body = jnp.array([3.0, 0.1, 0.05, 0.0, 0.2, -0.05, 5.0])
    chord, reynolds = np.sqrt(3.0), 40.0
    reference = Reference(net.scene.family.body_class, by_chord=True)
    model = reference.model(net.network)
    query = reference.query(body, reynolds)
    assert query[1] == pytest.approx(reynolds / chord)
    by_diameter = net.loads(*query)
    found = model.loads(body, jnp.asarray(reynolds))
    np.testing.assert_allclose(found, by_diameter / np.array([chord, chord, chord**2]), rtol=1e-12)
    np.testing.assert_allclose(reference.loads(body, by_diameter), found, rtol=1e-12)

    def by_inputs(model, reynolds):
        inputs = jnp.append(body, jnp.log(reynolds))
        return jax.jit(jax.jacobian(lambda x: model.loads(x[:-1], jnp.exp(x[-1]))))(inputs)

    slopes = reference.slopes(body, by_diameter, by_inputs(net.network, query[1]))
    np.testing.assert_allclose(slopes, by_inputs(model, reynolds), rtol=1e-9, atol=1e-12)
    unchanged = Reference(net.scene.family.body_class)
    assert unchanged.query(body, reynolds)[1] == reynolds
    assert unchanged.model(net.network) is net.network


def test_lengths_of_bounds_are_in_chords(pretrained):
    bounds = {"min_thickness": 0.4, "min_radius": 0.02, "stations": [Station(0.25, 0.3)]}
    by_chord = Problem(pretrained.scene, 40.0, by_chord=True, **bounds)
    chord = np.sqrt(LONG[0])
    lengths = {name: bounds[name] * chord for name in ("min_thickness", "min_radius")}
    by_diameter = Problem(pretrained.scene, 40.0, stations=[Station(0.25, 0.3 * chord)], **lengths)
    ours, theirs = (np.asarray(constraint_values(LONG, p.limits)) for p in (by_chord, by_diameter))
    free, unset = 1, 100.0  # the body's own shape, and the bound on the length that is not set
    np.testing.assert_allclose(ours[0], theirs[0], rtol=1e-12)
    assert ours[free] == pytest.approx(unset - 1)
    np.testing.assert_allclose(ours[free + 1 :], theirs[free + 1 :] / chord, rtol=1e-12)


def test_the_optimum_is_that_of_scipy(pretrained, generator):
    """SciPy's SLSQP on Cd / c at U c / nu, written without the project's problem."""
    family, reynolds, thick = pretrained.scene.family, 50.0, 0.45
    problem = Problem(pretrained.scene, reynolds, min_thickness=thick, by_chord=True)
    found = optimise(problem, pretrained)

    @jax.jit
    @jax.value_and_grad
    def drag(body):
        chord = jnp.sqrt(body[0])
        return pretrained.drag(body, reynolds / chord) / chord

    @jax.jit
    def room(body):
        return family.body_class.thickness(body) / jnp.sqrt(body[0]) - thick

    bounds = [tuple(ends) for ends in family.bounds]
    bounds[0] = max(bounds[0][0], (reynolds / 40.0) ** 2), bounds[0][1]
    constraint = {"type": "ineq", "fun": room, "jac": jax.jit(jax.grad(room))}
    options = {"jac": True, "method": "SLSQP", "bounds": bounds, "constraints": constraint}
    starts = generator.uniform(*np.transpose(bounds), (8, 4))
    ends = [minimize(drag, start, options={"ftol": 1e-12}, **options) for start in starts]
    theirs = min(ends, key=lambda end: end.fun if room(end.x) > -1e-8 else np.inf)
    assert found.objective == pytest.approx(theirs.fun, rel=1e-6)
    np.testing.assert_allclose(found.parameters, theirs.x, atol=2e-3)
    assert found.drag == pytest.approx(found.objective, rel=1e-12)
    assert f"{found.reynolds:.4g}, by the chord {reynolds:g}" in found.summary()
    assert "over c" in repr(found)
    assert float(room(found.parameters)) == pytest.approx(0, abs=1e-6)
    assert found.kkt_residual < KKT_TOLERANCE


def test_settings_say_whether_a_run_is_by_chord(pretrained):
    by_diameter, by_chord = (Problem(pretrained.scene, 30.0, by_chord=b) for b in (False, True))
    for problem in (by_diameter, by_chord):
        assert design_settings(problem, pretrained, False)["by_chord"] is problem.by_chord
    assert by_chord.constraints == by_diameter.constraints == {}


def test_bodies_keep_reynolds_numbers_within_the_scene(pretrained):
    low, high = (Problem(pretrained.scene, re, by_chord=True).limits for re in (1.5, 60.0))
    assert low.high[0] == pytest.approx(1.5**2)
    assert high.low[0] == pytest.approx((60 / 40) ** 2)


def test_gradients_on_the_flow_are_those_of_its_loads():
    """The objective, and its gradient, of flows and adjoints: second-order Taylor remainders."""
    problem = Problem(SCENE, Glide(15.0), max_moment=0.2, by_chord=True)
    rates = taylor_rates(problem, SECTION, np.array([0.3, 0.05, 0.05, 2.0]))
    assert np.all(rates > 1.9), rates


@pytest.fixture(scope="module")
def designed(tmp_path_factory):
    """A design on the flow, with the file of its flows."""
    memory = tmp_path_factory.mktemp("designed") / "flows.json"
    problem = Problem(SCENE, 15.0, lift=0.1, min_thickness=0.35, by_chord=True)
    return Designer(Flow(SCENE), memory).design(problem), memory


def test_a_design_on_the_flow_is_saved_with_loads_over_the_chord(designed, tmp_path, no_estimates):
    """It is a local optimum of the flow, whose gradients the test above checks."""
    design, chord = designed[0], np.sqrt(designed[0].parameters[0])
    flow = design.verified.solutions[0]
    assert design.kkt_residual <= KKT_TOLERANCE
    assert design.reynolds == flow.reynolds == pytest.approx(15.0 / chord)
    loads = np.array([flow.drag, flow.lift, flow.moment]) / [chord, chord, chord**2]
    np.testing.assert_allclose(design.loads, loads, rtol=1e-5)
    assert design.lift == pytest.approx(0.1, abs=1e-3)
    assert design.verified.objective == pytest.approx(design.objective, rel=1e-6)
    record = save_run(tmp_path / "run", design)
    assert load_run(tmp_path / "run") == record
    numbers = record["reference"], record["chord_reynolds"], record["reynolds"]
    assert numbers == ("chord", pytest.approx(15), flow.reynolds)
    for kept in (record, record["cases"][0]):
        found = [kept[f"{load}_verified"] for load in ("cd", "cl", "cm")]
        np.testing.assert_allclose(found, loads, rtol=1e-12)
    assert record["cd_start"] is None
    panels = before_and_after(record)
    assert panels[1].title.startswith(f"chord Re 15    optimum    Cd {loads[0]:.4f}    Cl 0.1")


def test_rows_of_sheets_have_both_reynolds_numbers(designed, tmp_path):
    design, _ = designed
    row = row_of(design.problem, design)
    assert (row["reynolds"], row["chord_reynolds"]) == (design.reynolds, pytest.approx(15))
    assert row["cl"] == design.lift
    lost = row_of(design.problem, NotConverged("none"))
    assert (lost["reynolds"], lost["chord_reynolds"]) == (None, 15.0)
    pictures = [
        pixels(plot_over_lift(SCENE.family, [row], row, tmp_path / "sheet.png", by_chord))[1]
        for by_chord in (True, False)
    ]
    assert np.any(pictures[0] != pictures[1])
    other = {"parameters": {"aspect": 1.6}, "chord": np.sqrt(1.6)}
    drawn = section_contour(SCENE.family, other, 2.0), section_contour(SCENE.family, other, None)
    assert [np.ptp(one[:, 0]) for one in drawn] == pytest.approx([2.0, np.sqrt(1.6)], rel=1e-3)


def test_commands_say_what_is_over_the_chord(designed, tmp_path, capsys, no_estimates):
    scene, out = tmp_path / "scene.toml", tmp_path / "run"
    SCENE.write(scene)
    words = ["--surrogate", "none", "--scene", str(scene), "--chord-reynolds", "15"]
    bounds = ["--lift", "0.1", "--min-thickness", "0.35", "--memory", str(designed[1])]
    record = optimize_shape([*words, *bounds, "--out", str(out)])
    said = capsys.readouterr().out
    assert record["flows"] == 0
    assert f"chord Re 15, U D / nu {record['reynolds']:.4g}: aspect " in said
    assert f"{record['thickness'] / record['chord']:.1%} thickness" in said
    assert "verified, over c and c^2, Cm about the centroid" in said
    assert f"Cd over c {record['cd_verified']:.4f} verified" in said
    assert "  by the flow: d(objective) / d(bound): " in said
    picture = tmp_path / "sheet.png"
    sheet = ["--lifts", "0.1", "--min-thickness", "0.35", "--range", "aspect=2:2,beta2=0:0"]
    found = design_sheet([*words, *sheet, "--out", str(picture)])
    shared = {name: found[name] for name in ("surrogate", "warning", "until")}
    assert shared == {"surrogate": "none", "warning": None, "until": "flow"}
    assert shared.items() <= record.items()
    assert [row["why_not"] for row in (*found["designs"], found["best_glide"])] == [None, None]
    assert found["designs"][0]["flows"] > 1
    pixels(picture)
    words = ["--surrogate", "pretrained:lift", "--chord-reynolds", "15", "--max-length", "2"]
    assert run(design_sheet, [*words, "--out", "x.png"]) == 2
    assert "--chord-reynolds: goes with --lifts" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("objective", "bounds"),
    [
        (AtReynolds(60.0), {"lift": 0.5, "max_moment": 0.15, "min_thickness": 0.3}),
        (Glide(60.0), {"min_moment": 0.25, "min_thickness": 0.35}),
    ],
)
def test_multipliers_are_slopes_of_the_optimum_over_its_bounds(objective, bounds):
    net = load("pretrained:lift")

    def optimum(**changed):
        return optimise(Problem(net.scene, objective, **bounds | changed, by_chord=True), net)

    found = optimum()
    active = set(found.multipliers) & set(bounds)
    assert len(active) >= 2
    for name in active:
        ends = [optimum(**{name: bounds[name] + step}).objective for step in (2e-3, -2e-3)]
        assert found.multipliers[name] == pytest.approx((ends[0] - ends[1]) / 4e-3, rel=3e-2), name


def test_multipliers_of_several_cases_are_summed(generator):
    """Of a body within all other bounds, whose gradient two constraints on Cl hold exactly."""
    problem = Problem(SCENE, Robust(10.0, 0.2, cases=3), lift=0.3)
    held, drags = np.array([0.7, 0.0, 0.4]), np.array([1.5, 2.0, 2.5])
    of_loads, by_loads = np.ones(9), generator.normal(size=(9, 4))
    of_loads[[0, 2]] = 0.0
    found = Derivatives(by_loads[:3].T @ held, of_loads, by_loads, drags)
    assert multipliers(problem, SECTION, found) == pytest.approx({"lift": np.sum(held / drags)})


def test_constraints_of_padded_problems_are_those_of_their_own_cases(generator):
    problem = Problem(SCENE, Robust(10.0, 0.2, cases=3), lift=0.3)
    loads = generator.uniform(1, 2, (3, 3))
    more = np.concatenate([loads, loads[-1:].repeat(2, axis=0)])
    of_loads = load_constraints(more, problem.scenarios.padded(5))
    by_loads = generator.normal(size=(of_loads.size, 4))
    end = SqpResult(*[np.zeros(0)] * 10)._replace(of_loads=of_loads, by_loads=by_loads)
    kept = without_padding(end, problem)
    np.testing.assert_array_equal(kept.of_loads, load_constraints(loads, problem.scenarios))
    np.testing.assert_array_equal(kept.by_loads[3], by_loads[5])  # of the first case's second bound
    assert kept.by_loads.shape == (9, 4)


def test_what_has_no_chord_of_its_own_is_refused(pretrained):
    with pytest.raises(InvalidInput, match="by chord: is for 2-D bodies"):
        Problem(Scene(dimension=3), 10.0, by_chord=True)
    with pytest.raises(InvalidInput, match="by chord: is for unbounded streams"):
        Problem(Scene(Tunnel(12)), 10.0, by_chord=True)
    with pytest.raises(InvalidInput, match="must be above 0"):
        Problem(pretrained.scene, -10.0, by_chord=True)
    with pytest.raises(InvalidInput, match="above 0, in c"):
        Problem(pretrained.scene, 10.0, min_thickness=-0.1, by_chord=True)
    with pytest.raises(InvalidInput, match=r"is thinner than 1\.\d+ c;"):
        optimise(Problem(pretrained.scene, 10.0, min_thickness=1.5, by_chord=True), pretrained)
    with pytest.raises(InvalidInput, match="not with Robust"):
        Problem(pretrained.scene, Robust(10.0, 0.2), by_chord=True)
    with pytest.raises(InvalidInput, match=r"chord Reynolds number 0\.5: the family and"):
        Problem(pretrained.scene, 0.5, by_chord=True)
    mixed = [Problem(pretrained.scene, 10.0), Problem(pretrained.scene, 10.0, by_chord=True)]
    with pytest.raises(InvalidInput, match="need the same by_chord"):
        optimise_all(mixed, pretrained)
