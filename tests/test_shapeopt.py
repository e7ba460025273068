"""Shape optimisation by both models, verification, runs, payoff arithmetic."""

import dataclasses
import json
import math
import pickle

import jax.numpy as jnp
import numpy as np
import pytest
from conftest import ARCHED, TINY
from pictures import pixels

import shapeopt
from shapeopt import (
    Design,
    Glide,
    LogNormal,
    Problem,
    Robust,
    Weighted,
    load_run,
    optimise,
    save_run,
    verify,
)
from shapeopt.commands import payoff_command
from shapeopt.commands.cli import Parser
from shapeopt.commands.optimize_shape import main as optimize_shape
from shapeopt.commands.problem_arguments import add_problem_arguments, problem_of
from shapeopt.payoff.break_even import Cost, Strategy, best_known, break_even, overtakes, pays_after
from shapeopt.payoff.plot import plot_payoff
from shapeopt.payoff.queries import query_stream, robust_objective
from shapeopt.payoff.strategies import comparable, rivals
from shapeopt.payoff.tables import payoff_rows
from shapeopt.problem.conflicts import candidates
from shapeopt.problem.constraints import constraint_values
from shapeopt.search.designer import Designer
from shapeopt.search.evaluated import EvaluatedDesign, best_design
from shapeopt.search.verify import drags_of_round_body
from surrogate import Family, Flow, InvalidInput, NotConverged, Scene, Tunnel, load


@pytest.fixture(scope="module")
def pretrained():
    return load("pretrained")


def test_optimum_is_no_worse_than_any_candidate(pretrained):
    problem = Problem(pretrained.scene, 20.0)
    optimum = optimise(problem, pretrained)
    drags = [float(pretrained.drag(jnp.asarray(p), 20.0)) for p in candidates(problem)[::50]]
    assert optimum.drag <= min(drags) + 1e-9
    assert optimum.calls > len(drags)


def test_optimum_is_stationary_inside_its_bounds(pretrained):
    """Move each free parameter a little: the predicted drag does not fall."""
    optimum = optimise(Problem(pretrained.scene, 1.0), pretrained)
    low, high = pretrained.scene.family.bounds.T
    for k in range(4):
        for step in (-0.01, 0.01):
            moved = optimum.parameters.copy()
            moved[k] = np.clip(moved[k] + step * (high - low)[k], low[k], high[k])
            assert float(pretrained.drag(jnp.asarray(moved), 1.0)) >= optimum.drag - 1e-6


@pytest.mark.parametrize(("length", "thick"), [(1.5, None), (None, 0.9), (1.4, 0.8)])
def test_constraints_hold_at_the_optimum(pretrained, length, thick):
    problem = Problem(pretrained.scene, 40.0, length, thick)
    optimum = optimise(problem, pretrained)
    assert np.all(np.asarray(constraint_values(optimum.parameters, problem.limits)) >= -1e-6)
    free = optimise(Problem(pretrained.scene, 40.0), pretrained)
    assert optimum.drag >= free.drag - 1e-9


def test_measures_of_a_body():
    body = jnp.array([4.0, 0, 0, 0])
    markers = np.asarray(Family().markers(body, 400))
    assert float(Family().body_class.length(body)) == pytest.approx(np.ptp(markers[:, 0]))
    assert float(Family().body_class.thickness(body)) == pytest.approx(np.ptp(markers[:, 1]))


def test_a_design_is_verified_where_the_cylinders_flow_does_not_converge(
    tiny_scene, monkeypatch, no_estimates
):
    solve, cylinder = Flow.solve, tiny_scene.family.ellipse(1.0)

    def solve_slender(flow, body, reynolds, **more):
        if np.array_equal(body, cylinder):
            raise NotConverged(f"Re {reynolds:g}")
        return solve(flow, body, reynolds, **more)

    monkeypatch.setattr(Flow, "solve", solve_slender)
    found = verify(Problem(tiny_scene, 20.0), [2.0, 0.0, 0.0, 0.0])
    assert (found.round_drags, found.round_objective) == ((None,), None)
    assert found.objective == found.solutions[0].drag > 0
    with pytest.raises(NotConverged, match="Re 10"):
        verify(Problem(tiny_scene, Weighted((10, 20), (1, 1))), [2.0, 0.0, 0.0, 0.0])


