"""Mistakes on the command line: exit status 2 (3 without a result), one clear line, no answer."""

import functools
import importlib
import subprocess
import sys
from pathlib import Path

import jax
import numpy as np
import pytest

from shapeopt.commands.cli import run
from surrogate import Flow
from surrogate.flow.solver.newton import NewtonSettings

SCRIPTS = Path(__file__).parents[1] / "scripts"
BODY = "--aspect 2 --beta2 0.1"
OPTIMISE = "optimize_shape --surrogate pretrained --out {folder}/x"
MISTAKES = {  # and what the answer must say
    f"solve_drag {BODY} --reynolds 0": "Reynolds number 0: must be a",
    f"solve_drag {BODY} --reynolds -5": "Reynolds number -5: must be a",
    f"solve_drag {BODY} --reynolds nan": "Reynolds number nan: must be a",
    f"solve_drag {BODY} --reynolds fast": "--reynolds 'fast': one number",
    f"solve_drag {BODY} --reynolds 150": "Reynolds number 150: the steady flow",
    "solve_drag --aspect nan --reynolds 10": "aspect nan: must be a finite number",
    "solve_drag --aspect two --reynolds 10": "--aspect 'two': must be one number, without a unit",
    "solve_drag --aspect 2 --beta2 0.9 --reynolds 10": "beta2 0.9 make the contour",
    "solve_drag --contour {crossing} --reynolds 10": "contour: it crosses or touches itself",
    "solve_drag --contour {missing} --reynolds 10": "cannot be read",
    "solve_drag --aspect 2 --naca 0012 --reynolds 10": "body: give exactly one of --aspect",
    "solve_drag --naca 00zz --reynolds 10": "NACA 00zz: four digits with a",
    "solve_drag --naca 0012 --beta2 0.2 --reynolds 10": "--beta2 to --beta12 go with --aspect",
    "solve_drag --aspect 2 --keep-size --reynolds 10": "--keep-size: goes with",
    "march_flow --aspect 1 --reynolds 20 --time 0 --out {folder}/x": "--time 0: from 5 to 2000",
    "march_flow --aspect 1 --reynolds 0.01 --out {folder}/x": "--reynolds 0.01: from 1",
    "march_flow --aspect 20 --reynolds 20 --out {folder}/x": "can be marched",
    "render_shapes --runs {damaged} --out {folder}/y.png": "must name a file that ends",
    "solve_drag --reynolds 10": "body: give exactly one of --aspect",
    f"solve_drag {BODY}": "--reynolds: give it, or --chord-reynolds or --fluid with NU",
    f"solve_drag {BODY} --reynolds 10 --incidence 0:4": "0:4 lacks the count of a range",
    f"{OPTIMISE} --reynolds 9 --max-length 1,2": "one number, without a unit; design_sheet.py",
    f"{OPTIMISE} --reynolds 9 --lift 0.1,two": "--lift '0.1,two': one number, or several",
    f"{OPTIMISE} --reynolds 9 --lift 0.1,0.2": "lifts: the bodies of this scene have no lift",
    f"{OPTIMISE} --reynolds 9,20 --lift 0.1,0.2": "--lift: several go with --objective drag",
    f"{OPTIMISE} --reynolds 9 --spread 0.1 --lift 0.1,0.2": "--lift: several go with --objective",
    f"{OPTIMISE} --chord-reynolds 9 --lift 0.1,0.2": "--lift: several go with --objective drag",
    f"{OPTIMISE} --objective settling --archimedes 9 --lift 0.1,0.2": "--lift: several go with",
    f"{OPTIMISE} --reynolds 9 --archimedes 9 --lift 0.1,0.2": "--archimedes, --particle: one of",
    f"{OPTIMISE} --reynolds 9 --lift 0.1 --weights 1,2": "several Reynolds numbers or lifts, as",
    f"{OPTIMISE} --reynolds 9 --lift 1e6,2e6": "lifts: coefficients below",
    f"{OPTIMISE} --reynolds 9 --lift 0.1,0.1": "lifts: two or more different lower bounds",
    f"{OPTIMISE} --reynolds 9 --lift 0.1,0.2 --weights 1": "weights: 1 for 2 lifts; give one for",
    f"{OPTIMISE} --reynolds 9 --reference chord": "here are by D, in designs with --chord-reynolds",
    "solve_drag --aspect 2 --particle 2,1e-6,1e-4 --moment-about 0": "--particle: goes",
    "solve_drag --aspect 2 --settling 2,1e-6,1e-4": "--particle RATIO,NU,D",
    f"solve_drag {BODY} --reynolds 1,,40": "--reynolds '1,,40': one number, or several",
    f"solve_drag {BODY} --reynolds 10 --fluid 0.3,,1.2,1.5e-5": "U,D,RHO,NU in m/s, m, kg/m^3",
    f"solve_drag {BODY} --chord 60": "--chord 60; did you mean --chord-reynolds?",
    f"march_flow {BODY} --reynolds 9 --stream tunnel:9 --out {{missing}}": "unrecognized arguments",
    f"solve_drag {BODY} --reynolds 9 --overwrite": "--overwrite: goes with --out",
    f"{OPTIMISE} --reynolds 9 --dimension 3": "--dimension 3; is the scene's",
    f"{OPTIMISE} --reynolds 9 --verify": "--verify; predict_drag.py --verify solves the flow",
    f"{OPTIMISE} --reynolds 9 --lifts 0.1,0.2": "--lift 0.2,0.5 is one section for several",
    "design_sheet --reynolds 9 --lift 0.3 --out {missing}.png": "--lifts finds a body for each",
    "design_sheet --reynolds 9 --table t.txt --out {missing}.png": "ends in .csv",
    f"predict_drag {BODY} --reynolds 9 --plot {{missing}}.png": "--plot: needs several values",
    f"solve_drag {BODY} --reynolds 10 --moment-about nan": "--moment-about nan: must be a finite",
    f"{OPTIMISE} --reynolds 9 --spread 0.1 --cases 1.5": "--cases '1.5': must be one whole number",
    f"solve_drag {BODY} --reynolds 10 --table=": "--table '': an empty value",
    f"solve_drag {BODY} --reynolds 10 --fluid 1m/s,1,1": "U,D,RHO,NU in m/s, m, kg/m^3",
    f"solve_drag {BODY} --reynolds 10 --fluid 1e200,1,1": "speed 1e+200: from 1e-12 to 1e+12",
    f"solve_drag {BODY} --re 9": "did you mean --reynolds?",
    f"predict_drag {BODY} --thickness 0.1 --reynolds 9": "--aspect is length over thickness",
    "predict_drag --naca 0012 --reynolds 9": "solve_drag.py solves NACA sections",
    f"{OPTIMISE} --chord-reynolds 9 --reynolds 9": "give one of them, not both",
    f"{OPTIMISE} --chord-reynolds 9,20": "by chord: goes with a single Reynolds number without",
    f"{OPTIMISE} --chord-reynolds 9 --spread 0.1": "by chord: goes with a single Reynolds",
    f"{OPTIMISE} --chord-reynolds 9 --max-length 2": "max length: at fixed chord all bodies have",
    f"{OPTIMISE} --chord-reynolds 90": "chord Reynolds number 90: the family and the scene",
    f"{OPTIMISE} --chord-reynolds 9 --min-thickness 2": "every body of the family is thinner",
    "predict_drag --aspect 2 --incidence 5 --reynolds 9": "pretrained:lift",
    f"solve_drag {BODY} --reynolds 10 --stream pipe": "stream 'pipe'",
    f"solve_drag {BODY} --reynolds 10 --stream tunnel:1.5": "tunnel:1.5 leaves less than half a",
    f"solve_drag {BODY} --reynolds 10 --cells 3": "--cells 3: a whole number from",
    f"solve_drag {BODY} --reynolds 10 --fidelity superb": "fidelity 'superb': one of draft",
    f"solve_drag {BODY} --reynolds 10 --velocity 3": "unrecognized arguments: --velocity 3",
    "train_surrogate --method magic --out {folder}/x": "method 'magic': one of dp",
    "train_surrogate --method dp --preset huge --out {folder}/x": "invalid choice: 'huge'",
    "train_surrogate --method dp --budget-seconds 0 --out {folder}/x": "budget 0 s: from 1",
    "train_surrogate --method dp --budget-seconds nan --out {folder}/x": "budget in seconds nan",
    "train_surrogate --method dp --seed -1 --out {folder}/x": "seed -1: a whole number from 0",
    "free_fall --particle 1.2,1e-6,4e-4": "body: --aspect is needed",
    "payoff --seed 100000000000000000000 --out {folder}/x": "--seed 1e+20: a whole number from 0",
    "train_surrogate --method dp --process 0 --out {folder}/x": "go with --coordinator HOST:PORT",
    "train_surrogate --method dp --out {folder}": "is not empty and has no",
    f"predict_drag --surrogate {{missing}} {BODY} --reynolds 9": "no such folder",
    f"predict_drag --surrogate {{damaged}} {BODY} --reynolds 9": "damaged or",
    f"predict_drag --surrogate pretrained {BODY} --reynolds 0": "Reynolds number 0: must be a",
    "predict_drag --surrogate pretrained --aspect 2 --beta2 0.9 --reynolds 9": "beta2 0.9 make",
    "predict_drag --aspect 6 --reynolds 45": "aspect 6 (trained from 1 to 5), Reynolds number 45 (",
    f"{OPTIMISE} --reynolds 0.5": "Reynolds number 0.5: the scene covers 1 to 40",
    "predict_drag --surrogate pretrained --reynolds 9": "body: --aspect is needed",
    f"{OPTIMISE} --reynolds 45": "Reynolds number 45: the scene covers",  # not trained there
    f"{OPTIMISE} --reynolds nan": "Reynolds number nan: must be a",
    f"{OPTIMISE} --reynolds 1,40 --weights 1": "weights: 1 for 2 Reynolds numbers",
    f"{OPTIMISE} --reynolds 1,40 --weights 1,-1": "weights: every one must be a",
    f"{OPTIMISE} --reynolds 1,40 --spread 0.2": "--spread: belongs to one Reynolds number",
    f"{OPTIMISE} --reynolds 20 --weights 2": "--weights: belongs to several Reynolds numbers",
    f"{OPTIMISE} --reynolds 20 --cvar 0.9": "--cvar: needs an uncertainty",  # of no uncertainty
    f"{OPTIMISE} --reynolds 20 --spread 0.2 --cvar 1": "CVaR level 1: from 0",
    f"{OPTIMISE} --reynolds 1 --spread 1.5 --distribution uniform": "spread 1.5: from 0 to below",
    f"{OPTIMISE} --reynolds 20 --spread nan": "spread nan: must be a finite",
    f"{OPTIMISE} --reynolds 20 --spread 0 --cvar 0.5": "--cvar: needs an uncertainty",
    f"{OPTIMISE} --reynolds 20 --tolerance 0.02 --distribution uniform": "--distribution: goes",
    f"{OPTIMISE} --reynolds 20 --tolerance 0.5": "tolerance 0.5: from 0 to 0.1",
    f"{OPTIMISE} --reynolds 20 --thickness-at 0.5": "--thickness-at '0.5': x/c:thickness",
    f"{OPTIMISE} --reynolds 20 --thickness-at 1.5:0.2": "station x/c = 1.5: between 0",
    f"{OPTIMISE} --reynolds 20 --range length=1:2": "range of length: the family has",
    f"{OPTIMISE} --reynolds 20 --range aspect=1:9": "range of aspect 1 to 9:",
    f"{OPTIMISE} --reynolds 20 --range aspect=nan:2": "range of aspect nan: must be a",
    f"{OPTIMISE} --reynolds 20 --trust 0.5": "trust 0.5: from 0 to below",
    f"{OPTIMISE} --reynolds 20 --trust 0.1 --range aspect=1:1.1": "aspect: its range and trust 0.1",
    f"{OPTIMISE} --reynolds 20 --min-radius 2": "min radius 2: every body of",
    f"{OPTIMISE} --reynolds 40 --max-length 0.5": "max length 0.5: every body of",
    f"{OPTIMISE} --reynolds 40 --max-length -2": "max length -2: must be above 0",
    f"{OPTIMISE} --reynolds 40 --min-thickness 3": "min thickness 3: every body of",
    f"{OPTIMISE} --reynolds 40 --max-length 1.2 --range aspect=2:4": "max length 1.2 and ranges of",
    f"{OPTIMISE} --reynolds 40 --fidelity draft": "--fidelity: belongs to --surrogate none",
    f"{OPTIMISE} --reynolds 40 --scene {{crossing}}": "--scene: belongs to --surrogate none",
    "optimize_shape --surrogate none --reynolds 40 --scene {missing} --out {folder}/x": "cannot be",
    "optimize_shape --reynolds 9 --memory {folder}/m.json --out {folder}/x": "--until flow",
    "optimize_shape --surrogate none --until surrogate --reynolds 9 --out {folder}/x": "--until",
    "train_surrogate --method hig --scene {crossing} --out {folder}/x": "is not TOML",
    "train_surrogate --method hig --samples 2 --out {folder}/x": "samples 2: a whole number from 4",
    "payoff --scene {missing} --out {folder}/x": "cannot be read",
    "payoff --preset quick --out {folder}": "is not empty and has no payoff.json",
    "predict_drag --aspect 2 --beta7 0.1 --reynolds 9": "beta7 is none of the family's",
    "optimize_shape --surrogate {damaged} --reynolds 40 --out {folder}/x": "damaged or",
    "optimize_shape --surrogate pretrained --reynolds 40 --out {folder}": "is not empty and has no",
    "render_shapes --runs {missing} --out {folder}/x.png": "no run.json",
    "render_shapes --runs {damaged} --out {folder}/x.png": "run.json is damaged",
    "render_shapes --runs {damaged} --out {folder}/x.bmp": "must name a file that ends",
    "payoff --preset huge --out {folder}/x": "invalid choice: 'huge'",
    "train_surrogate --method hig --processes 2 --out {missing}": "go with --coordinator",
    "train_surrogate --method hig --devices 0 --out {missing}": "--devices 0",
    "train_surrogate --method hig --device-batch 0 --out {missing}": "device_batch 0",
    f"{OPTIMISE} --reynolds 40 --devices 0": "--devices 0",
    f"{OPTIMISE} --reynolds 40 --devices 1": "--devices: goes with --until flow",
    f"{OPTIMISE} --until flow --reynolds 40 --devices 2": "--devices: the cases of an objective",
    "export_surrogate --to numpy --prefix drag --out {folder}/x.py": "prefix: goes with C",
    "payoff --devices 0 --out {missing}": "--devices 0",
    "design_sheet --reynolds 400 --max-length 2 --out {missing}.png": "Reynolds",
    "design_sheet --reynolds 4 --max-length 0.1 --out {missing}.png": "length",
    "design_sheet --reynolds 4 --scene {crossing} --out {missing}.png": "belongs to --surrogate",
}


