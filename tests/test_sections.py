"""Sections: the chord, Reynolds numbers and coefficients by it, ranges, polars, refusals."""

import csv
import dataclasses
import functools
import importlib
import json
import re
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pictures import pixels

from shapeopt.commands.arguments import add_body_arguments
from shapeopt.commands.cli import Parser, run
from shapeopt.commands.predict_drag import _excess_words
from shapeopt.commands.ranges import MOST, numbers
from shapeopt.commands.reference import KEY_POWERS, by_reference
from shapeopt.commands.sweep import Case, solve_cases, text_table
from surrogate import (
    FIDELITIES,
    Flow,
    InvalidInput,
    NotConverged,
    Scene,
    Shape,
    contour_shape,
    family_shape,
    load,
    naca4,
)
from surrogate.body.chord_line import centroid_station, chord_point
from surrogate.body.measures import moments
from surrogate.flow.grid.discretise import fitted_domain
from surrogate.flow.solver.newton import NewtonSettings

pytestmark = pytest.mark.usefixtures("shipped_once")
COARSE = ["--fidelity", "draft", "--cells", "8"]
THICK = ["--naca", "2430", *COARSE]  # resolved by few cells
ENDS = st.floats(-1e6, 1e6)
ABOVE_ZERO = st.floats(1e-6, 1e6)
COUNTS = st.integers(2, MOST)


def call(script, *arguments):
    return run(importlib.import_module(script).main, [str(a) for a in arguments])


def answer(capsys, script, *arguments):
    status = call(script, *arguments, "--json")
    captured = capsys.readouterr()
    assert status == 0, captured.err
    return json.loads(captured.out.splitlines()[-1])


