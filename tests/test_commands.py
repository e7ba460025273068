"""The commands' contract: exit status, one JSON object, files that are written once."""

import dataclasses
import importlib
import json
import re
import shutil
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from pictures import pixels

from shapeopt.commands.arguments import shapes_of
from shapeopt.commands.cli import run
from shapeopt.commands.solve_drag import _parser as solve_parser
from shapeopt.commands.train_surrogate import _errors as training_errors
from surrogate import Flow, NotConverged, load, save
from surrogate.model.card import recorded_errors

ROOT = Path(__file__).parents[1]
FAMILY = ["--aspect", "2", "--beta2", "0.1"]
EXAMPLES = {"first_hour", "settling_speed"}  # scripts to read, no commands


def call(script, *arguments):
    """Run a script's main in this process; its exit status."""
    return run(importlib.import_module(script).main, [str(a) for a in arguments])


def answer(capsys, script, *arguments):
    status = call(script, *arguments, "--json")
    captured = capsys.readouterr()
    assert status == 0, captured.err
    return json.loads(captured.out.splitlines()[-1])


TINY = """
stream = "tunnel:12"
reynolds = [5, 45]
[family]
aspect = [1, 3]
beta2 = [-0.2, 0.2]
[fidelity]
name = "tiny"
cells = 8
upstream = 2.5
downstream = 4
height = 4
harmonics = 5
wake = 0
"""


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A scene in a file: a tunnel, two parameters, small enough for a test."""
    path = tmp_path_factory.mktemp("scenes") / "tunnel.toml"
    path.write_text(TINY)
    return path


@pytest.fixture(scope="module")
def trained(tmp_path_factory, scene):
    """A surrogate by the real command."""
    folder = tmp_path_factory.mktemp("trained") / "sip"
    arguments = ["--method", "sip", "--scene", scene, "--samples", "24", "--held-out", "12"]
    assert call("train_surrogate", *arguments, "--width", "16", "--out", folder) == 0
    return folder


def test_solve_drag(capsys):
    result = answer(
        capsys, "solve_drag", *FAMILY, "--reynolds", "10,40", "--fidelity", "draft", "--gradient"
    )
    first, second = result["results"]
    assert set(first) == {
        *("reynolds", "cd", "cd_pressure", "cd_friction", "cl", "cm", "converged", "iterations"),
        *("green_applications", "wall_s", "gradient", "estimated_error", "status"),
        *(
            "estimated_lift_error",
            "estimated_moment_error",
            "sufficient",
            "cd_extrapolated",
            "expected_error",
            "accuracy",
            "onset",
        ),
        *("incidence", "chord", "chord_reynolds", "centroid", "reference", "cells", "glide"),
    }
    assert first["reynolds"] == 10
    assert first["cd"] > second["cd"] > 1
    assert first["cd"] == pytest.approx(first["cd_pressure"] + first["cd_friction"])
    assert set(first["gradient"]) == {"aspect", "beta2", "beta3", "beta4", "reynolds"}
    assert first["gradient"]["reynolds"] < 0
    assert result["scene"]["fidelity"]["name"] == "draft"


def test_negative_numbers_of_every_form_are_values(capsys):
    arguments = ["--surrogate", "pretrained", "--reynolds", "20", "--aspect", "2", "--beta2"]
    drags = [
        answer(capsys, "predict_drag", *arguments, value)["results"][0]["cd"]
        for value in ("-0.05", "-5e-2", "0.05")
    ]
    assert drags[0] == drags[1] != drags[2]


def test_a_drag_outside_the_trained_ranges_must_be_asked_for(capsys):
    arguments = ["--aspect", "6", "--reynolds", "20"]
    assert call("predict_drag", *arguments, "--json") == 2
    assert "--extrapolate" in capsys.readouterr().err
    result = answer(capsys, "predict_drag", *arguments, "--extrapolate")["results"][0]
    assert result["cd"] > 0
    assert not result["in_trained_range"]
    assert result["confidence"] == "outside: aspect by 0.25 of its trained range"
    assert result["cd_error_bound"] is None


def test_bodies_have_an_incidence_where_the_option_is_given():
    """Also 0, so that gradients are by it; without it they are symmetric in every respect."""
    words = ["--aspect", "2", "--reynolds", "9"]
    (plain,) = shapes_of(solve_parser().parse_args(words)).values()
    (level,) = shapes_of(solve_parser().parse_args([*words, "--incidence", "0"])).values()
    assert "incidence" not in plain.parameters
    assert level.parameters["incidence"] == 0.0
    assert level.symmetric
    assert not level.differentiable().symmetric


def test_flows_that_do_not_converge_leave_the_predictions(monkeypatch, capsys):
    class Flow:
        def __init__(self, scene):
            self.scene = scene

        def solve(self, body, reynolds, allow_unsteady):
            if reynolds > 15:
                raise NotConverged(f"flow at Re {reynolds:g}")
            known = {"status": "accurate", "accuracy": "meets 0.4 %", "expected_error": 0.001}
            more = {"moment_about": lambda station: 0.0, "estimated_error": 0.002}
            return SimpleNamespace(loads=np.array([2.5, 0.0, 0.0]), **known, **more)

    monkeypatch.setattr("shapeopt.commands.verification.Flow", Flow)
    words = ["--aspect", "2", "--reynolds", "10,20", "--verify", "--moment-about", "0.25"]
    assert call("predict_drag", *words, "--json") == 3
    captured = capsys.readouterr()
    good, bad = json.loads(captured.out.splitlines()[-1])["results"]
    assert captured.err.splitlines()[-1].endswith(
        "1 of 2 flows did not converge: incidence 0 at Re 20"
    )
    assert set(good) == set(bad)
    assert (good["converged"], good["cd_flow"]) == (True, 2.5)
    assert good["cd_error"] == pytest.approx(abs(good["cd"] / 2.5 - 1))
    assert (bad["converged"], bad["cd_flow"], bad["cd_error"]) == (False, None, None)
    assert bad["cd"] > 0
    assert call("predict_drag", *words) == 3
    assert "the flow did not converge" in capsys.readouterr().out


def test_trainings_tell_the_errors_of_all_loads():
    words = training_errors(recorded_errors(load("pretrained:lift").record))
    assert re.fullmatch(r"error of Cd .* at most; of Cl .*; of Cm .* \(all over Cd\)", words)
    assert "over" not in training_errors(recorded_errors(load("pretrained").record))


def test_solve_drag_of_contours(capsys, tmp_path, no_estimates):
    angle = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    ellipse = np.stack([np.cos(angle), 0.5 * np.sin(angle)], axis=1)
    np.savetxt(tmp_path / "e.csv", ellipse, delimiter=",", header="x,y", comments="")
    common = ["--reynolds", "20", "--fidelity", "draft", "--cells", "8", "--incidence", "20"]
    contour = answer(capsys, "solve_drag", "--contour", tmp_path / "e.csv", *common)["results"][0]
    family = answer(capsys, "solve_drag", "--aspect", "2", *common)["results"][0]
    assert contour["cd"] == pytest.approx(family["cd"], rel=2e-3)
    assert contour["cl"] == pytest.approx(family["cl"], rel=1e-2)
    assert contour["cl"] > 0.3


def test_train_predict_optimise_render(capsys, trained, tmp_path, no_estimates):
    """A scene of one's own from its file to a picture: a tunnel, bounds, a verified optimum."""
    record = json.loads((trained / "surrogate.json").read_text())
    for key in ("scene", "method", "seed", "versions", "drag_error_mean", "command"):
        assert key in record
    assert record["scene"]["stream"] == "tunnel:12.0"
    assert record["samples"] == 24
    assert record["drag_error_mean"] < 0.05
    assert not list(trained.parent.glob("*.checkpoint*"))

    arguments = ["--surrogate", trained, *FAMILY, "--reynolds", "10,20", "--verify"]
    for row in answer(capsys, "predict_drag", *arguments, "--moment-about", "0.25")["results"]:
        assert row["cm_about_flow"] == pytest.approx(row["cm_about"], abs=1e-6)  # symmetric
        assert row["in_trained_range"]
        assert row["cd"] == pytest.approx(row["cd_flow"], rel=0.1)
        assert row["cd_error"] == pytest.approx(abs(row["cd"] / row["cd_flow"] - 1))

    out = tmp_path / "run"
    arguments = ["--surrogate", trained, "--reynolds", "20", "--out", out, "--max-length", "1.6"]
    result = answer(capsys, "optimize_shape", *arguments)
    assert set(result) >= {
        *("parameters", "cd_start", "cd_surrogate", "cd_verified", "calls", "loop_s", "verify_s"),
        *("contour", "converged", "flows", "green_applications", "kkt_residual", "status"),
    }
    assert result["converged"]
    assert result["cd_verified"] < result["cd_start"]
    assert np.sqrt(result["parameters"]["aspect"]) <= 1.6 + 1e-6
    contour = np.loadtxt(result["contour"], delimiter=",", skiprows=1)
    assert np.ptp(contour[:, 0]) == pytest.approx(np.sqrt(result["parameters"]["aspect"]), rel=1e-3)

    for name in ("shapes.png", "evolution.gif"):
        picture = answer(capsys, "render_shapes", "--runs", out, "--out", tmp_path / name)["out"]
        assert Path(picture).stat().st_size > 5000

    page = answer(capsys, "explore", "--surrogate", trained, "--out", tmp_path / "page.html")
    assert page["bytes"] == (tmp_path / "page.html").stat().st_size


