"""The managed search ends at an optimum of the flow; its memory makes later designs cheaper."""

import dataclasses
import json
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from shapeopt import Designer, LogNormal, Problem, Robust, Weighted, optimise
from shapeopt.payoff.direct import design_directly
from shapeopt.problem.constraints import constraint_values
from shapeopt.search import designer as designer_module
from shapeopt.search import sqp
from shapeopt.search.propose import propose
from surrogate import Family, Flow, InvalidInput, NotConverged, Scene, load
from surrogate.model.gaussian_process import Hyper
from surrogate.model.inputs import scene_inputs
from surrogate.model.kriging import Observation, kriging, uncorrected


def smooth_drag(parameters, reynolds):
    """Replace a flow: Cd smooth in the shape and in log Re."""
    aspect, b2, b3, b4 = parameters
    bend = (jnp.log(aspect) - 0.8) ** 2 + 3 * (b2 - 0.1) ** 2 + 2 * b3**2 + b4**2 + b2 * b3
    return jnp.exp(1.0 - 0.6 * jnp.log(reynolds) + 0.02 * jnp.log(reynolds) ** 2 + bend)


@jax.jit
def drag_of(model, parameters, reynolds):
    return model.drag(parameters, reynolds)


def predict(model, flow):
    """Return the drag that a model predicts for an observed body."""
    return float(drag_of(model, jnp.asarray(flow.parameters), jnp.asarray(flow.reynolds)))


def observe(function, parameters, reynolds):
    drag = float(function(parameters, reynolds))
    shape, re = jax.grad(lambda p, x: jnp.log(function(p, jnp.exp(x))), (0, 1))(
        parameters, jnp.log(reynolds)
    )
    slopes = np.append(shape, re)[None]
    return Observation(np.asarray(parameters), float(reynolds), np.array([drag]), slopes)


@pytest.fixture(scope="module")
def pretrained():
    return load("pretrained")


@pytest.fixture(scope="module")
def observations():
    scene, generator = Scene(), np.random.default_rng(3)
    low, high = scene.family.bounds.T
    bodies = generator.uniform(low, high, (20, 4))
    return [observe(smooth_drag, p, np.exp(generator.uniform(0, np.log(40)))) for p in bodies]


def test_kriging_interpolates_its_observations_and_predicts_between(observations):
    model = kriging(observations[:16], scene_inputs(Scene()))
    slopes = jax.jit(jax.grad(lambda p, x: jnp.log(model.drag(p, jnp.exp(x))), (0, 1)))
    for flow in observations[:16]:
        assert predict(model, flow) == pytest.approx(flow.drag, 2e-4)
        found = np.append(*slopes(jnp.asarray(flow.parameters), jnp.log(flow.reynolds)))
        assert np.allclose(found, flow.slopes, atol=2e-2)
    unseen = [predict(model, f) / f.drag - 1 for f in observations[16:]]
    assert np.max(np.abs(unseen)) < 0.05
    assert np.ptp(np.log([f.drag for f in observations[16:]])) > 0.5


def test_kriging_is_the_same_in_blocks(observations, monkeypatch):
    whole = kriging(observations[:16], scene_inputs(Scene()))
    monkeypatch.setattr("surrogate.model.gaussian_process.BLOCK", 9)
    parts = kriging(observations[:16], scene_inputs(Scene()), hyper=whole.hyper)
    for flow in observations[16:]:
        assert predict(parts, flow) == pytest.approx(predict(whole, flow), 1e-8)


@pytest.mark.parametrize("block", [4, 4096])
def test_kriging_of_one_flow_many_times_without_noise_is_refused(observations, monkeypatch, block):
    monkeypatch.setattr("surrogate.model.gaussian_process.BLOCK", block)
    exact = Hyper(np.zeros(1), np.full(1, -40.0), np.ones((1, 5)))
    with pytest.raises(NotConverged, match="singular to rounding"):
        kriging([observations[0]] * 16, scene_inputs(Scene()), hyper=exact)


def test_slopes_improve_kriging_more_than_as_many_drags(observations):
    """Half the flows with their slopes predict better than all of them would with none."""
    inputs = scene_inputs(Scene())
    flat = [flow._replace(slopes=0 * flow.slopes) for flow in observations[:16]]
    good, bad = kriging(observations[:8], inputs), kriging(flat, inputs)
    errors = [
        np.mean([abs(predict(m, f) / f.drag - 1) for f in observations[16:]]) for m in (good, bad)
    ]
    assert errors[0] < 0.5 * errors[1]


