"""``drag-surrogates COMMAND ...``: the commands of an installed package."""

import importlib
import sys

from shapeopt.commands.cli import BAD_INPUT, DONE, run

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


def main() -> int:
    """Run a command by its name."""
    name = sys.argv[1] if len(sys.argv) > 1 else "--help"
    if name in COMMANDS:
        sys.argv = [f"drag-surrogates {name}", *sys.argv[2:]]
        return run(importlib.import_module(f"shapeopt.commands.{name}").main)
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
