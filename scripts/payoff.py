"""Train all methods; after how many designs training pays: python scripts/payoff.py --help"""

import sys

from shapeopt.commands.cli import run
from shapeopt.commands.payoff_command import main

if __name__ == "__main__":
    sys.exit(run(main))
