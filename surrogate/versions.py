"""Versions of the packages, and the command, that a result was made with."""

import importlib.metadata
import shlex
import sys
from pathlib import Path

PACKAGES = ("jax", "jaxlib", "jax-cfd", "numpy")


def versions() -> dict[str, str]:
    """Return the versions of this package and of those that its numbers depend on."""
    names = {"drag-surrogates": package_version()}
    return names | {name: importlib.metadata.version(name) for name in PACKAGES}


def package_version() -> str:
    """Return the version of this package."""
    return importlib.metadata.version("drag-surrogates")


def command_line() -> str:
    """Return the command that is running, as stored with its result."""
    program = Path(sys.argv[0])
    name = f"scripts/{program.name}" if program.parent.name == "scripts" else sys.argv[0]
    words = ["python", name] if program.suffix == ".py" else program.name.split()
    return shlex.join([*words, *sys.argv[1:]])
