"""Pictures of optimised shapes: python scripts/render_shapes.py --help"""

import sys

from shapeopt.commands.cli import run
from shapeopt.commands.render_shapes import main

if __name__ == "__main__":
    sys.exit(run(main))