def refuse_to_work(*arguments, **options):
    raise AssertionError("this is done already")


def without_work(monkeypatch):
    """No training, flow or search may run."""
    for name in ("train_surrogate.forecast", "train_surrogate.train_plan"):
        monkeypatch.setattr(f"shapeopt.commands.{name}", refuse_to_work)
    for name in ("optimise", "Designer", "save_run", "candidates"):
        monkeypatch.setattr(f"shapeopt.commands.optimize_shape.{name}", refuse_to_work)
    for name in ("solve", "solve_all", "drag"):
        monkeypatch.setattr(Flow, name, refuse_to_work)


def same_again(capsys, monkeypatch, folder, answers, *arguments):
    """The command says that it is done, and prints what it printed before, without work."""
    before = {path: (path.read_bytes(), path.stat().st_mtime_ns) for path in folder.iterdir()}
    with monkeypatch.context() as patch:
        without_work(patch)
        assert call(*arguments, "--json") == 0
    printed = capsys.readouterr()
    assert json.loads(printed.out) == answers
    assert "is done already" in printed.err
    assert before == {p: (p.read_bytes(), p.stat().st_mtime_ns) for p in folder.iterdir()}


def refused_in_one_line(capsys, monkeypatch, words, *arguments):
    with monkeypatch.context() as patch:
        without_work(patch)
        assert call(*arguments, "--json") == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    (line,) = printed.err.splitlines()
    assert words in line
    assert "--overwrite" in line


