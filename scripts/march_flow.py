"""Time-accurate flow by jax-cfd, an independent check: python scripts/march_flow.py --help"""

import sys

from shapeopt.commands.cli import run
from shapeopt.commands.march_flow import main

if __name__ == "__main__":
    sys.exit(run(main))
