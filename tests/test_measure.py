"""The studies run, their records reproduce what they print, and the texts say the same."""

import datetime
import json
import re
import shutil
import sys

import jax
import numpy as np
import pytest
import report
import rivals
import run
import solved_flows
import study
from elements import PLANE, solve_by_elements
from passages import passage
from studies import literature
from studies.designs import SYMMETRIC
from study import Run, Study, Table, columns

from surrogate import Family, InvalidInput, Scene
from surrogate.model.inputs import scene_inputs
from surrogate.model.kriging import Observation
from surrogate.scene.cost import CONVOLUTIONS
from surrogate.scene.samples import held_out_samples

LONG = {
    "accelerator",
    "compilation",
    "confidence",
    "constants",
    "corners",
    "designs",
    "devices",
    "dimension",
    "elements_in_space",
    "exports",
    "extrapolated",
    "extremes",
    "extremes_lift",
    "far_field",
    "fit_memory",
    "flow_3d",
    "foreseen",
    "gradients",
    "hig",
    "incidence",
    "incidence_elements",
    "infill",
    "least",
    "lift",
    "lift_cost",
    "lift_designs",
    "lift_methods",
    "lift_trainings",
    "literature",
    "march",
    "onset",
    "onset_2d",
    "onset_incidence",
    "particle",
    "particle_codes",
    "particle_designs",
    "particle_methods",
    "particle_trainings",
    "precision",
    "random_sections",
    "safeguards",
    "scenarios",
    "section_designs",
    "seeds",
    "settling",
    "shards",
    "space_rival",
    "space_speed",
    "speed",
    "stability",
    "streams",
    "swings",
    "three_loads",
    "three_loads_lift",
    "torque",
    "training",
    "training_space",
    "trainings_on_devices",
    "trust",
    "trust_space",
}  # they start processes, or compile for long
TIMED = [pytest.param(n, marks=pytest.mark.slow) if n in LONG else n for n in sorted(run.NAMES)]


