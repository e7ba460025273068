"""Train a drag surrogate: python scripts/train_surrogate.py --help"""

import sys

try:
    from shapeopt.commands.cli import run
    from shapeopt.commands.train import main
except KeyboardInterrupt:  # nothing has begun
    sys.exit(130)

if __name__ == "__main__":
    sys.exit(run(main))
