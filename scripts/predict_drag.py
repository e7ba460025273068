"""Drag by a trained surrogate: python scripts/predict_drag.py --help"""

import sys

try:
    from shapeopt.commands.cli import run
    from shapeopt.commands.predict import main
except KeyboardInterrupt:  # nothing has begun
    sys.exit(130)

if __name__ == "__main__":
    sys.exit(run(main))
