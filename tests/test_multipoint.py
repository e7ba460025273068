"""One section for several lifts: a known polar, gradients and optima of the flow, refusals."""

import numpy as np
import pytest
from polar import CURVES, SCENE, Polar
from taylor import taylor_rates

from shapeopt import Designer, MultiPoint, Problem, load_run, save_run, verify
from shapeopt.commands.optimize_shape import bound_lines
from shapeopt.search.optimality import KKT_TOLERANCE, Derivatives, multipliers
from shapeopt.search.over_lift import designs_over_lift
from shapeopt.search.propose import propose, propose_all
from surrogate import Family, Flow, InvalidInput, NotConverged, Scene


def test_one_section_for_several_lifts_of_a_known_polar():
    """Each lift has its own incidence; beside problems of fewer variables it is the same."""
    several = Problem(SCENE, MultiPoint(10.0, (0.5, 1.0, 1.5), (1, 1, 2)))
    single = Problem(SCENE, 10.0, lift=1.25)
    alone = propose(several, Polar())
    found, bound = propose_all([several, single], Polar())
    for one in (alone, found):
        assert one.variables[3:] == pytest.approx([2.0, 4.0, 6.0], rel=1e-6)
        assert one.value == pytest.approx(2 + np.average([0.125, 0.5, 1.125], weights=(1, 1, 2)))
        assert one.kkt_residual < 1e-6
        known = one.gradient, one.of_loads, one.by_loads, 2 + np.array([0.125, 0.5, 1.125])
        slopes = multipliers(several, one.variables, Derivatives(*known))
        assert slopes == pytest.approx({"lift 0.5": 0.125, "lift 1": 0.25, "lift 1.5": 0.75})
    assert bound.variables.shape == (4,)
    assert bound.variables[3] == pytest.approx(5.0, rel=1e-7)
    assert several.variables[4:] == ("incidence at lift 1", "incidence at lift 1.5")
    with pytest.raises(NotConverged, match=r"lift 3\.5 is out of reach .* Cl 3$"):
        propose(Problem(SCENE, MultiPoint(10.0, (0.5, 1.0, 3.5))), Polar())
    within = {"incidence": (0.0, 4.0)}
    ends = propose(Problem(SCENE, MultiPoint(10.0, (0.2, 0.5, 1.0)), within=within), Polar())
    assert ends.variables[5] == pytest.approx(4.0, abs=1e-6)


def test_several_lifts_that_cannot_be_are_refused():
    with pytest.raises(InvalidInput, match="lifts: the bodies of this scene have no lift"):
        Problem(Scene(), MultiPoint(10.0, (0.1, 0.2)))
    cambered = Scene(family=Family(aspect=(1, 2), gamma2=(-0.1, 0.1)))
    with pytest.raises(InvalidInput, match="lifts: bodies need an incidence"):
        Problem(cambered, MultiPoint(10.0, (0.1, 0.2)))
    with pytest.raises(InvalidInput, match="lifts: two or more different lower bounds"):
        MultiPoint(10.0, (0.1,))
    with pytest.raises(InvalidInput, match="weights: 1 for 2 lifts; give one for each"):
        MultiPoint(10.0, (0.1, 0.2), (1.0,))
    with pytest.raises(InvalidInput, match="lift: the objective has a bound on the lift in each"):
        Problem(SCENE, MultiPoint(10.0, (0.1, 0.2)), lift=0.1)
    with pytest.raises(InvalidInput, match=r"one number for each of aspect, .* at lift 0\.2 is"):
        verify(Problem(SCENE, MultiPoint(10.0, (0.1, 0.2))), [2.0, 0.0, 0.0, 1.0])


def test_gradients_over_several_lifts_are_those_of_the_flow():
    """By all variables, the incidences of the lifts among them: second-order Taylor remainders."""
    problem = Problem(SCENE, MultiPoint(10.0, (0.1, 0.2), (1.0, 2.0)), max_moment=0.3)
    at, direction = np.array([1.7, 0.1, 0.2, 2.0, 5.0]), np.array([0.3, 0.05, 0.05, 2.0, 3.0])
    rates = taylor_rates(problem, at, direction)
    assert np.all(rates > 1.9), rates


def test_a_section_for_several_lifts_is_an_optimum_of_the_flow(tmp_path, no_estimates):
    """An ellipse of one aspect has at each lift the incidence that it has for this lift alone."""
    designer, within = Designer(Flow(SCENE)), {"aspect": (2.0, 2.0)}
    within |= dict.fromkeys(CURVES, (0.0, 0.0))
    design = designer.design(Problem(SCENE, MultiPoint(10.0, (0.05, 0.1)), within=within))
    assert design.kkt_residual <= KKT_TOLERANCE
    rows, *_ = designs_over_lift(designer, 10.0, [0.05, 0.1], within=within)
    alone = [row["parameters"]["incidence"] for row in rows]
    assert design.variables[3:] == pytest.approx(alone, abs=0.02)
    assert design.objective == pytest.approx(np.mean([row["cd"] for row in rows]), rel=1e-4)
    assert f"{design.variables[4]:.4g}" in design.summary().split("incidence at lift 0.1")[1]
    record = save_run(tmp_path / "run", design)
    assert [case["cl_verified"] for case in record["cases"]] == pytest.approx([0.05, 0.1], abs=2e-3)
    assert [case["parameters"][3] for case in record["cases"]] == design.variables[3:].tolist()
    assert record["objective"]["lifts"] == [0.05, 0.1]
    assert record["violated"] == {}
    assert record["about_lift"]
    lines = bound_lines(load_run(tmp_path / "run"), design.problem)
    assert lines[1].startswith(f"  lift 0.1: incidence {design.variables[4]:.4g}, Cd ")
