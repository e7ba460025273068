"""March the flow in time: python scripts/march_flow.py --help"""

import sys

from shapeopt.commands.entry import loading

with loading():
    from shapeopt.commands.cli import run
    from shapeopt.commands.march import main

if __name__ == "__main__":
    sys.exit(run(main))
