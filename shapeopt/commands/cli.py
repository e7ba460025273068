"""What every command shares: arguments in, progress to stderr, JSON out, exit statuses."""

import _thread
import argparse
import contextlib
import io
import json
import math
import os
import re
import signal
import sys
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from shapeopt.commands.entry import BAD_INPUT, DONE, INTERRUPTED
from surrogate.cache import use_compilation_cache
from surrogate.errors import InvalidInput, NotConverged

NOT_CONVERGED, NOT_WRITTEN, LOST = 3, 4, 5
A_MOMENT = 0.05  # seconds until an interrupt that was dropped is sent again
STATUSES = (
    "exit status: 0 done, 2 bad input, 3 not converged, 4 not written, 5 a process lost, "
    "130 interrupted"
)


class ProcessLost(RuntimeError):
    """One of many processes that work as one has ended."""


class Parser(argparse.ArgumentParser):
    """argparse that answers a mistake in one line; made from a command's docstring.

    Its first line is the description, what follows the examples. ``--json`` is always there.
    """

    def __init__(self, docstring: str):
        title, _, examples = docstring.partition("\n")
        super().__init__(
            description=title,
            epilog=f"{examples.strip()}\n\n{STATUSES}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        self.add_argument("--json", action="store_true", help="one JSON object on stdout")

    def parse_args(self, args=None, namespace=None):
        """As argparse, but a word like -1e-2 behind an option is its value."""
        words: list[str] = []
        for word in sys.argv[1:] if args is None else args:
            if re.match(r"-[\d.]", word) and words and re.fullmatch(r"--[\w-]+", words[-1]):
                words[-1] += f"={word}"
            else:
                words.append(word)
        return super().parse_args(words, namespace)

    def error(self, message: str):
        raise InvalidInput(message)


def run(main: Callable[[Sequence[str] | None], dict[str, Any]], argv=None) -> int:
    """Run a command's main and turn its outcome into an exit status."""
    with contextlib.redirect_stderr(_Heedless(sys.stderr)):
        return _run(main, argv)


def _run(main, argv):
    try:
        use_compilation_cache()
        with _interrupted_for_sure():
            main(argv)
        return DONE
    except BrokenPipeError:  # whoever read has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return DONE
    except InvalidInput as problem:
        status, message = BAD_INPUT, str(problem)
    except NotConverged as problem:
        status, message = NOT_CONVERGED, str(problem)
    except ProcessLost as problem:
        status, message = LOST, str(problem)
    except OSError as problem:
        status, message = NOT_WRITTEN, f"{problem.filename or 'output'}: {_reason(problem)}"
    except KeyboardInterrupt:
        status = INTERRUPTED
        message = "interrupted; by the same command trainings go on where they stopped"
    print(f"{Path(sys.argv[0]).name}: {' '.join(message.split())}", file=sys.stderr)
    return status


def _reason(problem):
    """Why a file could not be written; OSErrors of libraries may have no number."""
    return problem.strerror or str(problem) or "cannot be written"


class _Heedless(io.TextIOBase):
    """stderr for progress and messages: where nobody takes them, the work goes on all the same."""

    def __init__(self, stream: Any):
        self.stream = stream

    def write(self, text: str) -> int:
        try:
            if self.stream is not None:
                self.stream.write(text)
                self.stream.flush()
        except (OSError, ValueError):
            self.stream = None
        return len(text)

    def isatty(self) -> bool:
        return self.stream is not None and self.stream.isatty()

    def fileno(self) -> int:
        if self.stream is None:
            raise io.UnsupportedOperation("fileno")
        return self.stream.fileno()


@contextlib.contextmanager
def _interrupted_for_sure():
    """SIGTERM ends a command as Ctrl-C does, and neither is lost where it comes at a bad moment.

    An interrupt in a callback that Python may not leave, such as JAX's at garbage collection, is
    dropped and said to ``unraisablehook``. It is sent again a moment later, by a thread: at once it
    would come in the hook itself, and be dropped too. Threads but the main one hear none.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before, hook = signal.signal(signal.SIGTERM, signal.default_int_handler), sys.unraisablehook
    main, turn = threading.get_ident(), threading.Lock()

    def later():
        time.sleep(A_MOMENT)
        with turn:
            if sys.unraisablehook is again:  # SIGINT may be ignored, as in a shell's background
                signal.pthread_kill(main, signal.SIGTERM)

    def again(unraisable):
        if issubclass(unraisable.exc_type, KeyboardInterrupt):
            _thread.start_new_thread(later, ())
        else:
            hook(unraisable)

    sys.unraisablehook = again
    try:
        yield
    finally:
        with turn:
            sys.unraisablehook = hook
        signal.signal(signal.SIGTERM, before)


def emit(result: dict[str, Any], as_json: bool, text: str) -> dict[str, Any]:
    """Print the result for a person, or as the last line of stdout for a program."""
    print(json.dumps(result, allow_nan=False) if as_json else text, flush=True)
    return result


def finite(value: float) -> float | None:
    """A number for JSON, which has no infinity."""
    return value if math.isfinite(value) else None


def numbers(text: str, name: str = "--reynolds", example: str = "1,10,40") -> list[float]:
    """'1,10,40' as numbers.

    Raises:
      InvalidInput: there is none, or a word is no number.
    """
    try:
        values = [float(word) for word in text.split(",") if word.strip()]
    except ValueError:
        values = []
    if not values:
        raise InvalidInput(f"{name} {text!r}: one number, or several with commas, as {example}")
    return values
