"""Drag by a trained surrogate: python scripts/predict_drag.py --help"""

import sys

from shapeopt.commands.cli import run
from shapeopt.commands.predict_drag import main

if __name__ == "__main__":
    sys.exit(run(main))
