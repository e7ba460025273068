"""Models of Cd, Cl and Cm: mirror symmetry, kriging, glide ratio, bounds on loads, commands."""

import csv
import dataclasses
import json

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from conftest import SECTIONS
from pictures import pixels
from polar import CURVES, SCENE, Polar

from shapeopt import (
    Design,
    Designer,
    Glide,
    Problem,
    Robust,
    Uniform,
    optimise,
    optimise_all,
    save_run,
)
from shapeopt.commands.cli import run
from shapeopt.commands.design_sheet import main as design_sheet
from shapeopt.commands.optimize_shape import bound_lines
from shapeopt.commands.optimize_shape import main as optimize_shape
from shapeopt.commands.predict_drag import main as predict_drag
from shapeopt.payoff.direct import design_directly
from shapeopt.payoff.queries import query_stream
from shapeopt.render.sheets import origin
from shapeopt.search.optimality import KKT_TOLERANCE
from shapeopt.search.over_lift import designs_over_lift
from shapeopt.search.propose import propose_all
from shapeopt.search.verify import violated_bounds
from surrogate import Family, Fidelity, Flow, InvalidInput, NotConverged, Scene, load, train
from surrogate.flow.solver import steady
from surrogate.model.inputs import scene_inputs
from surrogate.model.kriging import Observation, kriging
from surrogate.model.network import blank_network
from surrogate.model.outputs import gradients_of_loads, gradients_of_outputs, loads_of, outputs_of

BODY = jnp.array([2.0, 0.1, 0.2, 6.0])
MIRROR = jnp.array([1.0, 1.0, -1.0, -1.0])
OPPOSITE = jnp.array([1.0, -1.0, -1.0])  # loads of the mirror image over those of the body
REVERSED, TURNED_BACK = [2.0, -0.2, 0.1, 210.0], [2.0, -0.2, 0.1, 150.0]
RE = jnp.asarray(10.0)
LOADS = jnp.array([2.0, -0.3, 0.1])


def smooth_loads(parameters, reynolds):
    """Known loads with the mirror symmetry."""
    aspect, beta2, gamma2, incidence = parameters
    attack = incidence / 20 + gamma2
    cd = jnp.exp(1 - 0.6 * jnp.log(reynolds) + (jnp.log(aspect) - 0.8) ** 2 + beta2 * attack**2)
    cl = jnp.log(aspect) * attack - 0.2 * gamma2**3 + 0.1 * jnp.sin(attack)
    return jnp.stack([cd, cl, 0.2 * cl + 0.1 * beta2 * gamma2])


def observe(parameters, reynolds):
    def outputs(p, log_re):
        return outputs_of(smooth_loads(p, jnp.exp(log_re)))

    by_body, by_re = jax.jacobian(outputs, (0, 1))(jnp.asarray(parameters), np.log(reynolds))
    slopes = np.column_stack([by_body, by_re])
    return Observation(parameters, reynolds, np.asarray(smooth_loads(parameters, reynolds)), slopes)


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """A surrogate of sections, trained in seconds."""
    folder = tmp_path_factory.mktemp("trained") / "sections"
    net = train(SCENE, "supervised", samples=12, preset="quick", progress=False, out=folder)
    return folder, net


def test_outputs_and_their_gradients_are_inverted_exactly():
    np.testing.assert_allclose(loads_of(outputs_of(LOADS)), LOADS, rtol=1e-14)
    gradients = jnp.arange(6.0).reshape(3, 2) + 1
    there = gradients_of_outputs(LOADS, gradients)
    np.testing.assert_allclose(gradients_of_loads(LOADS, there), gradients, rtol=1e-13)
    np.testing.assert_allclose(there[1], gradients[1] / 2 + 0.3 / 4 * gradients[0], rtol=1e-13)


