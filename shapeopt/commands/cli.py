"""What every script shares: arguments in, progress to stderr, JSON out, exit statuses."""

import argparse
import json
import math
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

import surrogate
from surrogate.body.family import PARAMETERS, Shape, family_shape, rotate
from surrogate.body.contour import naca4, read_contour, smooth_contour
from surrogate.errors import InvalidInput, NotConverged
from surrogate.scene.scene import FIDELITIES, check_reynolds

DONE, BAD_INPUT, NOT_CONVERGED = 0, 2, 3
console = Console(stderr=True)


class Parser(argparse.ArgumentParser):
    """argparse that answers a mistake in one line."""

    def error(self, message: str):
        raise InvalidInput(message)


def run(main: Callable[[Sequence[str] | None], dict[str, Any]], argv=None) -> int:
    """Run a script's main and turn its outcome into an exit status."""
    try:
        surrogate.use_compilation_cache()
        main(argv)
        return DONE
    except InvalidInput as problem:
        status, message = BAD_INPUT, str(problem)
    except NotConverged as problem:
        status, message = NOT_CONVERGED, str(problem)
    except KeyboardInterrupt:
        status, message = (
            130,
            "interrupted; trainings go on where they stopped, by the same command",
        )
    name = Path(sys.argv[0]).name
    print(f"{name}: {' '.join(message.split())}", file=sys.stderr)
    return status


def emit(result: dict[str, Any], as_json: bool, text: str) -> dict[str, Any]:
    """Print the result for a person, or as the last line of stdout for a program."""
    if as_json:
        print(json.dumps(result, allow_nan=False), flush=True)
    else:
        print(text, flush=True)
    return result


def finite(value: float) -> float | None:
    """A number for JSON, which has no infinity."""
    return value if math.isfinite(value) else None


def numbers(text: str) -> list[float]:
    """'1,10,40' as numbers."""
    try:
        values = [float(word) for word in text.split(",") if word.strip()]
    except ValueError:
        values = []
    if not values:
        raise InvalidInput(f"--reynolds {text!r}: one number, or several with commas, as 1,10,40")
    return values


def reynolds_numbers(text: str, allow_unsteady: bool = False) -> list[float]:
    """Reynolds numbers for which a steady laminar flow is a fair answer."""
    values = numbers(text)
    for value in values:
        check_reynolds(value, allow_unsteady)
    return values


def add_family_arguments(parser: argparse.ArgumentParser) -> None:
    """--aspect, --beta2, --beta3, --beta4."""
    parser.add_argument("--aspect", type=float, help="length over thickness of the plain ellipse")
    for name in PARAMETERS[1:]:
        parser.add_argument(f"--{name}", type=float, default=0.0, help="shape coefficient")


def family_parameters(arguments: argparse.Namespace) -> list[float]:
    """The family's parameters from the arguments."""
    return [getattr(arguments, name) for name in PARAMETERS]


def add_body_arguments(parser: argparse.ArgumentParser) -> None:
    """A family body, a contour or a NACA section, at incidence."""
    add_family_arguments(parser)
    parser.add_argument("--contour", help="CSV of x,y or Selig .dat, scaled to area pi/4")
    parser.add_argument("--naca", help="NACA 4-digit section, as 0012")
    parser.add_argument("--incidence", type=float, default=0.0, help="nose up, in degrees")
    parser.add_argument("--keep-size", action="store_true", help="do not scale a contour")


def shape_of(arguments: argparse.Namespace) -> Shape:
    """The body that was asked for."""
    given = [name for name in ("aspect", "contour", "naca") if getattr(arguments, name) is not None]
    if len(given) != 1:
        raise InvalidInput("body: give exactly one of --aspect, --contour and --naca")
    if not abs(arguments.incidence) <= 180:
        raise InvalidInput(f"--incidence {arguments.incidence:g}: from -180 to 180 degrees")
    if arguments.aspect is not None:
        if arguments.keep_size:
            raise InvalidInput("--keep-size: goes with --contour or --naca")
        return family_shape(np.array(family_parameters(arguments)), arguments.incidence)
    if any(getattr(arguments, name) for name in PARAMETERS[1:]):
        raise InvalidInput("body: --beta2, --beta3 and --beta4 go with --aspect")
    points = naca4(arguments.naca) if arguments.contour is None else read_contour(arguments.contour)

    def draw(nodes):
        contour = smooth_contour(points, nodes, arguments.keep_size)
        return np.asarray(rotate(contour, arguments.incidence))

    return Shape(draw, symmetric=False)


def fidelity_of(name: str):
    """A fidelity by name."""
    if name not in FIDELITIES:
        raise InvalidInput(f"fidelity {name!r}: one of {', '.join(FIDELITIES)}")
    return FIDELITIES[name]


@contextmanager
def progress_bar(title: str) -> Iterator[Callable[[float, str], None]]:
    """A bar on stderr; call it with the fraction done and a word on the state.

    Where stderr is not a terminal, every new state is a line.
    """
    columns = (
        TextColumn("{task.description:32}"),
        BarColumn(),
        TextColumn("{task.percentage:3.0f}%"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[state]}"),
    )
    with Progress(*columns, console=console, disable=not console.is_terminal) as progress:
        task = progress.add_task(title, total=1.0, state="")

        def update(done: float, state: str = "") -> None:
            progress.update(task, completed=min(done, 1.0), state=state)
            if state and not console.is_terminal:
                print(f"{title}: {100 * min(done, 1.0):.0f}% {state}", file=sys.stderr, flush=True)

        yield update


def markdown(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table, its columns aligned to be read as it is."""
    widths = [max(len(row[k]) for row in [heads, *rows]) for k in range(len(heads))]
    lines = [heads, ["-" * width for width in widths], *rows]
    return "\n".join(
        "| " + " | ".join(c.ljust(w) for c, w in zip(line, widths, strict=True)) + " |"
        for line in lines
    )


def say(text: str) -> None:
    """A line of progress on stderr."""
    console.print(text, highlight=False)


def command_line() -> str:
    """The command that is running, to be kept with its result."""
    return " ".join(["python", os.path.relpath(sys.argv[0]), *sys.argv[1:]])
