"""The free fall of a body by a surrogate's loads: python scripts/free_fall.py --help"""

import sys

from shapeopt.commands.cli import run
from shapeopt.commands.free_fall import main

if __name__ == "__main__":
    sys.exit(run(main))