def test_a_network_of_any_weights_has_the_mirror_symmetry():
    blank = blank_network(SCENE, (7, 7), jax.random.key(0))
    network = eqx.tree_at(lambda net: net.inputs, blank, scene_inputs(SCENE))
    scales = jnp.ones(network.modes.count)
    network = eqx.tree_at(lambda net: net.mode_scale, network, scales)
    weights = jax.random.normal(jax.random.key(1), network.weights.shape)
    network = network.with_weights(weights)
    ours, theirs = network.loads(BODY, RE), network.loads(MIRROR * BODY, RE)
    np.testing.assert_allclose(theirs, OPPOSITE * ours, rtol=1e-12)
    assert np.all(np.abs(ours) > 1e-3)
    tractions = [network.traction(body, RE) for body in (BODY, MIRROR * BODY)]
    np.testing.assert_allclose(tractions[1], network.modes.mirror * tractions[0], rtol=1e-10)
    drag, lift = -2 * tractions[0][jnp.array([0, network.modes.lift_index])]
    np.testing.assert_allclose([drag, lift], ours[:2], rtol=1e-12)
    assert network.with_load_weights(network.load_weights).weights == pytest.approx(weights)


def test_a_network_of_bodies_in_space_has_their_symmetries_at_any_angle():
    """A body reversed and turned by 180 degrees is the same; round ones have no lift at 90."""
    family = Family(3, aspect=(1, 4), beta2=(-0.3, 0.2), beta3=(-0.2, 0.2), incidence=(0, 90))
    scene = Scene(dimension=3, reynolds=(1, 50), family=family)
    network = blank_network(scene, (8, 8), jax.random.key(0))
    network = eqx.tree_at(lambda net: net.inputs, network, scene_inputs(scene))
    rng = np.random.default_rng(0)
    trends = tuple(jnp.asarray(rng.normal(size=trend.size)) for trend in network.trends)
    network = eqx.tree_at(lambda net: net.trends, network, trends)
    same, mirrored = (network.loads(jnp.array(body), RE) for body in (REVERSED, TURNED_BACK))
    loads = network.loads(jnp.array([2.0, 0.2, 0.1, 30.0]), RE)
    np.testing.assert_allclose(same, loads, rtol=1e-12)
    np.testing.assert_allclose(mirrored, OPPOSITE * loads, rtol=1e-12)
    assert np.abs(loads[1:]).min() > 1e-3 * loads[0]
    across = network.loads(jnp.array([2.0, 0.0, 0.1, 90.0]), RE)
    assert np.abs(across[1:]).max() < 1e-12 * across[0]


def test_flows_of_mirror_images_have_mirrored_modes():
    flow = Flow(SCENE)
    one, image = (flow.solve(body, 10.0, estimate=False) for body in (BODY, MIRROR * BODY))
    mirror = one.domain.modes.mirror
    scale = float(jnp.abs(one.state.amplitude).max())
    np.testing.assert_allclose(
        image.state.amplitude, mirror * one.state.amplitude, atol=1e-5 * scale
    )


def test_responses_of_many_modes_are_exact_near_the_body_and_good_far_from_it():
    """Eight combinations of 38 modes, on a lattice of which the box near the body is a part."""
    flow = Flow(Scene(family=SECTIONS, fidelity=Fidelity("wide", 8, 4, 8, 8, 5, wake=0.0)))
    domain, markers = flow.domain, flow.bodies.markers(BODY)
    operators = jax.jit(steady.assemble, static_argnames="domain")(domain, markers, RE)
    modes = jnp.eye(domain.modes.count)
    full = jax.vmap(lambda a: operators.green(operators.body.spread(a)))(modes)
    found = jax.vmap(operators.response)(modes.astype(jnp.float32))
    size = float(jnp.linalg.norm(full))
    corner, near = domain.near
    box = tuple(slice(start, start + side) for start, side in zip(corner, near.shape, strict=True))
    assert near.shape < domain.lattice.shape
    np.testing.assert_allclose(found[..., *box], full[..., *box], atol=2e-5 * jnp.abs(full).max())
    assert float(jnp.linalg.norm(found - full)) < 0.05 * size
    slips = jax.vmap(operators.body.slip)(full).T
    np.testing.assert_allclose(
        operators.response.slips(operators.body), slips, atol=1e-5 * jnp.abs(slips).max()
    )


