"""The studies run, their results are whole, and the texts say what the results say."""

import datetime
import importlib
import json
import re
import sys

import jax
import numpy as np
import pytest
import report
import rivals
import speed
import study
from conftest import SCRIPTS
from literature import CYLINDER, front_angles, line, measure
from plane import solve_by_plane_elements

from surrogate import Family, InvalidInput
from surrogate.scene.cost import CONVOLUTIONS

MEASURE = SCRIPTS / "measure"
NAMES = sorted(p.stem for p in MEASURE.glob("*.py") if "\nSTUDY = " in p.read_text())
LONG = {
    "corners",
    "designs",
    "devices",
    "dimension",
    "extrapolated",
    "foreseen",
    "least",
    "safeguards",
    "settling",
    "shards",
    "space_rival",
    "space_speed",
    "speed",
    "stability",
    "streams",
    "training",
    "training_space",
    "trainings_on_devices",
    "trust",
    "trust_space",
}  # they start processes, or compile for long
TIMED = [pytest.param(n, marks=pytest.mark.slow) if n in LONG else n for n in NAMES]
ENVELOPE = ["command", "versions", "machine", "date", "seconds", "result"]


@pytest.mark.parametrize("name", TIMED)
def test_study_runs_and_keeps_its_record(name, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("shapeopt.commands.march_flow.FRAMES", 4)
    found = importlib.import_module(name).STUDY
    record = study.carry_out(found, ["--tiny", "--json", "--out", str(tmp_path)])
    printed = json.loads(capsys.readouterr().out.splitlines()[-1])
    kept = json.loads((tmp_path / f"{name}.json").read_text())
    assert printed == kept == record
    assert list(kept) == ENVELOPE
    assert kept["command"].startswith(f"python scripts/measure/{name}.py --tiny")
    assert kept["versions"]["jax"] == jax.__version__
    assert kept["machine"]["cores"] >= 1
    assert kept["seconds"] > 0
    age = datetime.datetime.now(datetime.UTC) - datetime.datetime.fromisoformat(kept["date"])
    assert age < datetime.timedelta(hours=1)
    text = found.tables(kept["result"])
    assert any(character.isdigit() for character in text)
    for table in re.findall(r"(?:^\|.*\n?)+", text, re.M):
        assert len({row.count("|") for row in table.splitlines()}) == 1
    assert (tmp_path / f"{name}.png").is_file() == bool(found.draw)


def test_every_study_is_told_and_none_else():
    told = re.findall(r"<!-- (\w+) -->", report.BOOK.read_text())
    assert sorted(told) == sorted([*NAMES, "payoff", "payoff_space"])


def test_what_is_foreseen_was_measured():
    rows = json.loads((study.RESULTS / "foreseen.json").read_text())["result"]["rows"]
    assert {row["dimension"] for row in rows} == set(CONVOLUTIONS)
    for row in rows:
        foreseen = CONVOLUTIONS[row["dimension"]]._asdict()[row["name"]]
        assert foreseen == pytest.approx(row["measured"], rel=0.25), row["what"]


def test_texts_are_what_the_results_say():
    assert report.main(["--check"])


def test_a_stale_text_is_told(tmp_path, monkeypatch):
    readme = tmp_path / "README.md"
    readme.write_text("<!-- accuracy -->\nold\n<!-- /accuracy -->\n")
    monkeypatch.setattr(report, "README", readme)
    with pytest.raises(InvalidInput, match=r"README.md: is not what"):
        report.main(["--check"])


def test_figures_are_filled_in_and_missing_ones_left_out(tmp_path):
    rows = [{"panel": "accuracy", "row": "standard, x", "error": e} for e in (0.001, -0.003)]
    study.keep("flow", {"rows": rows}, "command", out=tmp_path)
    text = (
        "a\n<!-- accuracy -->\nold\n<!-- /accuracy -->\nb\n<!-- payoff -->\nx\n<!-- /payoff -->\n"
    )
    filled = report.filled(text, report.short_block, tmp_path)
    assert "0.20 % off" in filled
    assert "0.30 % at most" in filled
    assert filled.endswith("<!-- /accuracy -->\nb\n<!-- payoff -->\n<!-- /payoff -->\n")
    assert report.filled(filled, report.short_block, tmp_path) == filled


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


def test_without_optional_packages_studies_say_so(monkeypatch):
    for package in ("ngsolve", "sklearn"):
        monkeypatch.setitem(sys.modules, package, None)
    assert list(rivals.rivals()) == ["kriging, with slopes"]
    with pytest.raises(InvalidInput, match="NGSolve: pip install"):
        solve_by_plane_elements({"aspect": 1.0}, 1.0)
    for part in ("cells", "gradients", "batches"):
        monkeypatch.setattr(speed, f"_{part}", lambda *_: [])
    monkeypatch.setattr(speed, "medians", lambda *_: [1.0])
    result = speed.measure(True, lambda *_: None)
    assert result["rival"] == []
    assert "pip install" in speed.tables(result)


def symmetric(x, y):
    """Clockwise contour from the nose of an upper side and its mirror image."""
    upper = np.stack([x, y], axis=1)
    return np.concatenate([upper, upper[-2:0:-1] * [1, -1]])


@pytest.mark.parametrize("degrees", [60.0, 90.0, 102.6])
def test_front_of_a_wedge_is_its_angle(degrees):
    x = np.linspace(0, 1, 501)
    markers = symmetric(x, np.tan(np.radians(degrees / 2)) * np.minimum(x, (1 - x) / 4))
    assert front_angles(markers) == pytest.approx((degrees, degrees))


def test_front_of_a_lens_is_continued_to_its_tip():
    """Two circular arcs that meet at a right angle: the tangent behind the tip is flatter."""
    x = np.linspace(-1, 1, 2001)
    tangent, wedge = front_angles(symmetric(x, np.sqrt(2 - x**2) - 1))
    assert wedge == pytest.approx(86.8, abs=0.2)
    assert 65 < tangent < 75


def test_slender_ellipses_have_sharper_fronts():
    family = Family()
    bodies = [family.markers(family.ellipse(aspect), 4000) for aspect in (2.0, 3.0, 4.0)]
    wedges = [front_angles(np.asarray(markers))[1] for markers in bodies]
    assert wedges == sorted(wedges, reverse=True)


def test_a_line_agrees_within_its_tolerance():
    assert line("", 1.04, 1.0, 0.05, "")["agrees"] == "yes"
    assert line("", 0.94, 1.0, 0.05, "")["agrees"] == "no"


@pytest.mark.slow
def test_comparison_with_the_literature():
    rows = {row["quantity"]: row for row in measure(False, lambda *_: None)["rows"]}
    where = next(name.partition(":")[0] for name in rows if "tunnel" in name)
    where += f":{next(name for name in rows if 'tunnel' in name).split(':')[1]}"
    cylinder = sum(
        rows[f"{where}: cylinder, {part} drag"]["ours"] for part in ("pressure", "friction")
    )
    assert cylinder == pytest.approx(sum(CYLINDER), rel=1e-3)
    for name in (f"{where}: aspect", "Re 40, body-fitted adjoint: gain, %"):
        assert rows[name]["agrees"] == "yes"
