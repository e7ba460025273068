"""The whole chain, and when training pays: python scripts/payoff.py --help"""

import sys

try:
    from shapeopt.commands.cli import run
    from shapeopt.commands.payoff import main
except KeyboardInterrupt:  # nothing has begun
    sys.exit(130)

if __name__ == "__main__":
    sys.exit(run(main))