def test_kriging_of_loads_interpolates_and_has_the_mirror_symmetry(generator):
    low, high = SECTIONS.bounds.T
    bodies = generator.uniform(low, high, (20, 4))
    flows = [observe(p, float(np.exp(generator.uniform(np.log(5), np.log(20))))) for p in bodies]
    model = kriging(flows[:16], scene_inputs(SCENE))
    for flow in flows[:16]:
        found = model.loads(jnp.asarray(flow.parameters), jnp.asarray(flow.reynolds))
        np.testing.assert_allclose(found, flow.loads, atol=3e-4 * flow.drag)
    for flow in flows[16:]:
        found = model.loads(jnp.asarray(flow.parameters), jnp.asarray(flow.reynolds))
        np.testing.assert_allclose(found, flow.loads, atol=0.03 * flow.drag)
        image = model.loads(MIRROR * flow.parameters, jnp.asarray(flow.reynolds))
        np.testing.assert_allclose(image, OPPOSITE * found, atol=1e-9)
    spread = np.std([flow.loads[1] / flow.drag for flow in flows[16:]])
    assert spread > 0.1  # or the test would prove little


ELLIPSE = {"aspect": (2.0, 2.0), "beta2": (0.0, 0.0)}
WITHOUT_MOMENT = {"min_moment": 0.0, "max_moment": 0.0}
FLAT = Problem(SCENE, Glide(10.0), **WITHOUT_MOMENT, max_camber=0.1, within=ELLIPSE)


def on_polar(*problems):
    """Optima on the polar: of these problems, of ``FLAT`` and of one with three cases.

    With the last two every call has the same padding, so that all are one program.
    """
    robust = Problem(SCENE, Robust(10.0, Uniform(0.2), cases=3, glide=True))
    return propose_all([*problems, FLAT, robust], Polar())


def test_optima_of_a_known_polar():
    problems = [Problem(SCENE, Glide(10.0)), Problem(SCENE, 10.0, lift=1.25)]
    problems.append(Problem(SCENE, Glide(10.0), **WITHOUT_MOMENT))
    glide, bound, trimmed, flattened, robust = on_polar(*problems)
    assert glide.value == pytest.approx(-0.5, rel=1e-9)
    assert robust.value == pytest.approx(-0.5, rel=1e-9)  # this polar is the same at every Re
    assert glide.variables[3] == pytest.approx(8.0, rel=1e-4)
    assert bound.variables[3] == pytest.approx(5.0, rel=1e-7)
    assert bound.value == pytest.approx(2 + 1.25**2 / 2, rel=1e-7)
    assert bound.kkt_residual < 1e-6
    assert trimmed.variables[2] == pytest.approx(0.3, abs=1e-6)  # all that camber can balance
    assert trimmed.variables[3] == pytest.approx(4.8, rel=1e-5)
    assert flattened.variables[2] == pytest.approx(
        0.1 / np.sqrt(1 / 2), rel=1e-5
    )  # camber 2 b gamma2
    with pytest.raises(
        InvalidInput, match=r"max camber 0\.1 and ranges of the parameters contradict"
    ):
        on_polar(dataclasses.replace(FLAT, within=ELLIPSE | {"gamma2": (0.2, 0.3)}))
    with pytest.raises(NotConverged, match=r"lift 3\.5 is out of reach .* Cl 3$"):
        on_polar(Problem(SCENE, 10.0, lift=3.5))


def test_bodies_over_lift_are_optima_of_the_flow_and_share_its_flows():
    flow, states = Flow(SCENE), []
    designer, within = Designer(flow), {"aspect": (1.5, 2.0)} | dict.fromkeys(CURVES, (0.0, 0.0))
    rows, best, _ = designs_over_lift(
        designer, 10.0, [0.0, 0.1], lambda done, state: states.append((done, state)), within=within
    )
    assert [row["lift"] for row in rows] == [0.0, 0.1]
    for row in (*rows, best):
        assert row["kkt_residual"] <= KKT_TOLERANCE
        assert row["lift"] is None or row["cl"] >= row["lift"] - KKT_TOLERANCE * row["cd"]
        loads = flow.loads(SECTIONS.parameters(row["parameters"]), 10.0)
        np.testing.assert_allclose([row["cd"], row["cl"], row["cm"]], loads, rtol=1e-6)
    total = sum(row["flows"] for row in (*rows, best))
    assert total == designer.memory.flows > 0
    assert states[0] == (0.0, "design 1 of 3, 0 flows so far")
    assert states[-1] == (1.0, f"3 designs, {total} flows")
    again, same, _ = designs_over_lift(designer, 10.0, [0.0, 0.1], within=within)
    assert [row["flows"] for row in (*again, same)] == [0, 0, 0]  # they are in the memory
    assert [row["cd"] for row in (*again, same)] == [row["cd"] for row in (*rows, best)]


