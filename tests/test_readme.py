"""The README's Python example runs, and the files and commands that it names exist."""

import importlib
import json
import re
from pathlib import Path

import pytest

from shapeopt.commands.cli import Parser
from surrogate import InvalidInput
from surrogate.scene.fidelity import NAMED

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()
GLOSSARY = ROOT / "surrogate" / "GLOSSARY.md"
MODULES = {"payoff": "payoff_command"}  # of commands that are called otherwise


def test_python_example_runs(capsys, compiled):
    """At most 15 lines: a drag, SciPy's optimum, the flow's, the drag of it again."""
    (example,) = re.findall(r"```python\n(.*?)```", README, re.S)
    assert len(example.splitlines()) <= 15
    names: dict[str, object] = {}
    exec(compile(example, "README.md", "exec"), names)
    assert len(compiled) <= 90  # programs; 133 where the operations on one body ran one by one
    _, minimum, optimum = capsys.readouterr().out.splitlines()
    longest = float(minimum.strip("[]").split()[0])
    assert longest == names["net"].scene.family.bounds[0, 1]
    answer, accuracy = optimum.split("meets")
    designed, solved = map(float, answer.split()[-2:])
    assert abs(designed / solved - 1) < 1e-4  # the flow's own optimum
    assert accuracy


@pytest.mark.slow
def test_the_first_hour_runs(tmp_path, capsys):
    result = importlib.import_module("first_hour").main(["--out", str(tmp_path), "--json"])
    assert result == json.loads(capsys.readouterr().out.splitlines()[-1])
    assert abs(result["cd"]["network"] / result["cd"]["flow"] - 1) < 0.01
    assert result["section"]["cl"] > 0.5
    assert result["design"]["kkt_residual"] < 2e-3
    assert {path.name for path in tmp_path.iterdir()} == {"section", "net", "run"}


def test_ci_runs_the_readmes_test_command():
    command = next(line for line in README.splitlines() if line.endswith("-m pytest"))
    assert command in (ROOT / ".ci" / "run").read_text().splitlines()


def test_the_glossary_has_the_tolerances():
    (line,) = re.findall(r"\| fidelity \| (.*) \|", GLOSSARY.read_text())
    stated = [float(number) / 100 for number in re.findall(r"([\d.]+) %", line)]
    assert stated == [level.tolerance for d in (2, 3) for level in NAMED[d].values()]


def test_every_script_and_picture_named_exists():
    names = re.findall(r"\b(?:scripts/)?((?:\w+/)*\w+\.py)\b", README)
    assert names
    for name in set(names):
        assert (ROOT / "scripts" / name).is_file() or list(ROOT.rglob(name)), name
    for name in re.findall(r"!\[.*?\]\((.*?)\)", README):
        if not name.startswith("https:"):
            assert (ROOT / name).is_file(), name


def test_readme_is_two_screens():
    assert len(README.splitlines()) <= 118
    assert len(README.split()) <= 1470


COMMANDS = re.findall(r"`(?:scripts/)?(\w+)\.py (-[^`]*|\.\.\. [^`]*)`", README)
PLACES = {"...": "--aspect 2 --reynolds 10", "DIR...": "folder"}


class Understood(Exception):
    """Raised where a command has read its arguments, and would begin its work."""


@pytest.mark.parametrize(("script", "words"), COMMANDS, ids=lambda part: part)
def test_commands_in_the_readme_are_understood(script, words, monkeypatch):
    """With every option that they need; an invented option is not."""
    assert len(COMMANDS) >= 13
    parse = Parser.parse_args

    def parse_alone(*arguments):
        parse(*arguments)
        raise Understood

    monkeypatch.setattr(Parser, "parse_args", parse_alone)
    main = importlib.import_module(f"shapeopt.commands.{MODULES.get(script, script)}").main
    words = [part for word in words.split() for part in PLACES.get(word, word).split()]
    with pytest.raises(Understood):
        main(words)
    with pytest.raises(InvalidInput, match="invented"):
        main([*words, "--invented"])
