"""Style: ruff finds nothing, in any file, and public functions are typed."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.mark.parametrize("check", [["check"], ["format", "--check"]], ids=" ".join)
def test_ruff_is_content(check):
    command = [sys.executable, "-m", "ruff", *check, "--no-cache", "."]
    found = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert found.returncode == 0, found.stdout + found.stderr


def test_public_functions_are_typed():
    files = [
        path for package in ("surrogate", "shapeopt") for path in (ROOT / package).rglob("*.py")
    ]
    assert len(files) > 100
    untyped = [
        f"{path.relative_to(ROOT)}: {function.name}"
        for path in files
        for function in _public_functions(ast.parse(path.read_text(encoding="utf-8")))
        if not _is_typed(function)
    ]
    assert untyped == []


def _public_functions(parent):
    """The functions of a module or class, and of its public classes, whose names are public."""
    for node in parent.body:
        if getattr(node, "name", "_").startswith("_"):
            continue
        if isinstance(node, ast.ClassDef):
            yield from _public_functions(node)
        elif isinstance(node, ast.FunctionDef):
            yield node


def _is_typed(function):
    given = function.args
    arguments = [*given.posonlyargs, *given.args, *given.kwonlyargs]
    untyped = [a.arg for a in arguments if a.annotation is None and a.arg not in ("self", "cls")]
    return not untyped and function.returns is not None