def test_problems_about_lift_are_not_compared_with_the_cylinder():
    scene = Scene(family=ARCHED, fidelity=TINY)
    for problem in (Problem(scene, Glide(10.0)), Problem(scene, 10.0, max_moment=0.1)):
        assert drags_of_round_body(problem) == (None,)
    assert not Problem(scene, 10.0).is_about_lift


def test_impossible_problems_name_the_constraint(pretrained):
    with pytest.raises(InvalidInput, match="max length"):
        candidates(Problem(pretrained.scene, 20.0, max_length=0.5))
    with pytest.raises(InvalidInput, match="min thickness 3"):
        candidates(Problem(pretrained.scene, 20.0, min_thickness=3.0))
    with pytest.raises(InvalidInput, match="covers 1 to 40"):
        Problem(pretrained.scene, 41.0)


def test_break_even():
    assert break_even(100.0, 1.0, 5.0) == 25.0
    assert break_even(100.0, 5.0, 1.0) == math.inf


def known_design(seconds, work, objective=1.0, flows=1):
    body, problem = np.array([2.0, 0.0, 0.0, 0.0]), Problem(Scene(), 20.0)
    cost = 0, flows, round(work), float(seconds)
    return Design(problem, body, objective, (objective, 0.0, 0.0), 1e-4, 2.0, body[None], *cost)


def example_strategies():
    direct = Strategy("direct", [Cost()], [[known_design(3, 110), known_design(5, 90, 1.02)]])
    sip = Strategy("sip", [Cost(30.0, 900.0)], [[known_design(1, 10, 1.01), known_design(1, 10)]])
    kriging = [[known_design(2, 100 / (k + 1)) for k in range(2)]]
    return direct, sip, Strategy("kriging with memory", [Cost()], kriging, keeps_flows=True)


def test_payoff_of_known_designs():
    direct, sip, kriging = example_strategies()
    found = pays_after(sip, direct, "seconds")
    assert found.designs == pytest.approx(10.0)
    assert found.low == pytest.approx(30 / 4)  # both queries the dearer one
    assert found.high == pytest.approx(30 / 2)
    assert pays_after(sip, direct, "green_applications").designs == pytest.approx(10.0)
    assert np.allclose(best_known([direct, sip]), 1.0)
    rows = payoff_rows([sip], [direct, kriging], seed=0)
    assert [row["method"] for row in rows] == ["direct", "kriging with memory", "sip"]
    assert [row["gap_max"] for row in rows] == pytest.approx([0.02, 0.0, 0.01])
    assert rows[2]["break_even_g"] == pytest.approx(10.0)
    assert rows[2]["g_per_design"] == 10.0
    assert rows[2]["kkt_max"] == 1e-4


def test_queries_that_one_strategy_does_not_answer_are_left_out_of_all(pretrained, monkeypatch):
    """Neither does a search that fails end those after it."""

    def design(problem, *_):
        if problem.reynolds < 20:
            raise NotConverged("no optimum")
        return known_design(1, 10, problem.reynolds)

    monkeypatch.setattr("shapeopt.payoff.strategies.design_directly", design)
    monkeypatch.setattr(Designer, "design", lambda _, problem: known_design(1, 5, problem.reynolds))
    queries = [Problem(pretrained.scene, reynolds) for reynolds in (10.0, 20.0, 30.0)]
    strategies, missing = comparable(rivals(queries, Flow(pretrained.scene)))
    assert [(one.query, one.strategy, one.reason) for one in missing] == [
        (0, "direct", "no optimum"),
        (0, "direct, from the nearest answer", "no optimum"),
    ]
    assert [[d.objective for d in s.designs[0]] for s in strategies] == [[20.0, 30.0]] * 3
    queries[1] = queries[0]
    with pytest.raises(NotConverged, match=r"2 of 3 queries .* query 1 by direct: no optimum"):
        comparable(rivals(queries, Flow(pretrained.scene)))


def test_a_payoff_is_kept_where_its_pictures_fail(pretrained, monkeypatch, tmp_path, capsys):
    """And pictures of an earlier one do not pass for its own."""

    def fail(*_):
        raise OSError("no display")

    direct, sip, kriging = example_strategies()
    for name, value in {
        "train_all": lambda *_: {"sip": pretrained},
        "compile_all": lambda *_: None,
        "rivals": lambda *_: [direct, kriging],
        "trained": lambda *_: sip,
        "trained_with_memory": lambda *_: dataclasses.replace(sip, name="sip, and kriging"),
        "_robust": lambda _: {"calls": 3, "seconds": 0.1},
        "_draw": fail,
    }.items():
        monkeypatch.setattr(payoff_command, name, value)
    stored = {"payoff": [], "queries": [], "settings": {"preset": "full"}}
    (tmp_path / "payoff.json").write_text(json.dumps(stored))
    (tmp_path / "payoff.png").write_bytes(b"old")
    with pytest.raises(OSError, match="no display"):
        payoff_command.main(["--queries", "2", "--out", str(tmp_path), "--overwrite"])
    assert "Robust design by the network alone: 3 drags" in capsys.readouterr().out
    record = json.loads((tmp_path / "payoff.json").read_text())
    assert [row["method"] for row in record["payoff"]][:2] == ["direct", "kriging with memory"]
    assert record["plot"] == str(tmp_path / "payoff.png")
    assert not (tmp_path / "payoff.png").exists()


