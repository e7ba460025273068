"""Shape of least drag: python scripts/optimize_shape.py --help"""

import sys

from shapeopt.commands.cli import run
from shapeopt.commands.optimize_shape import main

if __name__ == "__main__":
    sys.exit(run(main))
