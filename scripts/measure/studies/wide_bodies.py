"""What the ends of the domain cost in Cd: ellipses wider than long, and where it is lengthened."""

import dataclasses

from study import Row, Run, Study, Table, cases, columns

from surrogate import Fidelity, Flow, Scene, family_shape
from surrogate.body.shape import Shape

ASPECTS, NUMBERS = (0.5, 0.6, 0.7, 0.8, 1.0, 1.3), (10.0, 15.0, 20.0, 30.0, 40.0)
CELLS = 16  # per D; the error of the grid cancels
LARGE = Fidelity("large", CELLS, 12, 40, 16, wake=0.0)  # taken as exact


def measure(run: Run, aspect: float, reynolds: float) -> Row:
    """Return the errors of Cd by the standard domain and by the one that the body gets.

    Args:
      run: How the study is run.
      aspect: Of the ellipse.
      reynolds: U D / nu.
    """
    body, standard = family_shape({"aspect": aspect}), run.fidelity("standard")
    chosen = standard.for_body(reynolds, body.height, body.nose)
    exact = _drag(body, reynolds, dataclasses.replace(LARGE, cells=run.pick(8, CELLS)))
    found = [_drag(body, reynolds, one) / exact - 1 for one in (standard, chosen)]
    return {
        "height": body.height,
        "value": reynolds * body.height**4,
        "standard": found[0],
        "downstream": chosen.downstream,
        "chosen": found[1],
    }


def _drag(body: Shape, reynolds: float, level: Fidelity) -> float:
    level = dataclasses.replace(level, cells=min(level.cells, CELLS), wake=0.0, refinement=1.0)
    flow = Flow(Scene(fidelity=level))
    return flow.solve(body, reynolds, allow_unsteady=True, estimate=False).drag


COLUMNS = columns(
    "aspect {aspect:g} | Re {reynolds:g} | height h, D {height:.2f} | Re h⁴ {value:.0f} | "
    "error with 12 D downstream {standard:+.2%} | downstream, D {downstream:g} | "
    "error {chosen:+.2%}"
)
STUDIES = {"wide_bodies": Study([Table(cases(aspect=ASPECTS, reynolds=NUMBERS), measure, COLUMNS)])}