def test_a_base_model_is_corrected(observations, pretrained):
    model = kriging(observations[:4], pretrained.network.inputs, pretrained.network)
    for flow in observations[:4]:
        before = predict(pretrained.network, flow)
        after = predict(model, flow)
        assert abs(after / flow.drag - 1) < 1e-3 < abs(before / flow.drag - 1)


def test_a_base_model_without_observations_is_itself(observations, pretrained):
    """In the shapes of a corrected one, so that searches on both are one program."""
    inputs, base = pretrained.network.inputs, pretrained.network
    model = uncorrected(inputs, base, loads=1)
    for flow in observations[:4]:
        assert predict(model, flow) == predict(base, flow)
    corrected = kriging(observations[:4], inputs, base)
    assert jax.tree.structure(model) == jax.tree.structure(corrected)
    kinds = (jax.tree.map(jax.typeof, jax.tree.leaves(tree)) for tree in (model, corrected))
    assert next(kinds) == next(kinds)


@pytest.mark.parametrize(
    ("objective", "constraints"),
    [
        pytest.param(20.0, {"max_length": 1.5}, marks=pytest.mark.slow),
        pytest.param(5.0, {"min_thickness": 0.75}, marks=pytest.mark.slow),
        pytest.param(Weighted((5.0, 20.0), (1.0, 2.0)), {}, marks=pytest.mark.slow),
        pytest.param(
            Robust(15.0, LogNormal(0.2), cases=3, level=0.5),
            {"max_length": 1.6},
            marks=pytest.mark.slow,
        ),
    ],
    ids=["length", "thickness", "several Re", "robust"],
)
def test_designs_from_nothing_are_the_flows_own(tiny_scene, objective, constraints):
    """As good as SLSQP on the flow, within the constraints, and stationary there."""
    problem = Problem(tiny_scene, objective, **constraints)
    flow = Flow(tiny_scene)
    design, direct = optimise(problem, flow), design_directly(problem, flow)
    assert design.objective <= direct.objective * (1 + 2e-4)
    assert design.kkt_residual <= 1e-2
    assert np.all(np.asarray(constraint_values(design.parameters, problem.limits)) > -1e-6)
    assert design.flows >= len(problem.scenarios.weight)
    assert design.green_applications > 0


@pytest.mark.slow
def test_every_design_is_cheaper_than_the_last_and_files_remember(tiny_scene, tmp_path):
    file = tmp_path / "flows.json"
    designer = Designer(Flow(tiny_scene), file)
    problems = [Problem(tiny_scene, re, max_length=1.5) for re in (10.0, 14.0, 12.0)]
    flows = [designer.design(problem).flows for problem in problems]
    assert flows[2] < flows[0]
    again = Designer(Flow(tiny_scene), file)
    design = again.design(problems[0])
    assert design.flows <= 1  # all it needs is known
    assert len(again.memory.observations) == sum(flows) + design.flows
    assert json.loads(file.read_text())["scene"] == tiny_scene.record


@pytest.mark.slow
def test_a_good_network_needs_fewer_flows(pretrained):
    """Trained on flows of a finer grid."""
    scene = dataclasses.replace(pretrained.scene, fidelity="draft")
    network = dataclasses.replace(pretrained, scene=scene)
    problem = Problem(scene, 20.0, max_length=1.6)
    led = optimise(problem, network, until="flow")
    alone = optimise(problem, Flow(scene))
    assert led.flows < alone.flows
    assert led.objective == pytest.approx(alone.objective, rel=2e-4)
    own = optimise(problem, network)
    assert own.flows == 0
    assert own.objective == pytest.approx(led.objective, rel=5e-3)


def fail(memory, monkeypatch, fails):
    """Let the flows of some bodies not converge; return the bodies that failed."""
    solve, failed = memory._solve, []

    def unsure(queries):
        for (parameters, _), found in zip(queries, solve(queries), strict=True):
            lost = bool(fails(parameters))
            failed.extend([parameters] * lost)
            yield found._replace(converged=found.converged & (not lost))

    monkeypatch.setattr(memory, "_solve", unsure)
    return failed


FAILURES = {
    "the first": lambda count, away: count == 1,
    "the third and fourth": lambda count, away: count in (3, 4),
    "all far from the optimum": lambda count, away: away > 0.2,
}


@pytest.fixture(scope="module")
def optimum(tiny_scene):
    """A design on the flow."""
    return optimise(Problem(tiny_scene, 10.0, max_length=1.3), Flow(tiny_scene))