def test_the_width_of_the_layers_can_be_chosen(capsys, monkeypatch, scene, trained):
    assert [len(layer.bias) for layer in load(trained).network.layers[:-1]] == [16, 16]
    arguments = ["train_surrogate", "--method", "sip", "--scene", scene, "--samples", "24"]
    arguments += ["--held-out", "12", "--out", trained]
    words = "holds another training (width 16, not 20); overwrite"
    refused_in_one_line(capsys, monkeypatch, words, *arguments)
    assert call(*arguments, "--width", "16") == 0
    assert "is done already" in capsys.readouterr().err


@pytest.mark.slow
def test_a_training_into_the_folder_of_one(capsys, monkeypatch, scene, tmp_path):
    arguments = ["train_surrogate", "--method", "sip", "--scene", scene, "--samples", "8"]
    arguments += ["--out", tmp_path / "sip"]
    first = answer(capsys, *arguments, "--budget-seconds", "1")
    (tmp_path / "sip" / "notes.txt").write_text("mine")
    same = [*arguments, "--budget-seconds", "1"]
    same_again(capsys, monkeypatch, tmp_path / "sip", first, *same)
    words = "holds another training (budget in seconds 1, not none); overwrite"
    refused_in_one_line(capsys, monkeypatch, words, *arguments)
    assert answer(capsys, *arguments, "--overwrite")["train_s"] != first["train_s"]
    refused_in_one_line(capsys, monkeypatch, "seconds none, not 1", *same)
    assert (tmp_path / "sip" / "notes.txt").read_text() == "mine"


