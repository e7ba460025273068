"""What all commands share: argument parsing, exit statuses, SIGTERM and JSON output."""

import argparse
import contextlib
import json
import os
import re
import signal
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NoReturn

import jax

import surrogate
from surrogate.checks import did_you_mean
from surrogate.errors import InvalidInput, NotConverged
from surrogate.files import JsonObject
from surrogate.progress import print_message

DONE, BAD_INPUT, NOT_CONVERGED, NOT_WRITTEN, LOST, INTERRUPTED = 0, 2, 3, 4, 5, 130
STATUSES = (
    "exit status: 0 done, 2 bad input, 3 not converged, 4 not written, 5 a process lost, "
    "130 interrupted"
)

OTHER_WORDS = {  # options by which other programs call the same
    **dict.fromkeys(("--aoa", "--alpha", "--angle-of-attack"), "--incidence"),
    **dict.fromkeys(("--re", "--rey"), "--reynolds"),
    "--cl": "--lift",
}
CONTOURS = (
    "surrogates answer bodies of the family (--aspect and modes); solve_drag.py solves NACA "
    "sections and contours"
)
BY_DIAMETER = (
    "coefficients here are by D, in designs with --chord-reynolds by the chord c: Cd / c, Cl / c, "
    "Cm / c^2 with c in D"
)
ABOUT = (
    "moments here are about the centroid; solve_drag.py and predict_drag.py know other points of "
    "the chord"
)
OF_SCENE = "is the scene's: that of the surrogate, or of --scene FILE where the command takes one"
IN_SCENE = "--dimension", "--stream", "--cells", "--fidelity"  # where a command has a surrogate
ABSENT = {  # options that a command lacks for a reason
    "--thickness": "--aspect is length over thickness, 1 / (t/c); designs have --min-thickness",
    "--lift": "optimize_shape.py --lift bounds Cl, design_sheet.py --lifts finds a body for each",
    "--lifts": "--lift 0.2,0.5 is one section for several, design_sheet.py --lifts one for each",
    "--verify": "predict_drag.py --verify solves the flow too; optimize_shape.py always does, "
    "design_sheet.py with --until flow",
    "--fluid": "solve_drag.py and predict_drag.py --fluid give forces in N",
    "--particle": "solve_drag.py --particle settles a body, free_fall.py lets it fall",
    "--settling": "solve_drag.py --particle RATIO,NU,D settles a body",
    "--reference": BY_DIAMETER,
    "--moment-about": ABOUT,
    "--chord-reynolds": "--reynolds is U D / nu, D the equivalent diameter: U c / nu over c / D",
    "--naca": CONTOURS,
    "--contour": CONTOURS,
}
SEVERAL = {  # options that take one number in one command and several in another
    "--max-length": "design_sheet.py takes several",
}
PROGRAM = "drag-surrogates"  # the console script
ALIKE = 0.75  # of options, by difflib's ratio, that may be meant
GLOSSARY = Path(surrogate.__file__).with_name("GLOSSARY.md")


class ProcessLost(RuntimeError):
    """Raised when one of the processes of a distributed command has ended unexpectedly."""


class Parser(argparse.ArgumentParser):
    """An argument parser made from a command's docstring; errors are raised as InvalidInput.

    The docstring's first line is the description, the rest is printed behind the options. Every
    command has the option ``--json``.
    """

    def __init__(self, docstring: str):
        title, _, examples = docstring.partition("\n")
        super().__init__(
            description=title,
            epilog=f"{examples.strip()}\n\n{STATUSES}\nwords and symbols: {GLOSSARY}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
            allow_abbrev=False,
        )
        # argparse takes -0.1 for a value, but -1e-2 and -0.1,0.2 for options
        self._negative_number_matcher = re.compile(r"-[\d.]")
        self.add_argument("--json", action="store_true", help="one JSON object on stdout")
        version = f"{PROGRAM} {surrogate.__version__}"
        self.add_argument("--version", action="version", version=version)

    def parse_args(
        self, args: Sequence[str] | None = None, namespace: argparse.Namespace | None = None
    ) -> argparse.Namespace:
        """Parse the arguments, refusing empty values, as of shell variables that are not set."""
        words = sys.argv[1:] if args is None else list(args)
        for before, word in zip(["", *words], words, strict=False):
            if not word or re.fullmatch(r"--[\w-]+=", word):
                name = word.removesuffix("=") or before
                raise InvalidInput(f"{name} '': an empty value; give one, or leave the option out")
        return super().parse_args(words, namespace)

    def error(self, message: str) -> NoReturn:
        """Raise InvalidInput with argparse's message and the option or choice that may be meant."""
        hint = ""
        if wrong := re.search(r"(?:unrecognized arguments|ambiguous option): (--[\w-]+)", message):
            known = [name for action in self._actions for name in action.option_strings]
            word = wrong[1].lower()
            other = OTHER_WORDS.get(word)
            begin = next((name for name in known if name.startswith(word)), None)
            hint = did_you_mean(other if other in known else begin or word, known, ALIKE)
            if word in ABSENT:
                hint = f"; {ABSENT[word]}"
            elif word in IN_SCENE and "--surrogate" in known:
                hint = f"; {OF_SCENE}"
        elif wrong := re.search(r"invalid choice: '(.*)' \(choose from (.*)\)", message):
            hint = did_you_mean(wrong[1], re.findall(r"[\w-]+", wrong[2]))
        elif wrong := re.search(r"argument (--[\w-]+): invalid (float|int) value: (.*)", message):
            kind = "one number, without a unit" if wrong[2] == "float" else "one whole number"
            message = f"{wrong[1]} {wrong[3]}: must be {kind}"
            hint = f"; {SEVERAL[wrong[1]]}" if "," in wrong[3] and wrong[1] in SEVERAL else ""
        raise InvalidInput(_as_installed(message + hint))

    def format_help(self) -> str:
        """Return the help, of the installed program without the names of scripts."""
        return _as_installed(super().format_help())


