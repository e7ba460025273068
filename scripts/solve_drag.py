"""Drag of one body by the flow solver: python scripts/solve_drag.py --help"""

import sys

from shapeopt.commands.cli import run
from shapeopt.commands.solve_drag import main

if __name__ == "__main__":
    sys.exit(run(main))
