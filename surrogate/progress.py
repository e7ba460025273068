"""Progress of long computations on stderr."""

import contextlib
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

Update = Callable[[float, str], None]


@contextmanager
def progress_bar(title: str, shown: bool = True) -> Iterator[Callable[..., None]]:
    """Show a progress bar and yield the function that updates it.

    The function takes the fraction done and a text on the state. Where stderr is not a terminal,
    every new text is printed as a line instead.
    """
    console = Console(stderr=True)
    columns = (
        TextColumn("{task.description:32}"),
        BarColumn(),
        TextColumn("{task.percentage:3.0f}%"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[state]}"),
    )
    on_screen = shown and console.is_terminal
    with Progress(*columns, console=console, disable=not on_screen) as progress:
        task = progress.add_task(title, total=1.0, state="")

        def update(done: float, state: str = "") -> None:
            progress.update(task, completed=min(done, 1.0), state=state)
            if shown and state and not on_screen:
                print_message(f"{title}: {100 * min(done, 1.0):.0f}% {state}")

        yield update


def print_message(text: str) -> None:
    """Print a line to stderr; it is lost where stderr is closed or its disk is full."""
    if sys.stderr is not None:
        with contextlib.suppress(OSError):
            print(f"{text}\n", end="", file=sys.stderr, flush=True)  # in one piece


def duration(seconds: float) -> str:
    """Return a time to two digits, in milliseconds, seconds, minutes or hours."""
    for limit, unit, name in ((0.1, 1e-3, "ms"), (100.0, 1.0, "s"), (6e3, 60.0, "min")):
        if seconds < limit:
            return f"{float(f'{seconds / unit:.2g}'):g} {name}"
    return f"{float(f'{seconds / 3600:.2g}'):g} h"
