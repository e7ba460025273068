"""A surrogate as C, Fortran, NumPy or ONNX: python scripts/export_surrogate.py --help"""

import sys

from shapeopt.commands.cli import run
from shapeopt.commands.export_surrogate import main

if __name__ == "__main__":
    sys.exit(run(main))
