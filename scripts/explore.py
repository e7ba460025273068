"""A web page that evaluates a surrogate: python scripts/explore.py --help"""

import sys

from shapeopt.commands.cli import run
from shapeopt.commands.explore import main

if __name__ == "__main__":
    sys.exit(run(main))
