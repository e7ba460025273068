"""The console script ``drag-surrogates COMMAND ...``: all commands under one name."""

import importlib
import sys

import surrogate
from shapeopt.commands.cli import BAD_INPUT, DONE, PROGRAM, run
from surrogate.checks import did_you_mean
from surrogate.progress import print_message

COMMANDS = {  # word: module, what the command does
    "solve": ("solve_drag", "drag of one body by the flow solver"),
    "train": ("train_surrogate", "train a drag surrogate"),
    "predict": ("predict_drag", "drag by a trained surrogate"),
    "optimise": ("optimize_shape", "shape of least drag"),
    "sheet": ("design_sheet", "optimal bodies over Reynolds number and length"),
    "render": ("render_shapes", "pictures of optimised shapes"),
    "export": ("export_surrogate", "a surrogate as C, Fortran, NumPy or ONNX"),
    "explore": ("explore", "a web page that evaluates a surrogate"),
    "fall": ("free_fall", "free fall of a 3-D body by a surrogate"),
    "march": ("march_flow", "time-accurate flow by jax-cfd, an independent check"),
    "payoff": ("payoff_command", "train all methods; after how many designs training pays"),
}


def main() -> int:
    """Run the command that the first argument names."""
    name = sys.argv[1] if len(sys.argv) > 1 else "--help"
    name = "optimise" if name == "optimize" else name
    if name in COMMANDS:
        sys.argv = [f"{PROGRAM} {name}", *sys.argv[2:]]
        return run(importlib.import_module(f"shapeopt.commands.{COMMANDS[name][0]}").main)
    if name == "--version":
        print(f"{PROGRAM} {surrogate.__version__}")
        return DONE
    if name in ("-h", "--help"):
        lines = (f"  {word:10}{what}" for word, (_, what) in COMMANDS.items())
        print("\n".join(["usage: drag-surrogates COMMAND ...", "", *lines]))
        return DONE
    known = f"one of {', '.join(COMMANDS)}{did_you_mean(name, COMMANDS)}"
    print_message(f"drag-surrogates: no command {name!r}; {known}")
    return BAD_INPUT


if __name__ == "__main__":
    sys.exit(main())
