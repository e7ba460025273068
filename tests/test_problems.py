"""Objectives, constraints and the search against what is known exactly."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.stats import norm

from shapeopt import LogNormal, Problem, Robust, Station, Uniform, Weighted, optimise, optimise_all
from shapeopt.payoff.direct import design_directly
from shapeopt.payoff.slsqp import minimise_slsqp
from shapeopt.problem.conflicts import candidates
from shapeopt.problem.constraints import constraint_values, satisfied
from shapeopt.problem.feasible import drawn_bodies
from shapeopt.problem.scenarios import (
    combine,
    conditional_value_at_risk,
    load_constraints,
    model_objective,
)
from shapeopt.search.qp import solve_relaxed_qp
from shapeopt.search.sqp import minimise_sqp
from surrogate import Family, Flow, InvalidInput, Scene, load

FAMILY = Family()
BODIES = FAMILY.body_class
BODY = np.array([2.4, 0.12, -0.05, 0.04])


@pytest.fixture(scope="module")
def pretrained():
    return load("pretrained")


def test_cvar_is_the_mean_of_the_sorted_tail(generator):
    losses = generator.normal(size=40)
    weight = np.full(40, 1 / 40)
    for level, worst in ((0.0, 40), (0.9, 4), (0.75, 10)):
        value = float(conditional_value_at_risk(losses, weight, level))
        assert value == pytest.approx(np.sort(losses)[-worst:].mean())


def test_cvar_is_the_least_of_rockafellar_and_uryasev(generator):
    """Unequal weights: the closed form against the minimum over all thresholds."""
    losses, weight = generator.normal(size=15), generator.uniform(0.1, 1, 15)
    weight /= weight.sum()
    excess = np.maximum(losses[:, None] - losses[None], 0)  # the minimum is at one of the losses
    least = (losses + weight @ excess / (1 - 0.83)).min()
    assert float(conditional_value_at_risk(losses, weight, 0.83)) == pytest.approx(least)


def test_measures_of_an_ellipse():
    """Semi-axes a along and b across: radii b^2/a at the ends, a^2/b at the top."""
    a, b = np.sqrt(3.0) / 2, 1 / (2 * np.sqrt(3.0))
    body = jnp.asarray(FAMILY.ellipse(3.0))
    nose, tail, side = BODIES.radii(body)
    assert [float(nose), float(tail)] == pytest.approx([b**2 / a] * 2)
    assert b**2 / a <= float(side) < 1.01 * b**2 / a
    flat = BODIES.radii(jnp.asarray(FAMILY.ellipse(1 / 3)))  # a and b change places
    assert [float(flat.nose), float(flat.side)] == pytest.approx([a**2 / b, b**2 / a])
    assert float(BODIES.thickness_at(body, jnp.asarray(0.2))) == pytest.approx(2 * b * 0.8)
    assert float(BODIES.length(body)) == pytest.approx(2 * a)
    assert float(BODIES.thickness(body)) == pytest.approx(2 * b)


def test_measures_of_a_body_agree_with_its_contour():
    x, y = np.asarray(FAMILY.markers(jnp.asarray(BODY), 20000)).T
    station = (x - x.min()) / np.ptp(x)
    upper = y > 0
    order = np.argsort(station[upper])
    there = 2 * np.interp(0.3, station[upper][order], y[upper][order])
    found = BODIES.thickness_at(jnp.asarray(BODY), jnp.asarray(0.3))
    assert float(found) == pytest.approx(there, 1e-4)
    d = np.gradient
    bend = np.abs(d(x) * d(d(y)) - d(y) * d(d(x))) / (d(x) ** 2 + d(y) ** 2) ** 1.5
    least = min(map(float, BODIES.radii(jnp.asarray(BODY))))
    assert least == pytest.approx(1 / bend[3:-3].max(), rel=2e-2)


OBJECTIVES = [
    30.0,
    Weighted((1.0, 10.0, 40.0), (1.0, 2.0, 1.0)),
    Robust(20.0, LogNormal(0.3), tolerance=0.02, level=0.8, cases=16),
]


@pytest.mark.parametrize("objective", OBJECTIVES)
def test_gradients_by_finite_differences(pretrained, objective):
    problem = Problem(pretrained.scene, objective, stations=(Station(0.3, 0.2),), min_radius=0.01)

    def value(body):
        return model_objective(pretrained.network, body, problem.scenarios)

    def constraints(body):
        return constraint_values(body, problem.limits)

    for function in (value, constraints):
        exact = jax.jacfwd(function)(jnp.asarray(BODY))
        for k, step in enumerate(1e-6 * np.eye(4)):
            slope = (function(jnp.asarray(BODY + step)) - function(jnp.asarray(BODY - step))) / 2e-6
            np.testing.assert_allclose(exact[..., k], slope, rtol=1e-4, atol=1e-6)


def test_weighted_is_the_mean_of_drags_over_the_cylinders(pretrained):
    scenarios = Problem(pretrained.scene, OBJECTIVES[1]).scenarios
    ratios = [
        float(pretrained.drag(BODY, re) / pretrained.drag(FAMILY.ellipse(1.0), re))
        for re in (1.0, 10.0, 40.0)
    ]
    mean = np.average(ratios, weights=[1, 2, 1])
    assert float(
        model_objective(pretrained.network, jnp.asarray(BODY), scenarios)
    ) == pytest.approx(mean)


def test_one_seed_is_one_set_of_cases(pretrained):
    def draw(seed):
        return Robust(20.0, LogNormal(0.3), 0.02, cases=64, seed=seed).scenarios(pretrained.scene)

    first, again, other = draw(1), draw(1), draw(2)
    assert all(np.array_equal(a, b) for a, b in zip(first, again, strict=True))
    assert not np.array_equal(first.reynolds, other.reynolds)
    assert np.log(first.reynolds / 20).std() == pytest.approx(0.3, rel=0.1)


def test_a_tolerance_is_a_standard_deviation_before_truncation(pretrained):
    """Shape changes: a normal of this deviation, truncated at two of them, which leaves 0.88."""
    robust = Robust(20.0, Uniform(0.1), tolerance=0.03, cases=4096)
    shift = robust.scenarios(pretrained.scene).shift / np.ptp(FAMILY.bounds, axis=1)
    truncated = 0.03 * np.sqrt(1 - 4 * norm.pdf(2) / (norm.cdf(2) - norm.cdf(-2)))
    assert truncated == pytest.approx(0.88 * 0.03, rel=1e-3)
    assert shift.std(axis=0) == pytest.approx([truncated] * 4, rel=2e-3)
    assert np.abs(shift).max() == pytest.approx(2 * 0.03, rel=1e-2)
    assert np.abs(shift).max() <= 2 * 0.03


@pytest.mark.parametrize("spread", [LogNormal(0.5), Uniform(0.6)])
def test_cases_outside_the_trained_range_are_cut_off(pretrained, spread):
    robust = Robust(35.0, spread, tolerance=0.03)
    problem = Problem(pretrained.scene, robust)
    assert 0.5 < robust.kept(pretrained.scene) < 1
    assert np.all((problem.scenarios.reynolds >= 1) & (problem.scenarios.reynolds <= 40))
    corners = (
        problem.limits.low + problem.scenarios.shift,
        problem.limits.high + problem.scenarios.shift,
    )
    for corner in corners:
        assert all(pretrained.scene.family.contains(body) for body in corner)
    with pytest.raises(InvalidInput, match="half"):
        candidates(Problem(Scene(reynolds=(1.0, 40.0)), Robust(1.0, LogNormal(2.0))))


def test_the_worst_glide_ratios_are_the_least():
    robust = Robust(20.0, LogNormal(0.2), level=0.5, cases=4, glide=True)
    scene = Scene(family=Family(aspect=(2.0, 3.0), incidence=(0.0, 10.0)))
    loads = np.array([[1.0, 0.9, 0.0], [2.0, 0.2, 0.0], [1.0, 0.4, 0.0], [1.0, 0.6, 0.0]])
    found = combine(loads, np.ones(4), robust.scenarios(scene))
    assert float(found) == pytest.approx(-(0.1 + 0.4) / 2)


@pytest.mark.slow
def test_robust_costs_more_than_its_middle_and_cvar_more_than_the_mean(pretrained):
    at, mean, worst = (
        optimise(Problem(pretrained.scene, objective), pretrained).objective
        for objective in (20.0, Robust(20.0, LogNormal(0.3)), Robust(20.0, LogNormal(0.3), 0, 0.9))
    )
    assert at < mean < worst


def test_a_call_of_many_problems_answers_as_one_by_one(pretrained):
    scene = pretrained.scene
    problems = [Problem(scene, re, max_length=1.3 + re / 40) for re in (2.0, 11.0, 37.0)]
    problems.append(Problem(scene, 20.0, min_thickness=0.7, within={"aspect": (1.0, 1.02)}))
    together = optimise_all(problems, pretrained)
    alone = [optimise(problem, pretrained) for problem in problems]
    for one, other in zip(together, alone, strict=True):
        assert one.parameters == pytest.approx(other.parameters, abs=1e-9)
        assert (one.calls, one.kkt_residual < 1e-5) == (other.calls, True)
    assert optimise_all([], pretrained) == []
    with pytest.raises(InvalidInput, match="JAX has"):
        optimise_all(problems, pretrained, devices=1000)
    with pytest.raises(InvalidInput, match="a surrogate"):
        optimise_all(problems, Flow(scene))


@pytest.mark.slow
def test_problems_of_different_kinds_share_a_call(pretrained):
    """Other bounds, other numbers of stations and scenarios: padding changes no answer."""
    scene = pretrained.scene
    problems = [
        Problem(scene, 11.0, max_length=1.4),
        Problem(scene, 30.0, stations=(Station(0.2, 0.6), Station(0.8, 0.4)), max_thickness=0.7),
        Problem(scene, Robust(20.0, LogNormal(0.3), level=0.8, cases=3), min_radius=0.1),
    ]
    for one, alone in zip(optimise_all(problems, pretrained), problems, strict=True):
        other = optimise(alone, pretrained)
        assert one.objective == pytest.approx(other.objective, rel=1e-8)
        assert one.parameters == pytest.approx(other.parameters, abs=1e-4)
        assert one.drag == pytest.approx(other.drag, rel=1e-5)
        assert np.min(constraint_values(one.parameters, alone.limits)) >= -1e-6


@pytest.mark.parametrize("case", [(1.2, 0.0), (3.0, 0.78), (1.15, 0.7)])
def test_sqp_and_slsqp_end_alike(pretrained, case):
    """Two codes of one problem, from the same start; under no, one and two active bounds."""
    length, thick = case
    problem = Problem(pretrained.scene, 30.0, length, thick or None)
    start = candidates(problem)[0]

    def objective(body):
        value, gradient = jax.value_and_grad(model_objective, 1)(
            pretrained.network, jnp.asarray(body), problem.scenarios
        )
        return float(value), np.asarray(gradient)

    scale = model_objective(pretrained.network, jnp.asarray(start), problem.scenarios)
    ours = jax.jit(minimise_sqp)(
        pretrained.network, start, scale, problem.limits, problem.scenarios
    )
    theirs = minimise_slsqp(objective, problem.limits, start, 1e-12)
    assert ours.converged
    assert ours.feasibility >= -1e-8
    assert ours.value <= theirs.value * (1 + 1e-9)


@pytest.mark.parametrize("count", [3, 30])
def test_a_quadratic_program_is_solved(generator, count):
    """Against SLSQP: min g d + d B d / 2 under c + J d >= 0 and a box; no relaxation is needed."""
    root, gradient = generator.normal(size=(4, 4)), generator.normal(size=4)
    hessian = root @ root.T + np.eye(4)
    jacobian, values = generator.normal(size=(count, 4)), generator.uniform(0.01, 0.3, count)
    low, high = -generator.uniform(0.05, 0.5, 4), generator.uniform(0.05, 0.5, 4)
    step, multipliers = solve_relaxed_qp(
        *map(jnp.asarray, (hessian, gradient, values, jacobian, low, high)), 30.0
    )
    expected = minimize(
        lambda d: gradient @ d + d @ hessian @ d / 2,
        np.zeros(4),
        method="SLSQP",
        bounds=list(zip(low, high, strict=True)),
        constraints={"type": "ineq", "fun": lambda d: values + jacobian @ d},
        options={"ftol": 1e-14},
    )
    assert step == pytest.approx(expected.x, abs=1e-4)
    assert np.min(multipliers) >= 0
    assert multipliers @ (values + jacobian @ step) == pytest.approx(0, abs=1e-3)


@pytest.fixture(scope="module")
def optima(pretrained):
    """The optima for several objectives under all kinds of bounds, by one call."""
    bounds = {
        "max_length": 1.6,
        "stations": (Station(0.25, 0.5),),
        "min_radius": 0.1,
        "within": {"aspect": (1.0, 3.0), "beta2": (-0.2, 0.2), "beta4": (-0.05, 0.05)},
        "trust": 0.05,
    }
    problems = [Problem(pretrained.scene, objective, **bounds) for objective in OBJECTIVES]
    return optimise_all(problems, pretrained)


@pytest.mark.parametrize("k", range(len(OBJECTIVES)))
def test_constraints_hold_and_the_optimum_is_stationary(optima, k):
    optimum, problem = optima[k], optima[k].problem
    assert problem.reynolds == OBJECTIVES[k]
    assert np.all(np.asarray(constraint_values(optimum.parameters, problem.limits)) >= -1e-6)
    low, high = problem.limits.low, problem.limits.high
    assert np.all((optimum.parameters >= low) & (optimum.parameters <= high))
    assert np.all(low >= [1.15, -0.2, -0.15, -0.05])
    assert optimum.kkt_residual < 1e-3


def test_multipliers_are_the_slopes_of_the_optimum_over_its_bounds(pretrained):
    """Against central differences of the optimal Cd in each bound, and in the end of a range."""
    given, step = {"max_length": 1.5, "thickness at 0.25 c": 0.6, "beta3": 0.03}, 1e-3

    def optimum(bounds):
        length, thickness, beta3 = bounds.values()
        more = {"stations": [Station(0.25, thickness)], "within": {"beta3": (-0.03, beta3)}}
        return optimise(Problem(pretrained.scene, 40.0, length, **more), pretrained)

    found = optimum(given)
    assert set(found.multipliers) == set(given)
    assert "thickness at 0.25 c +" in found.summary()
    for name, slope in found.multipliers.items():
        ends = [optimum(given | {name: given[name] + change}) for change in (step, -step)]
        differences = (ends[0].objective - ends[1].objective) / (2 * step)
        assert slope == pytest.approx(differences, rel=2e-2), name


def test_parameters_at_the_ends_of_their_ranges_are_named(pretrained):
    """Of the narrowed range too; a range without width has no end."""
    scene = pretrained.scene
    low, high = scene.family.bounds.T
    problem = Problem(scene, 40.0, within={"beta2": (-0.1, 0.1), "beta3": (0.02, 0.02)})
    names = scene.family.names
    body = dict(zip(names, (low + high) / 2, strict=True)) | {"beta3": 0.02, "beta2": 0.05}
    assert problem.at_range_ends(np.array(list(body.values()))) == []
    ends = body | {"aspect": high[names.index("aspect")], "beta2": -0.1}
    assert problem.at_range_ends(np.array(list(ends.values()))) == ["aspect", "beta2"]
    design = optimise(problem, pretrained)
    named = ", ".join(problem.at_range_ends(design.parameters))
    assert named
    assert named in design.summary().split("end of its range")[1]


def test_kkt_residual_of_a_known_problem(pretrained):
    """(p - centre)^2 with the centre inside: 0 at the end, and the optimum is the centre."""
    limits = Problem(pretrained.scene, 20.0).limits

    def bowl(body):
        return 1 + float(np.sum((body - BODY) ** 2)), 2 * (body - BODY)

    found = minimise_slsqp(bowl, limits, np.asarray(FAMILY.ellipse(2.0)))
    np.testing.assert_allclose(found.variables, BODY, atol=1e-5)
    assert found.kkt_residual < 1e-4
    assert found.feasible


CONFLICTS = [
    ({"max_length": 0.5, "min_thickness": 3.0}, r"max length 0.5: .* 1 D; min thickness 3: .*1.3"),
    ({"min_radius": 2.0}, "min radius 2: .* 0.5 D"),
    (
        {"max_length": 1.01, "min_thickness": 1.25, "min_radius": 0.001, "trust": 0.01},
        "contradict each other",
    ),
    (
        {"max_length": 1.2, "min_thickness": 0.3, "within": {"aspect": (2.0, 4.0)}},
        "max length 1.2 and ranges of the parameters contradict",
    ),
]


@pytest.mark.parametrize(("constraints", "message"), CONFLICTS)
def test_conflicts_are_named(pretrained, constraints, message):
    with pytest.raises(InvalidInput, match=message) as refusal:
        candidates(Problem(pretrained.scene, 20.0, **constraints))
    if "contradict" in message:
        assert "min radius" not in str(refusal.value)  # which has no part in it


def test_a_family_without_a_body_is_named_itself():
    scene = Scene(family=Family(aspect=(1, 3), beta2=(0.5, 0.9)))
    for constraints in ({}, {"max_length": 2.0}):
        with pytest.raises(InvalidInput, match="family: every body in its ranges"):
            candidates(Problem(scene, 20.0, **constraints))


def test_a_needle_of_feasible_bodies_is_found(pretrained):
    """Chance finds no such body; repair does."""
    problem = Problem(pretrained.scene, 20.0, max_length=1.002, min_thickness=1.3)
    assert not np.any(np.asarray(satisfied(drawn_bodies(problem.limits), problem.limits)))
    assert len(candidates(problem))
    assert optimise(problem, pretrained).kkt_residual < 1e-3


def test_nothing_recompiles_on_another_query(pretrained, compiled):
    optimise(Problem(pretrained.scene, 20.0, max_length=1.5), pretrained)
    compiled.clear()
    optimise(Problem(pretrained.scene, 7.0, min_thickness=0.8, trust=0.1), pretrained)
    optimise(Problem(pretrained.scene, 40.0, 1.3, within={"aspect": (1, 3)}), pretrained)
    assert not compiled


@pytest.mark.slow
def test_the_flows_own_optimum_is_one_from_every_start(tiny_scene):
    """Several Reynolds numbers: SLSQP from two bodies ends where the managed search does."""
    flow, weighted = Flow(tiny_scene), Weighted((5.0, 20.0), (1.0, 1.0))
    problem = Problem(tiny_scene, weighted, max_length=1.5)
    managed = optimise(problem, flow)
    for start in (None, managed.parameters + np.array([-0.2, 0.05, 0.02, 0])):
        direct = design_directly(problem, flow, start)
        assert direct.objective == pytest.approx(managed.objective, rel=2e-4)
        assert direct.kkt_residual <= 1e-3
        assert direct.objective < direct.start
    assert managed.kkt_residual <= 1e-2
    assert managed.flows % 2 == 0
    assert managed.green_applications > 20 * managed.flows


REFUSED = [
    ({"reynolds": "40"}, "must be one number"),
    ({"reynolds": []}, "Reynolds numbers: at least one is needed"),
    ({"reynolds": [10, 41]}, "covers 1 to 40"),
    ({"reynolds": np.nan}, "finite"),
    ({"reynolds": 41.0}, "covers 1 to 40"),
    ({"max_length": -1.0}, "max length -1: must be above 0, in D"),
    ({"min_thickness": "thin"}, "must be one number"),
    ({"within": {"length": (1, 2)}}, "range of length"),
    ({"within": {"aspect": (3, 2)}}, "low must not be above high"),
    ({"within": {"aspect": (1, 9)}}, "must lie within"),
    ({"trust": 0.5}, "from 0 to below 0.5"),
    ({"trust": 0.1, "within": {"aspect": (1, 1.1)}}, "contradict"),
    ({"stations": (Station(1.5, 0.2),)}, "between 0"),
]


@pytest.mark.parametrize(("change", "message"), REFUSED)
def test_problems_that_make_no_sense_are_refused(pretrained, change, message, unchecked):
    with pytest.raises(InvalidInput, match=message):
        Problem(**{"scene": pretrained.scene, "reynolds": 20.0, **change})


@pytest.mark.parametrize("number", [np.float32(20), np.int64(20), 20, np.asarray(20.0)])
def test_every_kind_of_number_is_a_number(pretrained, number, unchecked):
    assert Problem(pretrained.scene, number).objective.nominal == 20.0


def test_loads_without_bounds_are_free_in_slow_flow_too():
    """Where coefficients are large: these are about those of a disc at 45 degrees at Re 0.001."""
    family = Family(dimension=3, aspect=(0.1, 0.4), incidence=(0, 90))
    problem = Problem(Scene(dimension=3, reynolds=(0.001, 1), family=family), 0.001)
    loads = np.array([[3e4, -6e3, -5e3]])
    assert np.all(np.asarray(load_constraints(loads, problem.scenarios)) > 0)
