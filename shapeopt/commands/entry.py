"""How commands start; and ``drag-surrogates COMMAND ...``, those of an installed package."""

import contextlib
import importlib
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

DONE, BAD_INPUT, INTERRUPTED = 0, 2, 130  # statuses; cli has the others
COMMANDS = {
    "solve": "drag of one body by the flow solver",
    "train": "train a drag surrogate",
    "predict": "drag by a trained surrogate",
    "optimise": "shape of least drag",
    "sheet": "designs over Reynolds number and length",
    "render": "pictures of optimised shapes",
    "explore": "a web page that holds a surrogate",
    "march": "march the flow in time",
    "payoff": "the whole chain, and when training pays",
}


@contextlib.contextmanager
def loading() -> Iterator[None]:
    """Ctrl-C and SIGTERM wait while libraries load, some of which they would crash; then they end.

    Where signals cannot wait they do as ever.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    ends = {signal.SIGINT, signal.SIGTERM}
    ends = {end for end in ends if signal.getsignal(end) is not signal.SIG_IGN}
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ends)
    try:
        yield
        if signal.sigpending() & ends:
            signal.sigwait(ends)
            print(f"{Path(sys.argv[0]).name}: interrupted before it began", file=sys.stderr)
            sys.exit(INTERRUPTED)
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def main() -> int:
    """Run a command by its name."""
    name = sys.argv[1] if len(sys.argv) > 1 else "--help"
    if name in COMMANDS:
        sys.argv = [f"drag-surrogates {name}", *sys.argv[2:]]
        with loading():
            run = importlib.import_module("shapeopt.commands.cli").run
            command = importlib.import_module(f"shapeopt.commands.{name}").main
        return run(command)
    usage = "usage: drag-surrogates COMMAND ...\n\n" + "\n".join(
        f"  {command:10}{what}" for command, what in COMMANDS.items()
    )
    if name in ("-h", "--help"):
        print(usage)
        return DONE
    print(f"drag-surrogates: no command {name!r}; one of {', '.join(COMMANDS)}", file=sys.stderr)
    return BAD_INPUT


if __name__ == "__main__":
    sys.exit(main())