def test_a_design_into_the_folder_of_one(capsys, monkeypatch, trained, tmp_path, no_estimates):
    out = tmp_path / "run"
    arguments = ["optimize_shape", "--surrogate", trained, "--out", out, "--reynolds"]
    first = answer(capsys, *arguments, "20", "--max-length", "1.5")
    (out / "notes.txt").write_text("mine")
    for same in ("20", "20.0"):
        options = [*arguments, same, "--max-length", "1.5", "--until", "surrogate"]
        same_again(capsys, monkeypatch, out, first, *options)
    for words, options in {
        "objective reynolds 20, not 30": ["30", "--max-length", "1.5"],
        "max length 1.5, not none": ["20"],
        "trust 0, not 0.1": ["20", "--max-length", "1.5", "--trust", "0.1"],
        "until surrogate, not flow": ["20", "--max-length", "1.5", "--until", "flow"],
        "objective kind AtReynolds, not Robust": ["20", "--spread", "0.1"],
    }.items():
        refused_in_one_line(capsys, monkeypatch, words, *arguments, *options)
    again = answer(capsys, *arguments, "20", "--overwrite")
    assert again["parameters"]["aspect"] > first["parameters"]["aspect"]
    assert (out / "notes.txt").read_text() == "mine"
    (out / "body.stl").unlink()  # left half written, or removed: designed again
    capsys.readouterr()
    assert answer(capsys, *arguments, "20")["cd_verified"] == again["cd_verified"]
    assert (out / "body.stl").is_file()


def test_a_design_by_weights_that_changed_is_another_one(
    capsys, monkeypatch, trained, tmp_path, no_estimates
):
    folder, run = shutil.copytree(trained, tmp_path / "net"), tmp_path / "run"
    arguments = ["optimize_shape", "--surrogate", folder, "--reynolds", "20", "--out", run]
    answer(capsys, *arguments)
    net = load(folder)
    halved = net.network.with_weights(net.network.weights * 0.999)
    save(folder, dataclasses.replace(net, network=halved))
    refused_in_one_line(capsys, monkeypatch, "holds another design (surrogate sip", *arguments)


def test_commands_say_in_one_line_that_a_surrogate_is_inaccurate(
    capsys, trained, tmp_path, no_estimates
):
    folder = shutil.copytree(trained, tmp_path / "rough")
    record = json.loads((folder / "surrogate.json").read_text())
    errors = {"drag_error_mean": 0.064, "drag_error_max": 0.2}
    (folder / "surrogate.json").write_text(json.dumps(record | errors))
    predict = ["predict_drag", "--surrogate", folder, *FAMILY, "--reynolds", "20"]
    optimise = ["optimize_shape", "--surrogate", folder, "--reynolds", "20"]
    for arguments in (predict, [*optimise, "--out", tmp_path / "run"]):
        assert call(*arguments, "--json") == 0
        printed = capsys.readouterr()
        lines = [line for line in printed.err.splitlines() if "warning" in line]
        assert len(lines) == 1
        assert f"warning: surrogate {folder}: its loads are inaccurate: " in lines[0]
        assert "6.40% on average and 20.00% at most" in lines[0]
        assert json.loads(printed.out)["warning"] in lines[0]


@pytest.mark.slow
def test_sheet_of_designs(capsys, tmp_path):
    arguments = ["--reynolds", "40,1", "--max-length", "1.2,1.6", "--out", tmp_path / "sheet.png"]
    result = answer(capsys, "design_sheet", *arguments)
    rows = {(row["reynolds"], row["max_length"]): row for row in result["designs"]}
    assert len(rows) == 6
    for (_, length), row in rows.items():
        assert length is None or row["parameters"]["aspect"] <= length**2 + 1e-6
        assert row["kkt_residual"] < 1e-5
    for reynolds in (1.0, 40.0):
        cds = [rows[reynolds, length]["cd"] for length in (1.2, 1.6, None)]
        assert cds == sorted(cds, reverse=True)
    pixels(tmp_path / "sheet.png")


@pytest.mark.slow
def test_several_reynolds_numbers_to_the_flows_optimum(capsys, trained, tmp_path):
    arguments = ["--surrogate", trained, "--reynolds", "6,40", "--weights", "1,3"]
    result = answer(
        capsys, "optimize_shape", *arguments, "--until", "flow", "--out", tmp_path / "run"
    )
    assert result["cd_start"] == pytest.approx(1.0)
    ratios = [case["cd_verified"] / case["cd_start"] for case in result["cases"]]
    assert result["cd_verified"] == pytest.approx(np.average(ratios, weights=[1, 3]))
    assert result["kkt_residual"] <= 1e-2  # so coarse a grid wiggles
    assert result["flows"] % 2 == 0
    assert result["green_applications"] > 20 * result["flows"]
    assert result["reynolds"] == 40


