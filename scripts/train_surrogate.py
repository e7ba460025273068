"""Train a drag surrogate: python scripts/train_surrogate.py --help"""

import sys

from shapeopt.commands.entry import loading

with loading():
    from shapeopt.commands.cli import run
    from shapeopt.commands.train import main

if __name__ == "__main__":
    sys.exit(run(main))