def test_bodies_over_lift_that_are_out_of_reach_say_why():
    net = load("pretrained:lift")
    ellipse = {"aspect": (2.0, 2.0)} | dict.fromkeys(
        ("beta2", "beta3", "beta4", "gamma2", "gamma3"), (0.0, 0.0)
    )
    rows, best, _ = designs_over_lift(net, 40.0, [0.1, 2.5], within=ellipse)
    assert rows[0]["why_not"] is None
    assert rows[0]["cl"] == pytest.approx(0.1, abs=1e-6)
    assert rows[1]["cd"] is None
    assert "lift 2.5 is out of reach" in rows[1]["why_not"]
    assert best["at_range_ends"] == ["incidence"]
    with pytest.raises(NotConverged, match=r"lift 2\.5 is out of reach"):
        designs_over_lift(net, 40.0, [2.5, 2.5], within=ellipse)


def test_bodies_over_lift_are_kept_where_the_best_glide_is_not_found(monkeypatch):
    net, body = load("pretrained:lift"), np.array([2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 4.0])
    problem, cost = Problem(net.scene, 40.0, lift=0.1), (0, 1, 100, 1.0)
    design = Design(problem, body, 1.0, (1.5, 0.1, 0.0), 1e-4, 2.0, body[None], *cost)
    found = [design, NotConverged("no glider")]
    monkeypatch.setattr("shapeopt.search.over_lift.optima", lambda *_: found)
    (row,), best, _ = designs_over_lift(net, 40.0, [0.1])
    assert (row["cl"], row["why_not"]) == (0.1, None)
    assert (best["cd"], best["why_not"]) == (None, "no glider")


def test_a_sheet_over_lifts_has_the_constraints_of_a_design(monkeypatch, tmp_path, capsys):
    seen = {}

    def noted(model, reynolds, lifts, progress, **bounds):
        seen.update(bounds)
        raise InvalidInput("enough")

    monkeypatch.setattr("shapeopt.commands.design_sheet.designs_over_lift", noted)
    sheet = ["--surrogate", "pretrained:lift", "--reynolds", "40", "--lifts", "0.3", "--max-length"]
    sheet += [
        "1.9",
        "--max-moment",
        "0.1",
        "--range",
        "aspect=2:3",
        "--out",
        str(tmp_path / "s.png"),
    ]
    assert run(design_sheet, sheet) == 2
    assert "enough" in capsys.readouterr().err
    bounds = {name: value for name, value in seen.items() if value}
    expected = {"max_length": 1.9, "max_moment": 0.1, "within": {"aspect": (2.0, 3.0)}}
    assert bounds == expected
    assert Problem(load("pretrained:lift").scene, 40.0, **seen).constraints == expected


def test_a_sheet_with_a_lift_out_of_reach_shows_the_other_bodies(tmp_path, capsys):
    out = tmp_path / "sheet.png"
    sheet = ["--surrogate", "pretrained:lift", "--reynolds", "140,140", "--lifts", "0.3,0.3,2.5"]
    table = tmp_path / "bodies.csv"
    assert run(design_sheet, [*sheet, "--out", str(out), "--table", str(table), "--json"]) == 3
    printed = capsys.readouterr()
    assert "1 of 3 bodies were not found: Cl >= 2.5 at Re 140: " in printed.err
    result = json.loads(printed.out)
    assert [row["lift"] for row in result["designs"]] == [0.3, 2.5]
    assert result["best_glide"]["onset"] < 140 < result["designs"][0]["onset"]
    assert result["until"] == "surrogate"
    lines, first = list(csv.DictReader(table.open())), result["designs"][0]
    assert float(lines[0]["parameters.aspect"]) == first["parameters"]["aspect"]
    assert lines[0]["at_range_ends"].split() == first["at_range_ends"]
    assert len(lines) == 3
    pixels(out)