@pytest.mark.parametrize("name", TIMED)
def test_study_runs_and_its_record_reproduces_its_tables(name, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("shapeopt.commands.march_flow.FRAMES", 4)
    run.main([name, "--tiny", "--out", str(tmp_path)])
    printed, found = capsys.readouterr().out, run.load_study(name)
    record = json.loads((tmp_path / f"{name}.json").read_text())
    assert record["seconds"] > 0
    result = record["result"]
    assert printed.strip() == found.markdown(result).strip()
    if "unavailable" in result:
        assert "pip install" in printed
        pytest.skip(result["unavailable"])
    for table in found.tables:
        measured, cases = result[table.key], table.chosen(Run(True, _defaults(found)))
        given = set(cases[0])
        for row in measured.values() if isinstance(measured, dict) else measured:
            found_in = [value for name, value in row.items() if name not in given]
            numbers = any(isinstance(value, int | float | list | dict) for value in found_in)
            assert numbers or "outcome" in row
        assert len(measured) >= len(cases)
    for table in re.findall(r"(?:^\|.*\n?)+", printed, re.M):
        assert len({row.count("|") for row in table.splitlines()}) == 1
    assert (tmp_path / f"{name}.png").is_file() == bool(found.draw)


def _defaults(found: Study) -> dict:
    """The options of a study where none is given."""
    flags = found.options.items()
    return {flag.strip("-"): settings.get("default") for flag, settings in flags}


class Counted:
    """A study of squares that remembers what it measured, and is interrupted at one case."""

    def __init__(self, monkeypatch, interrupted=None):
        self.measured, self.interrupted = [], interrupted
        monkeypatch.setattr(run, "NAMES", {"squares": "squares"})
        monkeypatch.setattr(run, "load_study", lambda name: self.study)
        show = columns("x {x} | square {square:.1f}")
        cases = [{"x": x, "body": object()} for x in (1.0, 2.0, np.nan)]
        self.study = Study([Table(lambda run: cases, self.measure, show)])

    def measure(self, run, x, body):
        if x == self.interrupted:
            raise KeyboardInterrupt
        self.measured.append(x)
        return {"square": x * x}


def test_a_record_says_how_it_came_about(tmp_path, capsys, monkeypatch):
    Counted(monkeypatch)
    run.main(["squares", "--json", "--out", str(tmp_path)])
    record = json.loads((tmp_path / "squares.json").read_text())
    assert json.loads(capsys.readouterr().out) == record
    assert list(record) == ["command", "versions", "machine", "date", "seconds", "result"]
    assert record["command"].startswith("python scripts/measure/run.py squares --json")
    assert record["versions"]["jax"] == jax.__version__
    assert record["machine"]["cores"] >= 1
    age = datetime.datetime.now(datetime.UTC) - datetime.datetime.fromisoformat(record["date"])
    assert age < datetime.timedelta(hours=1)
    rows = [{"x": 1.0, "square": 1.0}, {"x": 2.0, "square": 4.0}, {"x": None, "square": None}]
    assert record["result"] == {"rows": rows}


def test_a_tiny_run_measures_the_first_case(tmp_path, capsys, monkeypatch):
    counted = Counted(monkeypatch)
    run.main(["squares", "--tiny", "--out", str(tmp_path)])
    assert counted.measured == [1.0]
    assert capsys.readouterr().out.splitlines()[-1] == "| 1.0 | 1.0    |"


def test_an_interrupted_study_is_resumed_by_the_same_command(tmp_path, monkeypatch):
    argv = ["squares", "--out", str(tmp_path)]
    first = Counted(monkeypatch, interrupted=2.0)
    with pytest.raises(KeyboardInterrupt):
        run.main(argv)
    again = Counted(monkeypatch)
    record = run.main(argv)
    assert first.measured == [1.0]
    assert again.measured[:1] == [2.0]
    assert [row["x"] for row in record["result"]["rows"]] == [1.0, 2.0, None]
    assert [path.name for path in tmp_path.iterdir()] == ["squares.json"]


def test_solved_flows_are_read_as_they_were_written(tmp_path):
    """So that flows may be solved on one machine and models fitted on another."""
    _, samples, _ = bodies = solved_flows.bodies_of("lift", True, 16)
    rows, count = np.random.default_rng(0), samples.count
    flags = rows.integers(9, size=count), rows.random(count) < 0.5
    loads = rows.normal(size=(count, 3))
    held_out = solved_flows.FlowBatch(rows.normal(size=(count, 5)), loads, *flags)
    training = solved_flows.LoadsAndGradients(loads, rows.normal(size=(count, 3, 7)), loads, *flags)
    flows = solved_flows.SolvedFlows(samples, training, held_out, np.array(0.5), np.array("GPU"))
    options = {"flows": tmp_path / "flows.npz"}
    solved_flows.write_flows(options["flows"], flows)
    found = solved_flows.read_or_solve(Run(True, options), *bodies)
    jax.tree.map(np.testing.assert_array_equal, found, flows)
    others = solved_flows.bodies_of("particle", True, 16)
    with pytest.raises(InvalidInput, match=r"flows\.npz: has the flows of other bodies"):
        solved_flows.read_or_solve(Run(True, options), *others)


def test_an_unknown_study_is_refused():
    with pytest.raises(InvalidInput, match="study 'flows': one of accelerator, compilation, "):
        run.main(["flows"])


def test_every_study_is_told_and_none_else():
    described = re.findall(r"<!-- (\w+) -->", report.BOOK.read_text())
    assert sorted(described) == sorted([*run.NAMES, "payoff", "payoff_space"])


def test_what_is_foreseen_was_measured():
    rows = json.loads((run.RESULTS / "foreseen.json").read_text())["result"]["rows"]
    assert {(row["dimension"], row["bodies"] == SYMMETRIC) for row in rows} == set(CONVOLUTIONS)
    for row in rows:
        takes = CONVOLUTIONS[row["dimension"], row["bodies"] == SYMMETRIC]
        foreseen = takes._asdict()[row["name"]]
        assert foreseen == pytest.approx(row["measured"], rel=0.25), row["name"]


def test_texts_are_what_the_results_say():
    assert report.main(["--check"])


def test_a_stale_text_is_told(tmp_path, monkeypatch):
    readme = tmp_path / "README.md"
    readme.write_text("<!-- accuracy -->\nold\n<!-- /accuracy -->\n")
    monkeypatch.setattr(report, "README", readme)
    with pytest.raises(InvalidInput, match=r"README.md: differs from what"):
        report.main(["--check"])


def test_figures_are_filled_in_and_missing_ones_left_out(tmp_path):
    run.keep("duration", {"seconds": [240, 480]}, "command", out=tmp_path)
    shutil.copy(run.RESULTS / "accelerator.json", tmp_path)
    text = (
        "a\n<!-- duration -->\nold\n<!-- /duration -->\nb\n<!-- payoff -->\nx\n<!-- /payoff -->\n"
    )
    filled = report.filled(text, passage, tmp_path)
    assert "4 to 8 minutes" in filled
    assert filled.endswith("<!-- /duration -->\nb\n<!-- payoff -->\n<!-- /payoff -->\n")
    assert report.filled(filled, passage, tmp_path) == filled


def test_the_accuracy_is_the_mean_and_the_largest_error_of_the_record(tmp_path):
    kept = shutil.copytree(run.RESULTS, tmp_path / "kept")
    line = {"panel": "accuracy", "row": "standard, x", "column": "y"}
    rows = [line | {"error": error} for error in (0.001, -0.003)]
    run.keep("flow", {"rows": rows}, "command", out=kept)
    rows = [
        line | {"panel": panel, "error": share * error}
        for panel, share in (("sphere", 1), ("aspect", 2), ("ellipsoids", 3))
        for error in (0.001, -0.003)
    ]
    run.keep("flow_3d", {"rows": rows}, "command", out=kept)
    found = passage("accuracy", kept)
    assert "Cd of the cylinder 0.20, 0.30" in found
    assert "of the sphere 0.20, 0.30, of 2 bodies of revolution 0.40, 0.60" in found
    assert "in Stokes flow 0.60, 0.90" in found


def test_payoff_is_kept_with_its_pictures(tmp_path):
    source, kept = tmp_path / "out" / "payoff.json", tmp_path / "kept"
    source.parent.mkdir()
    source.write_text(json.dumps({"payoff": [], "command": "python scripts/payoff.py"}))
    for name in ("payoff", "shapes"):
        source.with_name(f"{name}.png").write_bytes(b"picture")
    kept.mkdir()
    report.keep_payoff(source, kept, kept)
    record = json.loads((kept / "payoff.json").read_text())
    assert record["command"] == "python scripts/payoff.py"
    assert record["result"] == {"payoff": []}
    assert (kept / "shapes.png").read_bytes() == b"picture"


def test_json_has_no_infinity():
    values = {"a": [np.float64("nan"), np.inf, 1], 2: np.array([1.0, -np.inf]), "c": np.int32(3)}
    assert study.plain(values) == {"a": [None, None, 1], "2": [1.0, None], "c": 3}


def test_words_of_numbers():
    assert study.words("{x:+.1%}, {y:.0f}", x=0.0123, y=None) == "+1.2 %, -"


def test_tables_of_columns_and_of_maps():
    rows = study.panel("at {x}", "a", "b {y}", study.cases(x=(1, 2), y=(3, 4)))
    assert [(row["panel"], row["column"]) for row in rows[1:3]] == [
        ("at 1", "b 4"),
        ("at 2", "b 3"),
    ]
    crossed = study.maps(lambda row: f"{row['x'] * row['y']}")(rows)
    assert crossed.split("\n\n")[1].splitlines()[2] == "| a    | 6   | 8   |"
    table = columns("both {x}{y} | missing {z:.1f}")(rows[:1])
    assert table.splitlines()[0::2] == ["| both | missing |", "| 13   | -       |"]


def test_without_optional_packages_studies_say_so(tmp_path, capsys, monkeypatch):
    for package in ("ngsolve", "sklearn"):
        monkeypatch.setitem(sys.modules, package, None)
    assert list(rivals.rivals()) == ["gradient-enhanced kriging"]
    with pytest.raises(InvalidInput, match="NGSolve: pip install"):
        solve_by_elements(PLANE, {"aspect": 1.0}, 1.0)
    record = run.main(["onset", "--tiny", "--out", str(tmp_path)])
    assert record["result"]["rows"] == []
    assert "pip install" in capsys.readouterr().out


def symmetric(x, y):
    """Clockwise contour from the nose of an upper side and its mirror image."""
    upper = np.stack([x, y], axis=1)
    return np.concatenate([upper, upper[-2:0:-1] * [1, -1]])


@pytest.mark.parametrize("degrees", [60.0, 90.0, 102.6])
def test_front_of_a_wedge_is_its_angle(degrees):
    x = np.linspace(0, 1, 501)
    markers = symmetric(x, np.tan(np.radians(degrees / 2)) * np.minimum(x, (1 - x) / 4))
    assert literature.front_angles(markers) == pytest.approx((degrees, degrees))


def test_front_of_a_lens_is_continued_to_its_tip():
    """Two circular arcs that meet at a right angle: the tangent behind the tip is flatter."""
    x = np.linspace(-1, 1, 2001)
    tangent, wedge = literature.front_angles(symmetric(x, np.sqrt(2 - x**2) - 1))
    assert wedge == pytest.approx(86.8, abs=0.2)
    assert 65 < tangent < 75


def test_slender_ellipses_have_sharper_fronts():
    family = Family()
    bodies = [family.markers(family.ellipse(aspect), 4000) for aspect in (2.0, 3.0, 4.0)]
    wedges = [literature.front_angles(np.asarray(markers))[1] for markers in bodies]
    assert wedges == sorted(wedges, reverse=True)


def test_a_line_agrees_within_its_tolerance():
    assert literature.line("", 1.04, 1.0, 0.05, "")["agrees"] == "yes"
    assert literature.line("", 0.94, 1.0, 0.05, "")["agrees"] == "no"


@pytest.mark.slow
def test_comparison_with_the_literature():
    """What others publish, and what our own elements say of the optima of the flow."""
    pytest.importorskip("ngsolve")
    by_table = [
        [row | case for case in table.chosen(Run()) for row in table.rows(Run(), case)]
        for table in literature.STUDIES["literature"].tables
    ]
    rows = {row["quantity"]: row for row in by_table[0]}
    where = next(name.partition(":")[0] for name in rows if "tunnel" in name)
    where += f":{next(name for name in rows if 'tunnel' in name).split(':')[1]}"
    cylinder = sum(
        rows[f"{where}: cylinder, {part} drag"]["ours"] for part in ("pressure", "friction")
    )
    assert cylinder == pytest.approx(sum(literature.CYLINDER), rel=1e-3)
    assert rows["Re 1, body-fitted adjoint: gain, %"]["agrees"] == "yes"
    gains = [row for row in by_table[1] if row["quantity"] == "gain of the optimum"]
    assert [row["reynolds"] for row in gains] == [1, 40]
    assert all(abs(row["flow"] - row["elements"]) < 0.1 for row in gains)
    (cost,) = (row for row in by_table[1] if row not in gains)  # of the published aspect
    assert 0 < cost["elements"] < 0.1
    assert cost["flow"] == pytest.approx(cost["elements"], abs=0.02)


@pytest.mark.parametrize("name", rivals.rivals())
def test_rivals_fitted_to_known_drags_return_them(name):
    """Of 64 bodies, whose log Cd is linear in the parameters and in log Re."""
    scene = Scene()
    samples = held_out_samples(scene, 0, 64)
    inputs, slopes = scene_inputs(scene), np.array([[-0.2, 0.05, 0.0, 0.02, -0.7]])
    at = np.column_stack([samples.parameters, np.log(samples.reynolds)])
    drags = np.exp(2.0 + at @ slopes[0])
    flows = [
        Observation(*body, np.array([drag]), slopes)
        for *body, drag in zip(*samples, drags, strict=True)
    ]
    z = np.asarray(jax.vmap(inputs)(*samples))
    predict = rivals.rivals()[name](rivals.Solved(inputs, z, flows))
    np.testing.assert_allclose(predict(z), np.log(drags), atol=0.02)