def _as_installed(text: str) -> str:
    """Return a text with the installed program's commands in place of scripts, if it is running."""
    if not sys.argv[0].startswith(PROGRAM):
        return text
    from shapeopt.commands.entry import COMMANDS  # which imports this module

    names = {module.removesuffix("_command"): word for word, (module, _) in COMMANDS.items()}
    script = rf"(?:python )?(?:scripts/)?\b({'|'.join(names)})\.py"
    return re.sub(script, lambda found: f"{PROGRAM} {names[found[1]]}", text)


FULL = (
    "the device's memory is full; a coarser fidelity, or in trainings a smaller --device-batch, "
    "would do"
)
FAILURES = {InvalidInput: BAD_INPUT, NotConverged: NOT_CONVERGED, ProcessLost: LOST}


@contextlib.contextmanager
def resumable() -> Iterator[None]:
    """Let an interruption of work that leaves checkpoints say that the same command resumes it."""
    try:
        yield
    except KeyboardInterrupt:
        raise KeyboardInterrupt("the same command resumes it") from None


def run(main: Callable[[Sequence[str] | None], object], argv: Sequence[str] | None = None) -> int:
    """Run the main function of a command and return the exit status.

    An error becomes one line on stderr, and so does every warning. SIGTERM, by which job schedulers
    end a job, acts as Ctrl-C, which ends the process.
    """
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        with warnings.catch_warnings():
            warnings.showwarning = _print_warning
            main(argv)
        return DONE
    except tuple(FAILURES) as error:
        status = next(FAILURES[kind] for kind in FAILURES if isinstance(error, kind))
        message = str(error)
    except OSError as error:
        reason = error.strerror or str(error) or "cannot be written"
        status, message = NOT_WRITTEN, f"{error.filename or 'output'}: {reason}"
    except jax.errors.JaxRuntimeError as error:
        if not memory_is_full(error):
            raise
        status, message = BAD_INPUT, FULL
    except KeyboardInterrupt as stop:
        _print_line("; ".join(["interrupted", *map(str, stop.args)]))
        _end_at_once(INTERRUPTED)
    finally:
        signal.signal(signal.SIGTERM, before)
    _print_line(message)
    return status


def _end_at_once(status: int) -> NoReturn:
    """End the process; XLA's threads that compile still would crash a usual end now and then."""
    with contextlib.suppress(OSError):
        sys.stdout.flush()
        sys.stderr.flush()
    os._exit(status)


def memory_is_full(error: jax.errors.JaxRuntimeError) -> bool:
    """Return whether an error says that a device has too little memory."""
    return "RESOURCE_EXHAUSTED" in str(error)


def _print_warning(message: Warning | str, *_: object) -> None:
    """Print a warning; takes the place of ``warnings.showwarning``."""
    _print_line(f"warning: {message}")


def _print_line(message: str) -> None:
    print_message(f"{Path(sys.argv[0]).name}: {' '.join(message.split())}")


def emit(result: JsonObject, as_json: bool, text: str) -> JsonObject:
    """Print the result as one line of JSON or as text, and return it.

    Raises:
      OSError: stdout is closed or cannot be written.
    """
    if sys.stdout is None:
        raise OSError("stdout is closed")
    print(json.dumps(result, allow_nan=False) if as_json else text, flush=True)
    return result