def test_a_moment_that_is_given_is_met():
    found, *_ = on_polar(Problem(SCENE, 10.0, min_moment=0.2, max_moment=0.2))
    assert found.kkt_residual < 1e-6
    loads = Polar().loads(found.variables, RE)
    assert float(loads[2]) == pytest.approx(0.2, abs=1.1e-5)


def test_a_list_of_one_reynolds_number_is_that_number():
    assert Problem(SCENE, [10.0], lift=0.1).objective == Problem(SCENE, 10.0, lift=0.1).objective


def test_queries_with_lift_bound_loads_and_hold_incidences():
    queries = query_stream(SCENE, 3, 24)
    assert [str(one) for one in queries] == [str(one) for one in query_stream(SCENE, 3, 24)]
    glides = [one for one in queries if isinstance(one.objective, Glide)]
    held = [one for one in glides if one.within]
    bounded = [one for one in queries if one.max_moment is not None]
    assert 0 < len(held) < len(glides) < len(queries) > len(bounded) > 0
    for one in queries:
        assert (one.lift is None) == (one in glides)
        low, high = (one.within or {}).get("incidence", (-4.0, -4.0))
        assert -4 <= low == high <= 12


def test_loads_of_symmetric_bodies_are_refused():
    with pytest.raises(InvalidInput, match="lift: the bodies of this scene have no lift"):
        Problem(Scene(), 10.0, lift=0.2)
    with pytest.raises(InvalidInput, match="glide: the bodies of this scene have no lift"):
        optimise(Problem(Scene(), Glide(10.0)), load("pretrained"))
    with pytest.raises(InvalidInput, match="glide: the bodies of this scene have no lift"):
        Problem(Scene(), Robust(10.0, 0.2, glide=True))
    with pytest.raises(InvalidInput, match="lift nan"):
        Problem(SCENE, 10.0, lift=float("nan"))
    symmetric = load("pretrained").loads([2.0, 0.0, 0.0, 0.0], [10.0, 20.0])
    assert symmetric.shape == (2, 3)
    assert not np.any(symmetric[:, 1:])


@pytest.mark.slow
@pytest.mark.parametrize(
    "problem",
    [
        Problem(SCENE, 10.0, lift=0.3),
        Problem(SCENE, Glide(10.0), max_moment=0.3),
        Problem(SCENE, Robust(9.0, Uniform(0.4), cases=2), lift=0.2),
        Problem(SCENE, Robust(9.0, Uniform(0.4), cases=2, glide=True)),
    ],
    ids=["lift", "glide", "several Re", "robust glide"],
)
def test_designs_from_nothing_meet_their_bounds_on_the_flow(problem):
    """As good as SLSQP on the flow, stationary there, and the bounds hold by the flow."""
    design = optimise(problem, Flow(SCENE))
    assert design.kkt_residual <= 1e-2
    loads = np.array([[s.drag, s.lift, s.moment] for s in design.verified.solutions])
    slack = 1e-2 * loads[:, 0]
    assert np.all(loads[:, 1] >= (problem.lift or -9.0) - slack)
    assert np.all(loads[:, 2] <= (problem.max_moment or 9.0) + slack)
    direct = design_directly(problem, Flow(SCENE))
    assert design.objective <= direct.objective + 2e-3 * abs(direct.objective)


def test_slsqp_on_bodies_that_the_grid_does_not_resolve_did_not_converge(monkeypatch):
    """Wherever SciPy asks first, for the bounds on loads or for the objective."""

    def refuse(*arguments):
        raise InvalidInput("body: too thin for the grid")

    monkeypatch.setattr("shapeopt.payoff.direct.evaluate_design", refuse)
    for bounds in ({}, {"lift": 0.3}):
        with pytest.raises(NotConverged, match="SLSQP on the flow: body: too thin"):
            design_directly(Problem(SCENE, 10.0, **bounds), Flow(SCENE))