def refusal(capsys, script, *arguments):
    """The one line of a refusal."""
    assert call(script, *arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    (line,) = captured.err.splitlines()
    return line


@given(st.lists(ENDS, min_size=1, max_size=9))
def test_a_list_is_read_as_it_is_written(values):
    assert numbers(",".join(map(repr, values))) == values


@given(st.lists(ENDS, min_size=1, max_size=5))
def test_lists_that_begin_with_a_minus_are_values_of_options(values):
    parser = Parser("Parse incidences.")
    add_body_arguments(parser)
    for text in (",".join(map(repr, values)), f"{-abs(values[0])!r}:12:9"):
        assert parser.parse_args(["--incidence", text, "--aspect", "2"]).incidence == text


@given(ENDS, ENDS, COUNTS)
def test_a_range_is_evenly_spaced_from_end_to_end(first, last, count):
    values = numbers(f"{first!r}:{last!r}:{count}")
    assert len(values) == count
    assert (values[0], values[-1]) == (first, last)
    assert np.diff(values) == pytest.approx((last - first) / (count - 1), abs=1e-9 * 1e6)


@given(ABOVE_ZERO, ABOVE_ZERO, COUNTS)
def test_a_logarithmic_range_has_equal_ratios(first, last, count):
    values = numbers(f"{first!r}:{last!r}:log{count}")
    assert len(values) == count
    assert (values[0], values[-1]) == (first, last)
    assert np.diff(np.log(values)) == pytest.approx(np.log(last / first) / (count - 1), abs=1e-9)


def test_lists_and_ranges_can_be_mixed():
    assert numbers("1:3:3,10,40") == [1, 2, 3, 10, 40]
    assert numbers("1:100:log3") == pytest.approx([1, 10, 100])


@pytest.mark.parametrize(
    ("text", "words"),
    {
        "": "one number, or several",
        ",": "one number, or several",
        "1:40": "1:40 lacks the count of a range, as 1:40:20",
        "1:40:x": "or a range, as 1:40:20",
        "1:40:2.5": "or a range, as 1:40:20",
        "1:40:20:3": "or a range, as 1:40:20",
        "1:40:1": "from 2 to 1000 numbers, not 1",
        "1:40:1001": "from 2 to 1000 numbers, not 1001",
        "1:inf:3": "must be finite",
        "0:40:log3": "must be above 0",
    }.items(),
)
def test_what_is_no_list_is_refused(text, words):
    with pytest.raises(InvalidInput, match=re.escape(words)) as refused:
        numbers(text)
    assert str(refused.value).startswith(f"--reynolds {text!r}: ")


def test_the_chord_of_a_section_is_that_of_its_definition_at_any_incidence():
    points = naca4("0012")
    area = float(moments(points)[0])
    for incidence in (-4.0, 0.0, 90.0):
        chord = contour_shape(points, incidence).chord
        assert chord == pytest.approx(np.sqrt(np.pi / 4 / area), rel=1e-12)
        assert contour_shape(points, incidence, keep_size=True).chord == pytest.approx(1.0)
    markers = contour_shape(points).draw(400)  # its ends are rounded
    assert np.ptp(markers[:, 0]) == pytest.approx(chord, rel=5e-3)
    assert contour_shape(points[::-1] * 7 + 3).chord == pytest.approx(chord)


@pytest.mark.parametrize("incidence", [0.0, 30.0])
def test_the_chord_of_a_family_body_is_its_length_along_the_axis(incidence):
    assert family_shape({"aspect": 4, "beta2": 0.2}, incidence).chord == pytest.approx(2.0)
    ellipsoid = family_shape({"aspect": 2, "flatness": 1.5}, dimension=3)
    assert ellipsoid.chord == pytest.approx(2 ** (2 / 3))
    drawn = Shape(ellipsoid.draw, symmetric=True)  # of which nothing else is known
    assert drawn.chord == pytest.approx(ellipsoid.chord, rel=1e-4)


@given(st.floats(0.1, 10))
def test_coefficients_by_the_chord_are_scaled_exactly(chord):
    row = {name: 1.0 for name in KEY_POWERS} | {"estimated_error": 0.1, "cd_friction": None}
    row |= {"reynolds": 20.0, "chord": chord, "reference": "diameter"}
    body = family_shape({"aspect": 4.0})
    assert by_reference(row, body) == row
    scaled = by_reference(row | {"reference": "chord"}, body)
    assert scaled["cd"] == scaled["cl"] == scaled["estimated_lift_error"] == 1 / chord
    assert scaled["cm"] == 1 / chord**2
    assert (scaled["estimated_error"], scaled["cd_friction"]) == (0.1, None)


@pytest.mark.parametrize("incidence", [0.0, 12.0])
def test_the_moment_about_another_point_is_that_of_the_force_at_the_centroid(capsys, incidence):
    """Its arm along the chord times the force across the chord, by D and by the chord."""
    body = ["--aspect", "3", "--gamma2", "0.2", "--incidence", str(incidence), "--reynolds", "20"]
    arguments = ["predict_drag", "--surrogate", "pretrained:lift", *body, "--moment-about"]
    angle = np.deg2rad(incidence)
    for reference in ("diameter", "chord"):
        ask = [*arguments, "0.25", "--reference", reference]
        (row,) = answer(capsys, *ask)["results"]
        unit = row["chord"] if reference == "diameter" else 1.0
        across = row["cl"] * np.cos(angle) + row["cd"] * np.sin(angle)
        along = row["cd"] * np.cos(angle) - row["cl"] * np.sin(angle)
        nose = chord_point(family_shape({"aspect": 3.0, "gamma2": 0.2}), 0.0)[1] / row["chord"]
        arm = 0.25 - row["centroid"]
        expected = row["cm"] + unit * (arm * across - nose * along)  # gamma2: a chord along x
        assert row["cm_about"] == pytest.approx(expected, abs=1e-9)
        assert row["moment_about"] == 0.25
    assert call(*arguments, "nan") == 2
    assert "--moment-about" in capsys.readouterr().err


@pytest.mark.parametrize(
    "points",
    [
        np.array([[-2, -1], [-2, 0], [-2, 1], [0, 1], [2, 1], [2, 0], [2, -1], [0, -1.0]]),
        naca4("0012")[naca4("0012")[:, 0] < 0.9],
        naca4("0012"),
    ],
    ids=["rectangle", "blunt tail", "sharp tail"],
)
def test_the_chord_of_a_symmetric_contour_is_its_axis(points):
    shape = contour_shape(points)
    nose, tail = chord_point(shape, 0.0), chord_point(shape, 1.0)
    assert [nose[1], tail[1]] == pytest.approx([0, 0], abs=2e-3)
    assert tail[0] - nose[0] == pytest.approx(shape.chord)
    turned = chord_point(contour_shape(points, 30.0), 0.0)
    assert turned == pytest.approx(nose[0] * np.array([np.cos(np.pi / 6), -0.5]), abs=3e-3)


def test_moments_of_a_solution_about_its_centroid_and_its_quarter_chord():
    shape = contour_shape(naca4("0015"), 6.0)
    found = Flow(Scene(fidelity="draft")).solve(shape, 20.0, estimate=False, allow_unsteady=True)
    assert found.moment_about(centroid_station(shape)) == pytest.approx(found.moment, abs=1e-6)
    assert abs(found.moment_about(0.25)) < 0.2 * found.moment  # near the aerodynamic centre
    with pytest.raises(InvalidInput, match="station"):
        found.moment_about(np.nan)


def test_errors_beyond_their_bounds_are_named_where_they_mean_something():
    row = {"cd": 1.0, "cd_error_bound": 2e-3, "cd_error": 1e-3}
    row |= {"cl_error_bound": 1e-3, "cl_error": 5e-3, "cm_error_bound": 0.0, "cm_error": 1e-7}
    assert _excess_words(row, True) == "; of Cl more than the bound"
    assert _excess_words(row, False) == ""  # symmetric bodies: no lift is shown
    assert _excess_words(row | {"cd_error_bound": None}, True) == ""
    rows = [{"cl": value, "cd": 1.0} for value in (-1e-9, -0.5, None)]
    assert [line.split()[-1] for line in text_table(rows).splitlines()] == [
        *("Cl", "0.0000", "-0.5000", "-")
    ]


def test_the_fluid_gives_the_reynolds_number(capsys):
    arguments = ["predict_drag", "--aspect", "2", "--fluid"]
    (row,) = answer(capsys, *arguments, "0.3,0.001,1.2,1.5e-5")["results"]
    assert row["reynolds"] == pytest.approx(20)
    assert row["forces_N"]["drag"] == pytest.approx(row["cd"] * 0.6 * 0.3**2 * 0.001)
    assert call(*arguments, "0.3,0.001,1.2") == 2
    assert "--fluid with NU" in capsys.readouterr().err


@pytest.mark.slow
def test_a_chord_reynolds_number_is_the_flow_at_that_over_the_chord(capsys):
    chord = contour_shape(naca4("2430")).chord
    arguments = ["solve_drag", *THICK, "--incidence", "5"]
    (by_d,) = answer(capsys, *arguments, "--reynolds", repr(20 / chord))["results"]
    arguments += ["--chord-reynolds", "20"]
    (same,) = answer(capsys, *arguments)["results"]
    (by_chord,) = answer(capsys, *arguments, "--reference", "chord")["results"]
    for row, reference in ((by_d, "diameter"), (same, "diameter"), (by_chord, "chord")):
        assert row["chord"] == chord
        assert row["chord_reynolds"] == pytest.approx(20, rel=1e-14)
        assert row["incidence"] == 5
        assert row["reference"] == reference
    for name in ("cd", "cd_pressure", "cd_friction", "cl", "cm"):
        power = 2 if name == "cm" else 1
        assert same[name] == by_d[name]
        assert by_chord[name] == pytest.approx(by_d[name] / chord**power, rel=1e-14)
    assert call(*arguments, "--reference", "chord") == 0
    text = capsys.readouterr().out
    assert f"chord {chord:.4f} D, centroid at 0.418" in text
    assert "c; coefficients by the chord c (Cm by its square)" in text
    assert f"Cd {by_chord['cd']:.4f}" in text


def test_a_surrogates_drag_by_the_chord_has_its_gradient(capsys):
    arguments = ["predict_drag", "--aspect", "4", "--beta2", "0.1", "--chord-reynolds", "20,60"]
    rows = answer(capsys, *arguments)["results"]
    scaled = answer(capsys, *arguments, "--reference", "chord")["results"]
    net = load("pretrained")
    body = jnp.array([4.0, 0.1, 0, 0])

    def drag(body):  # the chord is the root of the aspect
        return net.drag(body, 10.0) / jnp.sqrt(body[0])

    for by_d, by_chord, reynolds in zip(rows, scaled, (10, 30), strict=True):
        assert (by_d["reynolds"], by_d["chord"]) == (reynolds, 2.0)
        assert by_chord["cd"] == pytest.approx(by_d["cd"] / 2, rel=1e-12)
    *found, by_reynolds = scaled[0]["gradient"].values()
    assert list(scaled[0]["gradient"])[-1] == "reynolds"
    assert found == pytest.approx(np.asarray(jax.grad(drag)(body)), rel=1e-9, abs=1e-12)
    assert by_reynolds == pytest.approx(float(jax.grad(net.drag, 1)(body, 10.0)) / 2, rel=1e-9)


def test_predictions_have_a_table_and_a_polar(capsys, tmp_path):
    table, plot = tmp_path / "polar.csv", tmp_path / "polar.svg"
    arguments = ["predict_drag", "--surrogate", "pretrained:lift", "--aspect", "3"]
    arguments += ["--incidence", "0:8:3", "--reynolds", "40", "--table", table, "--plot", plot]
    rows = answer(capsys, *arguments)["results"]
    with table.open() as file:
        read = list(csv.DictReader(file))
    assert [float(line["cl"]) for line in read] == [row["cl"] for row in rows]
    assert [row["glide"] for row in rows] == [row["cl"] / row["cd"] for row in rows]
    assert "estimated_error" not in rows[0]  # of no flow
    assert "aspect 3: chord 1.732" in plot.read_text()


def test_gradients_by_the_chord_are_those_of_the_coefficients_by_it():
    """Against the derivatives of Cd / c and Cm / c^2; the chord c is the root of the aspect."""
    shape = family_shape({"aspect": 4.0, "beta2": 0.1, "incidence": 3.0})
    slopes = {"aspect": 0.3, "beta2": -0.2, "incidence": 0.05, "reynolds": -0.01}
    row = {"reference": "chord", "chord": 2.0, "cd": 1.5, "cl": 0.4, "cm": 0.2}
    found = by_reference(row | {"gradient": dict.fromkeys(("cd", "cl", "cm"), slopes)}, shape)
    for name, power in (("cd", 1), ("cl", 1), ("cm", 2)):
        by_aspect = (slopes["aspect"] - power * row[name] / 2 / 4) / 2**power
        expected = {key: slope / 2**power for key, slope in slopes.items()}
        assert found["gradient"][name] == pytest.approx(expected | {"aspect": by_aspect})
    alone = by_reference(row | {"gradient": slopes}, shape)["gradient"]
    assert alone == found["gradient"]["cd"]


def estimated_at_once(scene, settings, found):
    """Return a flow with made-up estimates of its errors, for which no flow is solved."""
    return dataclasses.replace(
        found,
        status="accurate",
        expected_error=4e-3,
        estimated_error=8e-3,
        estimated_lift_error=5e-3,
        estimated_moment_error=2e-3,
    )


def test_a_polar_is_the_same_as_json_table_and_single_flows(capsys, tmp_path, monkeypatch):
    monkeypatch.setattr("surrogate.flow.flow.with_estimate", estimated_at_once)
    table, plot = tmp_path / "polar.csv", tmp_path / "polar.png"
    arguments = ["solve_drag", *THICK, "--incidence", "-4:0:2,4", "--reynolds", "5:10:2"]
    arguments += ["--reference", "chord", "--table", table, "--plot", plot]
    rows = answer(capsys, *arguments)["results"]
    cases = [(row["incidence"], row["reynolds"]) for row in rows]
    assert cases == [(turn, re) for turn in (-4, 0, 4) for re in (5, 10)]
    assert rows[0]["cl"] < rows[2]["cl"] < rows[4]["cl"]

    with table.open() as file:
        read = list(csv.DictReader(file))
    for row, line in zip(rows, read, strict=True):
        assert set(line) == set(row)
        for name, value in row.items():
            assert line[name] == ("" if value is None else str(value))

    size, colours = pixels(plot)
    assert size == (1400, 1064)
    assert len(np.unique(colours[:, 1])) > 50
    single = [*THICK, "--incidence", "-4", "--reynolds", "10", "--reference", "chord"]
    (alone,) = answer(capsys, "solve_drag", *single)["results"]
    for name in ("cd", "cl", "cm"):
        assert rows[1][name] == pytest.approx(alone[name], rel=1e-6)

    lines = text_table(rows).splitlines()
    assert len(lines) == 7
    assert len({len(line) for line in lines}) == 1
    assert lines[0].split()[:3] == ["incidence", "Re", "chord"]
    assert lines[1].split()[:2] == ["-4", "5"]


@pytest.mark.parametrize("body", [["--aspect", "1"], ["--naca", "2430", "--incidence", "8"]])
def test_the_drag_over_reynolds_numbers_is_plotted(capsys, tmp_path, body, no_estimates):
    plot = tmp_path / "drag.png"
    flows = [*COARSE, "--reynolds", "1:10:log3", "--plot", plot]
    rows = answer(capsys, "solve_drag", *body, *flows)["results"]
    assert [row["reynolds"] for row in rows] == pytest.approx([1, np.sqrt(10), 10])
    pixels(plot)


def test_a_flow_that_does_not_converge_leaves_the_others(
    capsys, monkeypatch, tmp_path, no_estimates
):
    """Two Newton steps do at Re 0.01, not at 10."""
    impatient = functools.partial(Flow, settings=NewtonSettings(max_steps=2))
    monkeypatch.setattr("shapeopt.commands.solve_drag.Flow", impatient)
    table, plot = tmp_path / "t.csv", tmp_path / "p.png"
    flows = ["solve_drag", "--aspect", "1", *COARSE, "--reynolds", "0.01,10"]
    assert call(*flows, "--json", "--table", table, "--plot", plot, "--gradient") == 3
    captured = capsys.readouterr()
    good, bad = json.loads(captured.out)["results"]
    assert "1 of 2 flows did not converge: incidence 0 at Re 10" in captured.err.splitlines()[-1]
    assert good["converged"]
    assert good["cd"] == pytest.approx(374, rel=0.01)
    assert set(bad) == set(good)
    case = {"incidence": 0, "reynolds": 10, "chord": 1, "chord_reynolds": 10}
    case |= {"reference": "diameter", "converged": False, "status": "not converged"}
    assert bad.pop("centroid") == pytest.approx(0.5)
    assert {name: value for name, value in bad.items() if value is not None} == case
    head, _, lost = csv.reader(table.read_text().splitlines())
    assert "gradient.aspect" in head
    assert "gradient" not in head
    assert len(lost) == len(head)
    assert lost.count("") > 6
    pixels(plot)
    assert call(*flows) == 3
    assert re.search(r"10 .* - .*not converged", capsys.readouterr().out)


def test_one_program_solves_a_section_at_every_reynolds_number_and_opposite_incidence(
    compilations,
):
    flow = Flow(Scene(fidelity=dataclasses.replace(FIDELITIES["draft"], cells=8)))
    points = naca4("0030")
    found = flow.solve(contour_shape(points, 5.0), 6.0, estimate=False)
    assert found.chord_reynolds == 6 * found.chord == 6 * found.shape.chord
    compilations.clear()
    for incidence, reynolds in ((5.0, 11.0), (-5.0, 6.0), (-5.0, 9.0)):
        flow.solve(contour_shape(points, incidence), reynolds, estimate=False)
    assert compilations == []


def test_a_section_has_few_grids_over_many_incidences():
    """Programs are compiled for a grid; chords and heights are rounded."""
    points, scene = naca4("0012"), Scene()
    grids = {
        fitted_domain(scene.stream, scene.fidelity, contour_shape(points, turn), 15.0)
        for turn in np.linspace(-4, 12, 33)
    }
    assert len(grids) <= 3


@pytest.mark.parametrize("section", ["0006", "0003"])
def test_a_refusal_of_a_kept_size_names_the_cells_that_do(capsys, section, monkeypatch):
    arguments = ["solve_drag", "--naca", section, "--keep-size", "--reynolds", "10"]
    line = refusal(capsys, *arguments)
    (cells,) = re.findall(r"; --cells (\d+) would resolve it$", line)
    assert "--cells" in refusal(capsys, *arguments, "--cells", int(cells) - 1)
    seen = []
    monkeypatch.setattr(
        "shapeopt.commands.solve_drag.solve_cases", lambda cases, *_: seen.extend(cases) or []
    )
    monkeypatch.setattr("shapeopt.commands.solve_drag._text", lambda _: "")
    assert call(*arguments, "--cells", cells) == 0  # gets as far as the flow
    assert len(seen) == 1


def test_a_kept_size_that_no_grid_holds_is_refused_with_what_would_do(capsys, tmp_path):
    arguments = ["solve_drag", "--naca", "0001", "--keep-size", "--reynolds", "10"]
    assert "more than --cells takes (128)" in refusal(capsys, *arguments)
    np.savetxt(tmp_path / "c.csv", 10 * naca4("0012"), delimiter=",")
    contour = ["--contour", tmp_path / "c.csv", "--reynolds", "10"]
    assert "without --keep-size" in refusal(capsys, "solve_drag", *contour, "--keep-size")


NACA = "solve_drag --naca 0012"
REFUSED = {
    f"{NACA} --reynolds 9 --chord-reynolds 9": "--chord-reynolds: give one of them, not both",
    f"{NACA} --chord-reynolds 1:5000:9": "--chord-reynolds 1:5000:9, chord 3.101 D: Reynolds",
    f"{NACA} --reynolds 9 --incidence 1:4:log3": "cannot be spaced logarithmically",
    f"{NACA} --reynolds 9 --incidence 0,x": "--incidence '0,x': one number, or several",
    "solve_drag --aspect 2 --incidence 1 --stream tunnel:1.75 --cells 6 --reynolds 9": "--cells 8",
    f"{NACA} --reynolds 9 --incidence 0,200": "incidence 200: from -180 to 180",
    f"{NACA} --reynolds 9 --reference radius": "invalid choice: 'radius'",
    f"{NACA} --reynolds 9 --plot {{folder}}/p.png": "--plot: needs several values",
    f"{NACA} --reynolds 9 --plot {{folder}}/p.bmp": "must name a file that ends",
    f"{NACA} --reynolds 9 --table {{folder}}/p.txt": "must name a file that ends in .csv",
    f"{NACA} --reynolds 5 --incidence 0,90 --stream tunnel:4": "--incidence 90: tunnel:4 leaves",
    f"{NACA} --reynolds 5 --incidence 0,90 --cells 9": "--incidence 0: body: its mean thickness",
    "solve_drag --aspect 2 --reynolds 9 --dimension 3 --reference chord": "is for 2-D bodies",
    "solve_drag --aspect 2 --dimension 3 --particle 2,1e-6,1e-4 --table t.csv": "without --table",
    "solve_drag --aspect 2 --reynolds 40 --incidence 0,90": "--incidence 90: Reynolds number 40:",
    "march_flow --aspect 2 --reynolds 9 --incidence 0,9 --out {folder}/m": "--incidence: one angle",
    "march_flow --aspect 2 --reynolds 9,10 --out {folder}/m": "--reynolds: one number",
    "march_flow --aspect 2 --out {folder}/m": "--reynolds: give it, or --chord-reynolds",
    "predict_drag --aspect 2": "--reynolds: give it, or --chord-reynolds or --fluid with NU",
}


@pytest.mark.parametrize(("mistake", "words"), REFUSED.items())
def test_mistakes_are_refused_before_any_flow_is_solved(capsys, tmp_path, mistake, words):
    assert words in refusal(capsys, *mistake.format(folder=tmp_path).split())
    assert list(Path(tmp_path).iterdir()) == []


def test_optimised_bodies_tell_their_chords(capsys, tmp_path):
    sheet = ["--reynolds", "1:40:log2", "--max-length", "1.6", "--out", tmp_path / "sheet.png"]
    rows = answer(capsys, "design_sheet", *sheet)["designs"]
    assert {round(row["reynolds"], 9) for row in rows} == {1, 40}
    for row in rows:
        assert row["chord"] == pytest.approx(np.sqrt(row["parameters"]["aspect"]), rel=1e-12)


def test_an_interrupted_sweep_leaves_the_rows_so_far(tmp_path):
    def solve(case):
        if case.reynolds == 3.0:
            raise KeyboardInterrupt
        if case.reynolds == 2.0:
            raise NotConverged("a flow")
        return {"reynolds": case.reynolds, "cd": 1.5}

    cases = [Case(family_shape({"aspect": 2.0}), 0.0, re) for re in (0.5, 1.0, 2.0, 3.0)]
    with pytest.raises(KeyboardInterrupt):
        solve_cases(cases, solve, tmp_path / "polar.csv")
    rows = list(csv.DictReader((tmp_path / "polar.csv").open()))
    assert [row["reynolds"] for row in rows] == ["0.5", "1.0"]