def test_cumulative_costs_with_flows_kept_and_not():
    direct, sip, kriging = example_strategies()
    assert np.allclose(direct.cumulative("green_applications", 3), [100, 200, 300])
    assert np.allclose(kriging.cumulative("green_applications", 3), [100, 150, 225])
    assert np.allclose(sip.cumulative("seconds", 4), [31, 32, 33, 34])
    assert overtakes(sip, direct, "green_applications") == 10
    assert overtakes(direct, sip, "green_applications") == 1
    assert overtakes(direct, kriging, "green_applications") == 1


def test_queries_are_solvable_and_repeat(pretrained):
    first, again = (query_stream(pretrained.scene, 3, 4) for _ in range(2))
    assert [q.reynolds for q in first] == [q.reynolds for q in again]
    assert len({q.reynolds for q in first}) == 4
    assert all(len(candidates(q)) for q in first)


@pytest.mark.parametrize("reynolds", [(1, 40), (20, 25), (20, 20)])
def test_the_robust_objective_of_a_payoff_suits_every_range(reynolds):
    objective = robust_objective(Scene(reynolds=reynolds))
    cases = objective.scenarios(Scene(reynolds=reynolds)).reynolds
    assert reynolds[0] <= min(cases) <= objective.reynolds <= max(cases) <= reynolds[1]
    assert (min(cases) < max(cases)) == (reynolds[0] < reynolds[1])


def test_payoff_plot_names_its_axes(tmp_path, monkeypatch):
    figures = []
    monkeypatch.setattr(
        "shapeopt.payoff.plot.save_figure", lambda f, path: figures.append(f) or path
    )
    plot_payoff(example_strategies(), tmp_path / "payoff.png")
    labels = [axis.get_ylabel() for axis in figures[0].axes]
    assert labels == ["cumulative convolutions (G)", "cumulative wall seconds"]


def test_what_does_not_fit_the_scene_is_refused(pretrained, unchecked):
    elsewhere = dataclasses.replace(pretrained.scene, stream=Tunnel(16.0))
    with pytest.raises(InvalidInput, match="different scenes"):
        optimise(Problem(elsewhere, 20.0), pretrained)
    with pytest.raises(InvalidInput, match="is no drag model"):
        optimise(Problem(pretrained.scene, 20.0), "pretrained")
    with pytest.raises(InvalidInput, match="'surrogate' or 'flow'"):
        optimise(Problem(pretrained.scene, 20.0), pretrained, until="dawn")
    with pytest.raises(InvalidInput, match="larger than those"):
        verify(Problem(pretrained.scene, 20.0), np.array([9.0, 0.0, 0.0, 0.0]))


def test_public_names_are_listed_and_documented():
    assert dir(shapeopt) == sorted(shapeopt.__all__)
    for name in shapeopt.__all__:
        assert getattr(shapeopt, name).__doc__


@pytest.fixture(scope="module")
def designed(tiny_scene):
    """A design on the flow, at two Reynolds numbers."""
    objective = Robust(20.0, LogNormal(0.2), cases=2)
    problem = Problem(tiny_scene, objective, max_length=1.5)
    return optimise(problem, Flow(tiny_scene))


@pytest.mark.slow
def test_an_optimum_carries_the_flows_status_and_estimated_error(designed):
    design, verified = designed, designed.verified
    assert verified.objective == pytest.approx(design.objective, rel=1e-5)
    assert verified.status == "degraded"  # on so coarse a grid
    assert verified.accuracy.startswith("does not meet 1.5 % (expected ")
    assert verified.estimated_error == max(s.estimated_error for s in verified.solutions)
    assert verified.expected_error < verified.estimated_error
    assert verified.round_objective > verified.objective
    assert design.drag == pytest.approx(
        float(Flow(design.problem.scene).drag(design.parameters, 20.0))
    )


