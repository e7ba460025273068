"""Train on where optima are off: python scripts/refine_surrogate.py --help"""

import sys

from shapeopt.commands.cli import run
from shapeopt.commands.refine import main

if __name__ == "__main__":
    sys.exit(run(main))
