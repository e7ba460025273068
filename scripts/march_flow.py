"""March the flow in time: python scripts/march_flow.py --help"""

import sys

try:
    from shapeopt.commands.cli import run
    from shapeopt.commands.march import main
except KeyboardInterrupt:  # nothing has begun
    sys.exit(130)

if __name__ == "__main__":
    sys.exit(run(main))
