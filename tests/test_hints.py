"""What a newcomer types by mistake is accepted where it is unambiguous, or answered by a hint."""

import contextlib
import dataclasses
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import shapeopt
import surrogate
from shapeopt import LogNormal, Problem, Robust, Station, Weighted, optimise
from shapeopt.commands import entry, optimize_shape, predict_drag, solve_drag
from surrogate import (
    Family,
    Flow,
    InvalidInput,
    Scene,
    contour_shape,
    family_shape,
    load,
    naca4,
)

pytestmark = pytest.mark.usefixtures("shipped_once")
BODY = [2.0, 0.1, 0.0, 0.0]


@pytest.fixture(scope="module")
def net():
    return load("pretrained")


def test_a_body_may_be_a_table_of_parameters(net, tiny_scene):
    named = {"aspect": 2.0, "beta2": 0.1}
    assert net.drag(named, 20.0) == net.drag(BODY, 20.0)
    assert Flow(tiny_scene).drag(named, 10.0) == Flow(tiny_scene).drag(BODY, 10.0)
    with pytest.raises(InvalidInput, match="did you mean beta2"):
        net.drag({"aspect": 2.0, "beta_2": 0.1}, 20.0)


def test_contours_and_several_reynolds_numbers_have_hints(unchecked, tiny_scene):
    flow = Flow(tiny_scene)
    for call in (flow.solve, flow.drag):
        with pytest.raises(InvalidInput, match=r"contour_shape\(points\)"):
            call(naca4("0012"), 10.0)
        with pytest.raises(InvalidInput, match="these are several"):
            call(BODY, (1, 10, 40))


def test_the_name_of_a_section_is_a_body(tiny_scene):
    flow = Flow(dataclasses.replace(tiny_scene, reynolds=(1, 20)))
    assert flow.solve("NACA 0050", 10.0, estimate=False).shape.chord == pytest.approx(1.5, abs=0.2)
    with pytest.raises(InvalidInput, match="four digits"):
        flow.solve("circle", 10.0)


def test_sections_by_other_spellings():
    section = naca4("2412")
    for code in ("NACA 2412", "naca2412", 2412):
        assert np.array_equal(naca4(code), section)
    with pytest.raises(InvalidInput, match=r"contour_shape\(read_contour\(file\)\)"):
        naca4("wing.csv")


def test_a_contour_in_millimetres_that_keeps_its_size_has_a_hint():
    with pytest.raises(InvalidInput, match="80 D long as given; without keep_size"):
        contour_shape(80.0 * naca4("0012"), keep_size=True)


@pytest.mark.parametrize(
    ("option", "meant"),
    [("--aoa", "--incidence"), ("--Re", "--reynolds"), ("--AoA", "--incidence")],
)
def test_options_as_other_programs_call_them(option, meant):
    with pytest.raises(InvalidInput, match=f"did you mean {meant}"):
        solve_drag.main(["--aspect", "2", option, "3"])


def test_several_incidences_are_predicted_at_once(capsys):
    words = [
        "--surrogate",
        "pretrained:lift",
        "--aspect",
        "3",
        "--reynolds",
        "20,40",
        "--incidence",
    ]
    rows = predict_drag.main([*words, "0,4"])["results"]
    printed = capsys.readouterr().out.splitlines()
    assert printed[-1] == "+-: bounds for 95 % of bodies"
    assert {line[:10] for line in printed[1:-1]} == {"incidence "}
    assert [(row["incidence"], row["reynolds"]) for row in rows] == [
        (0, 20),
        (0, 40),
        (4, 20),
        (4, 40),
    ]
    lift = load("pretrained:lift").loads({"aspect": 3.0, "incidence": 4.0}, 40.0)[1]
    assert rows[3]["cl"] == pytest.approx(float(lift), rel=1e-9)
    assert lift > 0.2
    assert rows[0]["cl"] == 0


def test_scenes_flows_and_problems_are_printed_in_a_line(net):
    scene = "an unbounded stream, 2-D, Re 1 to 40, grid standard: bodies of aspect 1 to 5"
    assert str(net.scene).startswith(scene)
    assert str(Flow(net.scene)).startswith(f"flow in {scene}")
    problem = str(Problem(net.scene, 40, max_length=1.5))
    assert "40" in problem
    assert f"max_length 1.5, in {scene}" in problem
    assert "None" not in problem


def test_problems_take_plain_numbers(net):
    several = Problem(net.scene, (1, 10, 40))
    assert several.objective == Weighted((1, 10, 40), (1, 1, 1))
    assert Problem(net.scene, np.array([1.0, 10, 40])) == several
    stations = Problem(net.scene, 20, stations=[(0.5, 0.3)]).stations
    assert stations == (Station(0.5, 0.3),)
    assert Robust(20, 0.3) == Robust(20, LogNormal(0.3))


def test_tables_of_parameters_can_be_traced(net, tiny_scene):
    def drag(model, reynolds):
        return lambda named: model.drag(named, reynolds)

    named = {"beta2": 0.1, "aspect": 2.0}
    by_array = jax.grad(drag(net, 20.0))(jnp.array(BODY))
    by_name = jax.jit(jax.grad(drag(net, 20.0)))(named)
    assert by_name["aspect"] == pytest.approx(float(by_array[0]))
    assert by_name["beta2"] == pytest.approx(float(by_array[1]))
    flow = Flow(tiny_scene)
    assert jax.jit(drag(flow, 10.0))(named) == pytest.approx(float(flow.drag(BODY, 10.0)))
    several, one = {"aspect": 2.0, "beta2": [0.0, 0.1]}, jnp.array([0.0, 0.1])
    np.testing.assert_allclose(jax.jit(drag(net, 20.0))(several), net.drag(several, 20.0))
    np.testing.assert_allclose(net.drag(several, 20.0)[1], net.drag(named, 20.0))
    for model, wrong, hint in (
        (net, {"bet2": 0.1}, "did you mean beta2"),
        (flow, {"beta2": one}, r"jax\.vmap"),
    ):
        with pytest.raises(InvalidInput, match=hint):
            jax.jit(drag(model, 20.0))({"aspect": 2.0} | wrong)