@pytest.mark.slow
def test_a_surrogate_of_sections_answers_all_loads(trained):
    folder, net = trained
    flow = np.asarray(Flow(SCENE).loads(BODY, 10.0))
    found = np.asarray(net.loads(BODY, 10.0))
    np.testing.assert_allclose(found, flow, atol=0.03 * flow[0])
    np.testing.assert_allclose(load(folder).loads(BODY, 10.0), found, rtol=1e-12)
    assert {f"{name}_error_max" for name in ("drag", "lift", "moment")} <= set(net.record)
    assert "error of Cl" in net.summary()
    several = net.loads(jnp.stack([BODY, BODY]), jnp.array([10.0, 15.0]))
    assert several.shape == (2, 3)
    jacobian = jax.jacobian(net.loads)(BODY, 10.0)
    step = 1e-6 * jnp.eye(4)[3]
    change = (net.loads(BODY + step, 10.0) - net.loads(BODY - step, 10.0)) / 2e-6
    np.testing.assert_allclose(jacobian[:, 3], change, rtol=1e-5)
    outside = dataclasses.replace(net).loads
    assert np.all(np.isnan(jax.jit(outside)(BODY.at[3].set(40.0), 10.0)))


def test_bounds_that_the_flow_does_not_meet_are_named(unchecked):
    two = Robust(10.0, Uniform(0.2), cases=2)
    problem = Problem(SCENE, two, lift=0.5, max_moment=0.1)
    loads = [(0.49995, 0.1003), (0.52, 0.09)]
    violated = violated_bounds(problem, np.array([(1.0, *one) for one in loads]))
    assert violated == {"max_moment": 0.1003}
    cases = [{"cl_verified": lift, "cm_verified": cm} for lift, cm in loads]
    record = {"cases": cases, "violated": violated, "until": "surrogate"}
    span, exceeded = bound_lines(record, problem)
    assert "in the 2 cases: Cl 0.5000 to 0.5200, Cm 0.0900 to 0.1003" in span
    assert "max moment 0.1 is not met: 0.1003 by the flow; --until flow searches" in exceeded
    net = {"surrogate": "out/net"}
    assert origin(net | {"until": "surrogate"}) == "found by the surrogate net"
    led = origin(net | {"until": "flow"})
    assert led == "found by the flow's adjoint, led by the surrogate net"
    assert origin({"surrogate": "none", "until": "flow"}) == "found by the flow's adjoint"
    assert origin({"surrogate": "none", "until": "surrogate"}) == "found by a surrogate"


@pytest.mark.slow
def test_a_polar_of_designs_in_one_call(trained, tmp_path):
    _, net = trained
    designs = optimise_all([Problem(SCENE, 10.0, lift=lift) for lift in (0.1, 0.2, 0.3)], net)
    lifts = [design.lift for design in designs]
    np.testing.assert_allclose(lifts, [0.1, 0.2, 0.3], atol=1e-6)
    assert np.all(np.diff([design.drag for design in designs]) > 0)
    assert "Cl 0.1000" in repr(designs[0])
    assert "Cm" in designs[0].summary()
    record = save_run(tmp_path / "run", designs[1], net)
    assert record["cl_verified"] == pytest.approx(0.2, abs=0.03 * record["cd_verified"])


@pytest.mark.slow
def test_commands_know_lift(trained, tmp_path, capsys):
    folder, _ = trained
    body = ["--aspect", "2", "--gamma2", "0.2", "--incidence", "6"]
    predict_drag(["--surrogate", str(folder), *body, "--reynolds", "10", "--json"])
    row = json.loads(capsys.readouterr().out.splitlines()[-1])["results"][0]
    assert row["cl"] > 0.1
    assert set(row["gradient"]) == {"cd", "cl", "cm"}
    assert row["gradient"]["cl"]["incidence"] > 0
    arguments = ["--surrogate", str(folder), "--objective", "glide", "--reynolds"]
    found = optimize_shape([*arguments, "10", "--out", str(tmp_path / "glide")])
    assert found["glide"] == pytest.approx(found["cl_verified"] / found["cd_verified"], rel=1e-9)
    assert found["glide"] > 0.2
    assert found["cd_start"] is None  # a cylinder does not glide
    lines = capsys.readouterr().out
    assert "glide ratio" in lines
    with pytest.raises(InvalidInput, match="--objective glide: goes with one Reynolds number"):
        optimize_shape([*arguments, "8,10", "--out", str(tmp_path / "other")])
