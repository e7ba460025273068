"""The whole chain, and when training pays: python scripts/payoff.py --help"""

import sys

from shapeopt.commands.entry import loading

with loading():
    from shapeopt.commands.cli import run
    from shapeopt.commands.payoff import main

if __name__ == "__main__":
    sys.exit(run(main))
