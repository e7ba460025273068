"""What training in 3-D costs and what it gives: every method on the same bodies."""

import tempfile
from pathlib import Path

from studies import training
from study import Row, Run, Study, Table

from surrogate import Scene
from surrogate.training.plan import METHODS, make_plan

SCENE = Path(__file__).parents[2] / "space.toml"
BODIES = 192  # as many as of the surrogate that ships


def measure(run: Run) -> list[Row]:
    """Train what is not trained yet, each method at its best; fit the rivals."""
    plans = {method: make_plan(Scene.read(SCENE), method, "full", BODIES) for method in METHODS}
    with tempfile.TemporaryDirectory() as scratch:
        tiny = {name: training.shrunk(plan) for name, plan in plans.items()}, Path(scratch)
        return training.compared(*run.pick(tiny, (plans, run.options["surrogates"])))


OPTIONS = {"--surrogates": training.OPTIONS["--surrogates"] | {"default": Path("out/space_full")}}
TABLE = Table(lambda run: [{}], measure, training.show)
STUDY = Study([TABLE], draw=training.draw, options=OPTIONS)
