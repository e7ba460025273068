"""A web page that holds a surrogate: python scripts/explore.py --help"""

import sys

try:
    from shapeopt.commands.cli import run
    from shapeopt.commands.explore import main
except KeyboardInterrupt:  # nothing has begun
    sys.exit(130)

if __name__ == "__main__":
    sys.exit(run(main))