@pytest.mark.parametrize(("mistake", "answer"), MISTAKES.items())
def test_mistakes_get_exit_2_and_one_clear_line(capsys, tmp_path, mistake, answer):
    t = np.linspace(0.1, 2 * np.pi + 0.1, 60, endpoint=False)
    np.savetxt(tmp_path / "eight.csv", np.stack([np.sin(t), np.sin(2 * t)], axis=1), delimiter=",")
    (tmp_path / "y.png").mkdir()
    damaged = tmp_path / "damaged"
    damaged.mkdir()
    for name in ("surrogate.json", "weights.eqx", "run.json"):
        (damaged / name).write_text("{}")
    names = {
        "crossing": tmp_path / "eight.csv",
        "missing": tmp_path / "missing",
        "damaged": damaged,
        "folder": tmp_path,
    }
    script, *words = mistake.format(**names).split()
    status = run(importlib.import_module(script).main, words)
    captured = capsys.readouterr()
    lines = captured.err.strip().splitlines()
    assert status == 2, captured
    assert len(lines) == 1, lines
    assert answer in lines[0]
    assert captured.out == ""


def test_a_solve_that_fails_gets_exit_3_and_no_number(capsys, monkeypatch):
    """One Newton step does not reach the tolerance."""
    impatient = functools.partial(Flow, settings=NewtonSettings(1e-12, 1, 1))
    monkeypatch.setattr("shapeopt.commands.solve_drag.Flow", impatient)
    body = ["--aspect", "1", "--cells", "6", "--reynolds", "10"]
    assert run(importlib.import_module("solve_drag").main, [*body, "--json"]) == 3
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "did not converge" in captured.err.splitlines()[-1]


def test_scripts_start_from_anywhere(tmp_path):
    """As a user runs them: another process, another folder, the mistake on one line."""
    script = SCRIPTS / "solve_drag.py"
    done = subprocess.run(
        [sys.executable, str(script), "--aspect", "2", "--reynolds", "-1"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert done.stderr.strip().splitlines() == [done.stderr.strip()]
    assert done.stdout == ""


def test_a_full_device_is_refused_by_one_line(capsys):
    def main(argv):
        raise jax.errors.JaxRuntimeError("RESOURCE_EXHAUSTED: Out of memory allocating 9 bytes.")

    assert run(main, []) == 2
    said = capsys.readouterr().err.strip()
    assert said.count("\n") == 0
    assert "the device's memory is full; a coarser fidelity" in said
