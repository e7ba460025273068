"""The component of OpenMDAO: its values and derivatives, refusals, and the coupled example."""

import sys

import jax
import numpy as np
import pytest
from conftest import TINY

from shapeopt import Problem, optimise
from surrogate import Family, Flow, InvalidInput, Scene, load

om = pytest.importorskip("openmdao.api")
from settling_speed import archimedes_range, fastest  # noqa: E402

from shapeopt.openmdao import LoadsComponent  # noqa: E402


def component(model):
    problem = om.Problem(reports=False)
    problem.model.add_subsystem("body", LoadsComponent(model=model), promotes=["*"])
    problem.setup()
    return problem


@pytest.mark.parametrize("name", ["pretrained", "pretrained:lift"])
def test_values_and_partials_are_the_surrogates(name):
    net = load(name)
    problem = component(net)
    problem.run_model()
    ranges = problem.model.body.ranges
    body = np.array([problem.get_val(n).item() for n in net.scene.family.names])
    loads = np.asarray(net.loads(body, problem.get_val("reynolds").item()))
    outputs = ("cd", "cl", "cm") if name == "pretrained:lift" else ("cd",)
    assert [problem.get_val(o).item() for o in outputs] == loads[: len(outputs)].tolist()
    steps = {n: 1e-5 * (high - low) for n, (low, high) in ranges.items()}
    for n, step in steps.items():
        problem.model.body.set_check_partial_options(wrt=n, step=step, form="central")
    found = problem.check_partials(out_stream=None)["body"]
    for (output, n), check in found.items():
        error = np.abs(check["J_fwd"] - check["J_fd"]).max() * (ranges[n][1] - ranges[n][0])
        assert error < 1e-7 * loads[0], (output, n, error)


@pytest.mark.slow
def test_partials_of_a_flow_are_its_adjoints():
    family = Family(aspect=(1.0, 2.0), beta2=(-0.2, 0.2))
    flow = Flow(Scene(reynolds=(5, 20), family=family, fidelity=TINY))
    problem = component(flow)
    problem.run_model()
    partials = problem.compute_totals(of=["cd"], wrt=["aspect", "beta2", "reynolds"])
    slopes = jax.grad(flow.drag, (0, 1))(np.array([1.5, 0.0]), problem.get_val("reynolds").item())
    found = [partials["cd", name].item() for name in ("aspect", "beta2", "reynolds")]
    assert found == pytest.approx([*slopes[0].tolist(), float(slopes[1])], rel=1e-4)


def test_bodies_that_the_model_refuses_are_analysis_errors():
    problem = component(load("pretrained"))
    problem.set_val("reynolds", 300.0)
    with pytest.raises(om.AnalysisError, match="outside the trained ranges"):
        problem.run_model()
    with pytest.raises(om.AnalysisError, match="no derivatives"):
        problem.model.run_linearize()


def test_coupled_with_its_weight_the_fastest_body_has_the_least_drag_at_its_own_re():
    found, net = fastest(1000.0), load("pretrained:space")
    cd, reynolds = (found.get_val(name).item() for name in ("cd", "reynolds"))
    assert cd * reynolds**2 == pytest.approx(4 / 3 * 1000.0, rel=1e-8)
    design = optimise(Problem(net.scene, reynolds), net)
    assert cd == pytest.approx(design.drag, rel=1e-5)


@pytest.mark.parametrize("archimedes", [1e-3, 1e9])
def test_bodies_that_fall_outside_the_trained_range_are_refused(archimedes):
    """The message says which Archimedes numbers are within it; these are answered."""
    with pytest.raises(InvalidInput, match="outside the trained") as refused:
        fastest(archimedes)
    assert "compute()" not in str(refused.value)
    least, greatest = archimedes_range(load("pretrained:space"))
    assert f"{least:.4g} to {greatest:.4g}" in str(refused.value)
    assert 1e-3 < least < 1000.0 < greatest < 1e9


def test_without_openmdao_the_command_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "shapeopt.openmdao", None)
    with pytest.raises(InvalidInput, match="openmdao"):
        fastest(1000.0)


def test_models_of_another_kind_are_refused():
    with pytest.raises(TypeError, match="model"):
        LoadsComponent(model="pretrained")
