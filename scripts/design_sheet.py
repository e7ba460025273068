"""Designs over Reynolds number and length: python scripts/design_sheet.py --help"""

import sys

try:
    from shapeopt.commands.cli import run
    from shapeopt.commands.sheet import main
except KeyboardInterrupt:  # nothing has begun
    sys.exit(130)

if __name__ == "__main__":
    sys.exit(run(main))