@pytest.mark.parametrize("fails", FAILURES.values(), ids=list(FAILURES))
def test_flows_that_are_not_found_do_not_end_a_design(tiny_scene, monkeypatch, optimum, fails):
    """These bodies are left out, and the search ends at the same optimum."""
    problem, bodies = optimum.problem, []
    width = problem.limits.width

    def not_found(body):
        bodies.append(body)
        return fails(len(bodies), np.max(np.abs(body - optimum.parameters) / width))

    designer = Designer(Flow(tiny_scene))
    failed = fail(designer.memory, monkeypatch, not_found)
    design = designer.design(problem)
    assert failed
    assert design.flows == len(bodies) - len(failed)
    assert design.kkt_residual <= 1e-2
    assert design.objective == pytest.approx(optimum.objective, rel=2e-4)


@pytest.mark.parametrize(("devices", "kept"), [(1, 0), (2, 2)])
def test_flows_solved_together_are_kept_where_one_fails(tiny_scene, monkeypatch, devices, kept):
    """On one device the flows after the one that fails are not solved."""
    memory = Designer(Flow(tiny_scene)).memory
    bodies = [np.array([aspect, 0.0, 0.0, 0.0]) for aspect in (1.5, 1.6, 1.7)]
    solved = []

    def solve_all(queries):
        for body, reynolds in queries:
            found = memory.flow.loads_and_gradients(body, reynolds)
            solved.append(int(found.green_applications))
            yield found._replace(converged=np.asarray(body is not bodies[0]))

    monkeypatch.setattr(memory, "_solve", solve_all)
    monkeypatch.setattr(memory, "devices", SimpleNamespace(count=devices))
    with pytest.raises(NotConverged, match="at Re 10"):
        memory.evaluate_all([(body, 10.0) for body in bodies])
    assert memory.flows == len(memory.observations) == kept
    assert len(solved) == kept + 1
    assert memory.green_applications == sum(solved)


def test_a_proposal_that_is_not_found_does_not_end_a_design(tiny_scene, monkeypatch):
    problem, calls = Problem(tiny_scene, 10.0, max_length=1.3), []

    def unsure(*arguments, **settings):
        calls.append(arguments)
        if len(calls) == 2:
            raise NotConverged("none of the starts reached an optimum")
        return propose(*arguments, **settings)

    monkeypatch.setattr(designer_module, "propose", unsure)
    design = optimise(problem, Flow(tiny_scene))
    assert len(calls) > 2
    assert design.kkt_residual <= 1e-2


def test_a_design_ends_where_no_model_has_an_optimum(tiny_scene, monkeypatch):
    """As where a bound on the lift is out of reach; else it would take 60 flows."""

    def hopeless(*arguments, **settings):
        raise NotConverged("lift 3 is out of reach")

    monkeypatch.setattr(designer_module, "propose", hopeless)
    designer = Designer(Flow(tiny_scene))
    with pytest.raises(NotConverged, match="lift 3 is out of reach"):
        designer.design(Problem(tiny_scene, 10.0, max_length=1.3))
    assert designer.memory.flows <= 10


def test_a_design_that_is_accepted_ends_where_no_model_has_another(tiny_scene, monkeypatch):
    """As where its lift is a little below its bound; else it would take 60 flows."""
    problem, designer = Problem(tiny_scene, 10.0, max_length=1.3), Designer(Flow(tiny_scene))
    optimum = designer.design(problem)
    before = designer.memory.flows

    def hopeless(*arguments, **settings):
        raise NotConverged("lift 3 is out of reach")

    monkeypatch.setattr(designer_module, "propose", hopeless)
    found = designer.design(problem)
    assert found.objective == optimum.objective
    assert designer.memory.flows <= before + 10


def test_a_design_without_any_flow_says_so(tiny_scene, monkeypatch):
    designer = Designer(Flow(tiny_scene))
    failed = fail(designer.memory, monkeypatch, lambda parameters: True)
    with pytest.raises(NotConverged, match="no flow or adjoint of any of 10 bodies about Re 10"):
        designer.design(Problem(tiny_scene, 10.0, max_length=1.3))
    distances = [np.abs(a - b).max() for k, a in enumerate(failed) for b in failed[:k]]
    assert min(distances) > 0.01  # not the same body again and again


