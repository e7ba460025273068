"""Drag of one body by the flow solver: python scripts/solve_drag.py --help"""

import sys

try:
    from shapeopt.commands.cli import run
    from shapeopt.commands.solve import main
except KeyboardInterrupt:  # nothing has begun
    sys.exit(130)

if __name__ == "__main__":
    sys.exit(run(main))