@pytest.mark.slow
def test_a_memory_makes_the_same_design_nearly_free(capsys, trained, tmp_path):
    memory = tmp_path / "flows.json"
    arguments = ["--surrogate", trained, "--reynolds", "20", "--until", "flow", "--memory", memory]
    first = answer(capsys, "optimize_shape", *arguments, "--out", tmp_path / "run")
    again = answer(capsys, "optimize_shape", *arguments, "--out", tmp_path / "again")
    assert first["flows"] >= 1
    assert again["flows"] <= 1
    assert again["cd_verified"] == pytest.approx(first["cd_verified"], rel=1e-4)


def test_optimise_directly_in_a_scene_of_a_file(capsys, scene, tmp_path, no_estimates):
    arguments = ["--surrogate", "none", "--scene", scene, "--reynolds", "40"]
    result = answer(capsys, "optimize_shape", *arguments, "--out", tmp_path / "direct")
    assert result["cd_verified"] < 0.85 * result["cd_start"]
    assert result["cd_surrogate"] is None
    assert result["flows"] > 1


@pytest.mark.slow
def test_march(capsys, tmp_path):
    arguments = ["--aspect", "1", "--chord-reynolds", "20", "--time", "5", "--height", "6"]
    result = answer(capsys, "march_flow", *arguments, "--out", tmp_path / "march")
    assert (result["reynolds"], result["chord"], result["chord_reynolds"]) == (20, 1, 20)
    assert result["body"]["parameters"]["aspect"] == 1
    assert (result["incidence"], result["height"]) == (0, 6)
    assert result["cl_mean"] == pytest.approx(0, abs=1e-3)
    assert result["cd"] == pytest.approx(result["cd_steady"], rel=0.2)
    assert Path(result["gif"]).read_bytes().startswith(b"GIF8")


@pytest.mark.slow
def test_payoff_of_a_scene_in_a_file(capsys, scene, tmp_path):
    """The README's main job, tiny: four trainings, designs by each, tables and pictures."""
    out = tmp_path / "payoff"
    arguments = ["--scene", scene, "--samples", "16", "--queries", "3"]
    arguments += ["--budget-seconds", "2", "--out", out]
    result = answer(capsys, "payoff", *arguments)
    ways = {row["method"] for row in result["payoff"]}
    assert {"direct", "kriging with memory", "dp", "sip", "hig", "supervised"} < ways
    assert all(row["kkt_max"] <= 1e-2 for row in result["payoff"])
    assert all(0 <= row["gap_max"] < 2e-3 for row in result["payoff"])
    assert result["payoff"][0]["method"] == "direct"
    assert result["payoff"][0]["flows_per_design"] > 2
    assert Path(result["shapes"]).exists()
    assert Path(result["plot"]).exists()
    before = (out / "sip" / "weights.eqx").stat().st_mtime_ns
    (out / "sip" / "notes.txt").write_text("mine")
    stored = (out / "payoff.json").stat().st_mtime_ns
    assert answer(capsys, "payoff", *arguments) == result
    assert (out / "payoff.json").stat().st_mtime_ns == stored
    assert call("payoff", *arguments, "--queries", "4") == 2
    assert "another payoff (queries 3, not 4)" in capsys.readouterr().err
    again = answer(capsys, "payoff", *arguments, "--overwrite")
    assert (out / "sip" / "weights.eqx").stat().st_mtime_ns == before
    assert (out / "sip" / "notes.txt").exists()
    assert again["drags"] == result["drags"]


def test_export(tmp_path, capsys):
    out = tmp_path / "drag.c"
    arguments = ("--to", "c", "--prefix", "drag", "--precision", "single", "--out", str(out))
    assert answer(capsys, "export_surrogate", *arguments)["bytes"] == out.stat().st_size
    assert "int drag_loads(const drag_real *inputs" in out.read_text()
    assert call("export_surrogate", "--to", "c", "--out", str(tmp_path / "drag.f90")) == 2
    assert "must name a file that ends in .c" in capsys.readouterr().err