def test_a_design_is_pickled_without_its_flows(designed, no_estimates):
    design = dataclasses.replace(designed)  # the fixture's own is verified with estimates
    assert design.verified.status
    copy = pickle.loads(pickle.dumps(design))
    assert copy.objective == design.objective
    assert "verified" not in vars(copy)


def test_a_run_is_saved_and_loaded_and_other_files_stay(designed, tmp_path, no_estimates):
    folder, designed = tmp_path / "run", dataclasses.replace(designed)
    record = save_run(folder, designed)
    assert load_run(folder) == record
    assert record["cd_verified"] == designed.verified.objective
    assert record["until"] == "flow"
    assert [case["status"] for case in record["cases"]]
    assert len(record["cases"]) == 2
    (folder / "notes.txt").write_text("mine")
    (folder / "sub").mkdir()
    save_run(folder, designed, verify=False)
    assert (folder / "notes.txt").read_text() == "mine"
    assert (folder / "sub").is_dir()
    assert load_run(folder)["cd_verified"] is None
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "chapter.tex").write_text("mine")
    with pytest.raises(InvalidInput, match="not empty"):
        save_run(tmp_path / "thesis", designed)


def test_a_record_says_whether_the_search_converged(designed, tmp_path):
    """By the KKT residual, not because there is a record."""
    assert save_run(tmp_path / "run", designed, verify=False)["converged"]
    rough = dataclasses.replace(designed, kkt_residual=0.3)
    assert not save_run(tmp_path / "run", rough, verify=False)["converged"]
    assert not load_run(tmp_path / "run")["converged"]


@pytest.mark.slow
def test_a_family_of_eight_parameters_is_optimised_on_the_flow(tiny_scene):
    ranges = {f"beta{k}": (-0.05, 0.05) for k in range(2, 9)}
    scene = dataclasses.replace(tiny_scene, family=Family(aspect=(1.0, 3.0), **ranges))
    design = optimise(Problem(scene, 20.0, max_length=1.5), Flow(scene))
    assert len(design.parameters) == 8
    assert design.kkt_residual <= 1e-3
    assert design.drag < design.start
    assert float(Family().body_class.length(design.parameters)) <= 1.5 + 1e-6


def test_payoff_plot_is_not_blank(tmp_path, capfd):
    pixels(plot_payoff(example_strategies(), tmp_path / "payoff.png"))
    assert capfd.readouterr().err == ""


def test_a_nearly_optimal_body_is_preferred_to_one_of_lower_drag():
    """Which may violate a bound on the lift; local optima come first in any case."""

    def evaluated(value, residual):
        none, body = np.zeros(0), np.ones(2)
        return EvaluatedDesign(body, value, 0 * body, residual, none, np.zeros((0, 2)), none)

    wrong, near, optimum = evaluated(1.0, 0.3), evaluated(2.0, 4e-3), evaluated(3.0, 1e-4)
    assert best_design([wrong, near]) is near
    assert best_design([wrong, near, optimum]) is optimum
    assert best_design([wrong, evaluated(2.0, 0.2)]) is wrong


def test_a_run_that_is_not_verified_has_the_surrogates_drag_and_no_flow(tmp_path, monkeypatch):
    """Also where the objective is not Cd itself."""
    net = load("pretrained:lift")
    problem, body = Problem(net.scene, Glide(np.float32(40)), max_length=2.0), np.zeros(7)
    body[[0, -1]] = 2.0, 4.0
    loads = tuple(net.loads(body, 40.0).tolist())
    cost = (0, 0, 0, 1.0)
    design = Design(problem, body, -loads[1] / loads[0], loads, 1e-4, 2.0, body[None], *cost)
    monkeypatch.setattr(Flow, "solve", None)
    record = save_run(tmp_path / "run", design, net, "pretrained:lift", verify=False)
    assert record["cd_surrogate"] == pytest.approx(design.drag)
    assert record["cd_verified"] is None
    assert record["until"] == "surrogate"
    assert load_run(tmp_path / "run")["reynolds"] == 40.0


