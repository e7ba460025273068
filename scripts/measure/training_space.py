"""What training costs in space and what it gives: as training.py, every method on the same bodies.

python scripts/measure/training_space.py
"""

import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import training
from study import Result, Study, run_study

from surrogate import Scene
from surrogate.training.plan import METHODS, make_plan

SCENE = Path(__file__).parents[1] / "space.toml"
BODIES = 192  # as many as of the surrogate that ships


def measure(tiny: bool, progress: Callable, surrogates: Path) -> Result:
    """Train what is not trained yet, each at its best; fit the rivals."""
    scene = Scene.read(SCENE)
    plans = {method: make_plan(scene, method, "full", BODIES) for method in METHODS}
    plans = {name: training.shrunk(plan) for name, plan in plans.items()} if tiny else plans
    with tempfile.TemporaryDirectory() as scratch:
        return {"rows": list(training.compared(plans, Path(scratch) if tiny else surrogates))}


OPTIONS = {
    "--surrogates": {
        "type": Path,
        "default": Path("out/space_full"),
        "help": "folder of the trainings",
    }
}
STUDY = Study("training_space", measure, training.tables, training.draw, OPTIONS)

if __name__ == "__main__":
    sys.exit(run_study(STUDY))