@pytest.mark.parametrize("script", sorted(path.name for path in (ROOT / "scripts").glob("*.py")))
def test_help_tells_examples_and_statuses(script, capsys):
    with pytest.raises(SystemExit) as ended:
        importlib.import_module(script.removesuffix(".py")).main(["--help"])
    text = capsys.readouterr().out
    assert ended.value.code == 0
    assert f"python scripts/{script}" in text
    for status in ("0 done", "2 bad input", "3 not converged", "4 not written", "130 interrupted"):
        assert status in " ".join(text.split())


@pytest.mark.parametrize("script", ["train_surrogate", "predict_drag", "optimize_shape", "payoff"])
def test_help_explains_the_training_methods(script, capsys):
    with pytest.raises(SystemExit):
        importlib.import_module(script).main(["--help"])
    text = " ".join(capsys.readouterr().out.split()).replace("- ", "-")
    for name in ("differentiable physics", "scale-invariant physics", "half-inverse gradients"):
        assert name in text


@pytest.mark.parametrize("script", ["solve_drag", "predict_drag", "optimize_shape"])
def test_help_tells_the_familys_formula(script, capsys):
    with pytest.raises(SystemExit):
        importlib.import_module(script).main(["--help"])
    assert "x = -(c/2) cos t" in capsys.readouterr().out


def test_entry_point(capsys, monkeypatch):
    """The installed package's one command gives the same answers and refusals."""
    from shapeopt.commands.entry import COMMANDS, main

    def entered(*words):
        monkeypatch.setattr(sys, "argv", ["drag-surrogates", *words])
        status = main()
        return status, capsys.readouterr()

    status, printed = entered("predict", "--aspect", "2", "--reynolds", "20", "--json")
    assert status == 0
    assert json.loads(printed.out)["results"][0]["cd"] > 1
    status, printed = entered("fly")
    assert (status, printed.out) == (2, "")
    assert len(printed.err.splitlines()) == 1
    status, printed = entered("--help")
    assert status == 0
    assert all(name in printed.out for name in COMMANDS)
    scripts = {path.stem for path in (ROOT / "scripts").glob("*.py")} - EXAMPLES
    assert len(COMMANDS) == len(scripts)


@pytest.mark.slow
def test_pretrained_optimum_beats_the_cylinder_by_a_quarter(capsys, tmp_path):
    arguments = ["--surrogate", "pretrained", "--reynolds", "40", "--out", tmp_path / "run"]
    result = answer(capsys, "optimize_shape", *arguments)
    assert result["cd_verified"] <= 0.76 * result["cd_start"]


def test_free_fall(tmp_path, capsys):
    files = ["--table", tmp_path / "fall.csv", "--plot", tmp_path / "fall.png"]
    words = ["--aspect", "2", "--particle", "1.2,1e-6,4e-4", "--seconds", "2", "--tilt", "70"]
    result = answer(capsys, "free_fall", *words, *files)
    assert result["stable_incidences"] == [90.0]
    assert abs(result["incidence"]) == pytest.approx(90.0, abs=1.0)
    assert result["z"] < 0
    rows = (tmp_path / "fall.csv").read_text().splitlines()
    assert rows[0].split(",") == ["time", "x", "z", "tilt", "incidence", "reynolds", "u", "w"]
    assert float(rows[-1].split(",")[2]) == result["z"]
    assert list(map(float, rows[-1].split(",")[-2:])) == [result["u"], result["w"]]
    assert result["velocity"] == pytest.approx(np.hypot(result["u"], result["w"]))
    assert (tmp_path / "fall.png").stat().st_size > 5000
    sphere = answer(capsys, "free_fall", *words, "--aspect", "1")
    assert (sphere["stable_incidences"], sphere["moment_is_known"]) == (None, False)
    for wrong, message in (
        (["--particle", "1.2,1e-6"], "density ratio,viscosity,size"),
        (["--surrogate", "pretrained:space"], "incidences from 0 to 90"),
        (["--plot", "fall.txt"], "ends in .png"),
        (["--aspect", "9"], "aspect 9"),
    ):
        assert call("free_fall", *words, *wrong) == 2
        assert message in capsys.readouterr().err
