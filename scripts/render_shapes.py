"""Pictures of optimised shapes: python scripts/render_shapes.py --help"""

import sys

try:
    from shapeopt.commands.cli import run
    from shapeopt.commands.render import main
except KeyboardInterrupt:  # nothing has begun
    sys.exit(130)

if __name__ == "__main__":
    sys.exit(run(main))
