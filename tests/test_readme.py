"""The README's Python example runs, and the files and commands that it names exist."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()


def test_python_example_runs(capsys):
    """At most 15 lines: a drag, its gradient, an optimum, its verified drag."""
    (code,) = re.findall(r"```python\n(.*?)```", README, re.S)
    assert len(code.splitlines()) <= 15
    exec(compile(code, "README.md", "exec"), {})
    printed = capsys.readouterr().out.splitlines()
    predicted, (verified, status, error) = printed[-2].split()[-3], printed[-1].split()
    assert abs(float(predicted) / float(verified) - 1) < 1e-4  # the flow's own optimum
    assert 0 < float(error) < 0.02
    assert status == "accurate"


def test_ci_runs_the_readmes_test_command():
    command = next(line for line in README.splitlines() if line.endswith("-m pytest"))
    assert command in (ROOT / ".ci" / "run").read_text().splitlines()


def test_every_script_and_picture_named_exists():
    names = re.findall(r"\b(?:scripts/)?((?:\w+/)*\w+\.py)\b", README)
    assert names
    for name in set(names):
        assert (ROOT / "scripts" / name).is_file() or list(ROOT.rglob(name)), name
    for name in re.findall(r"!\[.*?\]\((.*?)\)", README):
        if not name.startswith("https:"):
            assert (ROOT / name).is_file(), name


def test_readme_is_two_screens():
    assert len(README.splitlines()) <= 150