def test_lists_of_tables_are_batches(net, tiny_scene):
    named = [{"aspect": 2.0}, {"aspect": 3.0, "beta2": 0.1}]
    rows = np.array([[2.0, 0, 0, 0], [3.0, 0.1, 0, 0]])
    np.testing.assert_array_equal(net.drag(named, 20.0), net.drag(rows, 20.0))
    traced = jax.jit(lambda aspect: net.drag([{"aspect": aspect}, named[1]], 20.0))(2.0)
    np.testing.assert_allclose(traced, net.drag(rows, 20.0), rtol=1e-12)
    flow = Flow(tiny_scene)
    aspects = np.linspace(1.5, 2.0, 8).tolist()  # as many as trainings of the tests hold out
    bodies = [{"aspect": aspect} for aspect in aspects]
    np.testing.assert_array_equal(
        flow.solve_all(bodies, 10.0).drag,
        flow.solve_all(flow.scene.family.array(bodies), [10.0] * 8).drag,
    )


def test_batches_and_sections_have_hints(net, tiny_scene, unchecked):
    points, flow = naca4("0012"), Flow(tiny_scene)
    for call in (net.drag, lambda points, re: flow.solve_all(points, np.full(len(points), re))):
        with pytest.raises(InvalidInput, match=r"contour_shape\(points\)"):
            call(points, 10.0)
    for call in (net.drag, net.outside, flow.drag, flow.loads_and_gradients):
        with pytest.raises(InvalidInput, match="takes names of NACA sections"):
            call("naca0012", 10.0)


WRONG_WORDS = {
    "aspect": lambda net: Family(aspct=(1, 2)),
    "beta2": lambda net: Scene.of({"family": {"aspect": [1, 2], "betta2": [0, 0.1]}}),
    "beta3": lambda net: family_shape({"aspect": 2, "bta3": 0.1}),
    "beta4": lambda net: Problem(net.scene, 20.0, within={"bet4": (0, 0.1)}),
    "standard": lambda net: Scene(fidelity="standart"),
    "lognormal": lambda net: optimize_shape.main(["--distribution", "lognorml"]),
}


@pytest.mark.parametrize("meant", WRONG_WORDS)
def test_wrong_names_and_choices_have_hints(net, meant):
    with pytest.raises(InvalidInput, match=rf"did you mean {meant}\?"):
        WRONG_WORDS[meant](net)


def test_names_that_are_no_text_are_refused(net, unchecked):
    for call in (lambda: net.drag({"aspect": 2, 3: 1}, 20.0), lambda: Scene.of({3: 1})):
        with pytest.raises(InvalidInput, match="3"):
            call()


def test_wrong_words_have_hints(tmp_path, capsys, monkeypatch):
    with pytest.raises(InvalidInput, match="did you mean --reynolds"):
        solve_drag.main(["--aspect", "2", "--reynold_s", "10", "--reynolds", "10"])
    with pytest.raises(InvalidInput, match="did you mean reynolds"):
        Scene.of({"reynold": [1, 40]})
    monkeypatch.setattr("sys.argv", ["drag-surrogates", "sovle"])
    assert entry.main() == 2
    assert "did you mean solve?" in capsys.readouterr().err


def test_both_spellings_are_understood(capsys, monkeypatch):
    assert shapeopt.optimize is optimise
    monkeypatch.setattr("sys.argv", ["drag-surrogates", "optimize", "--help"])
    with pytest.raises(SystemExit) as ended:
        entry.main()
    assert ended.value.code == 0
    printed = capsys.readouterr().out  # of the program that is installed, without the scripts
    assert "drag-surrogates optimise --reynolds" in printed
    assert "drag-surrogates sheet --lifts" in printed
    assert "shape.py" not in printed


@pytest.mark.parametrize("main", [entry.main, lambda: solve_drag.main(["--version"])])
def test_the_version_is_that_of_the_package(main, capsys, monkeypatch):
    monkeypatch.setattr("sys.argv", ["drag-surrogates", "--version"])
    with contextlib.suppress(SystemExit):
        main()
    assert capsys.readouterr().out == f"drag-surrogates {surrogate.__version__}\n"


def test_results_print_in_one_line_and_tell_more_in_a_summary(net, tiny_scene):
    solution = Flow(tiny_scene).solve(BODY, 10.0, gradient=True, estimate=False)
    design = optimise(Problem(net.scene, 20.0), net)
    for result in (solution, design, net):
        assert "\n" not in repr(result)
        assert "array" not in repr(result)
        assert len(repr(result)) < 140
        assert len(result.summary().splitlines()) >= 5
    assert f"{solution.drag:.4f}" in solution.summary()
    assert np.isfinite(design.drag)
    assert Family().names[0] in net.summary()


def test_help_tells_the_familys_formula_and_what_its_parameters_do(capsys):
    with pytest.raises(SystemExit):
        solve_drag.main(["--help"])
    printed = capsys.readouterr().out
    assert "beta3 sin 3t" in printed
    assert Path(printed.split("words and symbols: ")[1].strip()).is_file()
    for phrase in ("fuller aft (-) or fore (+)", "blunt (+) ends", "finer tail (+)"):
        assert phrase in printed
