"""Train a drag surrogate: python scripts/train_surrogate.py --help"""

import sys

from shapeopt.commands.cli import run
from shapeopt.commands.train_surrogate import main

if __name__ == "__main__":
    sys.exit(run(main))