def test_a_run_has_the_constraints_that_are_set(tmp_path):
    bounds = {
        "max_length": 2.0,
        "stations": [(0.3, 0.2)],
        "lift": 0.1,
        "within": {"aspect": (2, 3)},
    }
    scene = Scene(family=ARCHED, fidelity=TINY, reynolds=(5, 20))
    problem = Problem(scene, 10.0, **bounds)
    body = np.array([2.0, 0.1, 5.0])
    design = Design(problem, body, 1.0, (2.0, 0.0, 0.0), 1e-4, 2.0, body[None], 0, 1, 100, 1.0)
    record = save_run(tmp_path / "run", design, verify=False)
    as_lists = {"stations": [[0.3, 0.2]], "within": {"aspect": [2.0, 3.0]}}
    assert record["constraints"] == bounds | as_lists
    assert load_run(tmp_path / "run") == record


@pytest.mark.parametrize("glide", [False, True])
def test_loads_of_a_robust_run_are_those_of_its_body(tmp_path, no_estimates, glide):
    """Not those of one of the cases; each case says to which Re its flow is steady."""
    scene = Scene(family=ARCHED, fidelity=TINY, reynolds=(5, 20))
    objective = Robust(10.0, LogNormal(0.3), tolerance=0.02, cases=2, glide=glide)
    body = np.array([2.0, 0.1, 5.0])
    problem = Problem(scene, objective)
    design = Design(problem, body, 1.0, (2.0, 0.0, 0.0), 1e-4, 2.0, body[None], 0, 1, 100, 1.0)
    record = save_run(tmp_path / "run", design)
    found = Flow(scene).solve(body, 10.0, estimate=False)
    assert record["cl_verified"] == pytest.approx(found.lift, rel=1e-6)
    assert record["cm_verified"] == pytest.approx(found.moment, rel=1e-6)
    assert record["cl_verified"] not in [case["cl_verified"] for case in record["cases"]]
    assert all(case["onset"] > 20 for case in record["cases"])
    loads = [(case["cd_verified"], case["cl_verified"]) for case in record["cases"]]
    if glide:
        assert record["cd_verified"] == pytest.approx(found.drag, rel=1e-6)
        assert record["glide"] == pytest.approx(np.mean([cl / cd for cd, cl in loads]))
    else:
        assert record["cd_verified"] == pytest.approx(np.mean([cd for cd, _ in loads]))
        assert "glide" not in record


def test_the_glide_ratio_may_be_asked_for_under_uncertainty():
    net, parser = load("pretrained:lift"), Parser("Parse a problem.")
    add_problem_arguments(parser)

    def objective(words):
        return problem_of(parser.parse_args(words.split()), net).objective

    glide = "--objective glide --reynolds 40"
    asked = objective(f"{glide} --spread 0.2 --tolerance 0.01 --cvar 0.8 --cases 8 --seed 3")
    assert asked == Robust(40.0, LogNormal(0.2), 0.01, 0.8, 8, 3, glide=True)
    assert objective(glide) == Glide(40.0)
    with pytest.raises(InvalidInput, match="--spread: belongs to one Reynolds number"):
        objective(f"{glide},50 --spread 0.2")
    with pytest.raises(InvalidInput, match=r"--objective glide: goes with one Reynolds number$"):
        objective(f"{glide},50")
    with pytest.raises(InvalidInput, match="tumbling: goes with one Reynolds number, without spr"):
        objective("--objective tumbling --reynolds 40 --spread 0.2")


def test_weights_without_several_reynolds_numbers_are_refused(tmp_path):
    words = ["--surrogate", "pretrained:lift", "--reynolds", "40", "--weights", "1,2"]
    with pytest.raises(InvalidInput, match="--weights: does not go with --objective glide"):
        optimize_shape([*words, "--objective", "glide", "--out", str(tmp_path / "run")])


def test_a_design_beyond_its_onset_says_so(tmp_path, capsys, no_estimates):
    """The steady flow past the best wide body at Re 45 is unstable."""
    slight = dict.fromkeys(("beta2", "beta3", "beta4"), (-1e-3, 1e-3))  # nearly ellipses
    scene = Scene(family=Family(aspect=(0.5, 0.6), **slight), reynolds=(1, 45), fidelity=TINY)
    scene.write(tmp_path / "wide.toml")
    words = ["--surrogate", "none", "--scene", str(tmp_path / "wide.toml"), "--reynolds", "45"]
    record = optimize_shape([*words, "--until", "flow", "--out", str(tmp_path / "run")])
    assert record["cases"][0]["onset"] < 45
    assert "Re 45 is beyond the estimated onset of instability, Re 30" in capsys.readouterr().out
    optimize_shape([*words, "--until", "flow", "--out", str(tmp_path / "run")])
    assert "beyond the estimated onset" in capsys.readouterr().out  # of the stored run
