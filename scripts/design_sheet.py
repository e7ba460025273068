"""Optimal bodies over Reynolds number and length: python scripts/design_sheet.py --help"""

import sys

from shapeopt.commands.cli import run
from shapeopt.commands.design_sheet import main

if __name__ == "__main__":
    sys.exit(run(main))