def test_a_body_too_thin_for_the_grid_does_not_end_a_design(tiny_scene, monkeypatch):
    problem, designer = Problem(tiny_scene, 10.0), Designer(Flow(tiny_scene))
    evaluate, refused = designer.memory.evaluate_all, []

    def refuse_slender(queries):
        if queries[0][0][0] > 2.5:
            refused.append(queries[0][0])
            raise InvalidInput("body: thinner than the grid resolves")
        return evaluate(queries)

    monkeypatch.setattr(designer_module, "MAX_FAILURES", 2)
    monkeypatch.setattr(designer.memory, "evaluate_all", refuse_slender)
    with pytest.raises(NotConverged, match="KKT residual"):
        designer.design(problem)  # its optimum is among the refused
    assert refused
    slender = Designer(designer.memory.flow)
    monkeypatch.setattr(slender.memory, "evaluate_all", lambda queries: refuse_slender([[[9]]]))
    with pytest.raises(NotConverged, match="2 bodies about Re 10; body: thinner than the grid"):
        slender.design(problem)


DAMAGES = {
    "no JSON": (lambda text: text[:-9], "damaged"),
    "another program's": (lambda text: '{"kind": "thesis"}', "damaged"),
    "drags that are none": (
        lambda text: text.replace('"flows": [[', '"flows": [["a", '),
        "damaged",
    ),
    "not finite": (lambda text: text.replace("10.0", "NaN"), "damaged"),
    "an altered body": (lambda text: text.replace("[[[2.0", "[[[2.5"), "damaged"),
    "another scene's, of more parameters": (
        lambda text: text.replace("unbounded", "tunnel:16").replace("[[[2.0", "[[[2.0, 1.0"),
        "of another scene",
    ),
    "another scene's": (lambda text: text.replace("unbounded", "tunnel:16"), "of another scene"),
    "of a looser solver": (
        lambda text: text.replace('"tolerance": 1e-06', '"tolerance": 1e-03'),
        "of another setting of the solver",
    ),
}


@pytest.mark.parametrize(("damage", "words"), DAMAGES.values(), ids=list(DAMAGES))
def test_damaged_and_foreign_memories_are_refused(tiny_scene, tmp_path, damage, words):
    file = tmp_path / "flows.json"
    memory = Designer(Flow(tiny_scene), file).memory
    memory.evaluate(np.array([2.0, 0.0, 0.0, 0.0]), 10.0)
    memory.save()
    assert len(Designer(Flow(tiny_scene), file).memory.observations) == 1
    file.write_text(damage(file.read_text()))
    with pytest.raises(InvalidInput, match=words) as refusal:
        Designer(Flow(tiny_scene), file)
    assert str(file) in str(refusal.value)


def test_a_design_is_not_lost_with_its_memory(tiny_scene, tmp_path, monkeypatch):
    designer = Designer(Flow(tiny_scene), tmp_path / "flows.json")

    def full():
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(designer.memory, "save", full)
    with pytest.warns(UserWarning, match="not kept"):
        design = designer.design(Problem(tiny_scene, 20.0, max_length=1.5))
    assert design.kkt_residual <= 1e-3


def test_what_fits_no_designer_is_refused(tiny_scene, pretrained, tmp_path, unchecked):
    with pytest.raises(InvalidInput, match="no drag model"):
        Designer("pretrained")
    with pytest.raises(InvalidInput, match="different scenes"):
        Designer(Flow(tiny_scene)).design(Problem(pretrained.scene, 20.0))
    with pytest.raises(InvalidInput, match=r"must name a file that ends in \.json"):
        Designer(Flow(tiny_scene), tmp_path / "flows.txt")
    slender = dataclasses.replace(tiny_scene, family=Family(aspect=(2, 4), beta2=(-0.1, 0.1)))
    with pytest.raises(InvalidInput, match=r"over the cylinder's, .* lacks aspect 1; "):
        optimise(Problem(slender, Weighted((5.0, 20.0), (1.0, 1.0))), Flow(slender))
    thick = dataclasses.replace(tiny_scene, family=Family(aspect=(0.5, 3), beta2=(0.1, 0.3)))
    with pytest.raises(InvalidInput, match="this family lacks beta2 0; "):
        optimise(Problem(thick, [5.0, 20.0]), Flow(thick))


@pytest.mark.slow
def test_a_search_that_does_not_settle_gives_its_best_body_where_that_will_do(monkeypatch):
    """One step of SQP settles nowhere; a design on the flow takes what it came to."""
    net = load("pretrained")
    problem = Problem(net.scene, 20.0, max_length=1.7)
    monkeypatch.setattr(sqp, "ITERATIONS", 1)
    jax.clear_caches()
    with pytest.raises(NotConverged, match="none of the starts"):
        propose(problem, net.network)
    rough = propose(problem, net.network, require_converged=False)
    monkeypatch.undo()
    jax.clear_caches()
    best = propose(problem, net.network)
    assert float(net.scene.family.body_class.length(rough.variables)) <= 1.7 + 1e-5
    assert best.value < rough.value < 1.2 * best.value
