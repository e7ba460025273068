"""How fast axisymmetric elements are beside the 3-D flow, on the coarsest meshes that will do."""

import statistics
from collections.abc import Iterator

import jax
import jax.numpy as jnp
from elements import AXISYMMETRIC, TINY_ELEMENTS, reference_cd, solve_by_elements, stopwatch
from meshes import Elements
from study import Row, Run, Study, Table, columns

from surrogate import Family, Fidelity, Flow, Scene

NUMBERS = (1.0, 10.0, 40.0)
FAMILY = Family(dimension=3, aspect=(1.0, 2.0))
BODY = {"aspect": 2.0}
MESHES = (Elements(2, 12.0, 0.3, 0.8, 3.0), Elements(3, 30.0, 0.4, 1.0, 4.0))


def cases(run: Run) -> Iterator[Row]:
    """The spheroid of aspect 2 by both; a tiny run has one of each."""
    flows = [run.fidelity(name, 3) for name in ("draft", "standard")]
    for reynolds in run.pick(NUMBERS[:1], NUMBERS):
        for solver in run.pick((flows[0], TINY_ELEMENTS._replace(wall=0.4)), (*flows, *MESHES)):
            yield {"reynolds": reynolds, "solver": solver}


def measure(run: Run, reynolds: float, solver: Fidelity | Elements) -> Row:
    """Cd, its error against fine elements, and processor seconds without compilation."""
    exact = reference_cd(AXISYMMETRIC, BODY, reynolds, run.pick(TINY_ELEMENTS, None))
    times = range(run.pick(1, 5) + 1)
    if isinstance(solver, Elements):
        tries = [solve_by_elements(AXISYMMETRIC, BODY, reynolds, solver) for _ in times]
        row = {"way": f"elements of degree {solver.order}", "unknowns": tries[0].unknowns}
        row |= {"cd": tries[0].cd}
        seconds = [found.seconds for found in tries[1:]]
    else:
        scene = Scene(family=FAMILY, reynolds=(NUMBERS[0], NUMBERS[-1]), fidelity=solver)
        flow, query, seconds = Flow(scene), (jnp.array([2.0]), jnp.asarray(reynolds)), []
        drag = jax.jit(flow.drag)
        for _ in times:
            watch = stopwatch()
            cd = float(jax.block_until_ready(drag(*query)))
            seconds.append(watch())
        cells = flow.domain.lattice.shape
        row = {"way": solver.name, "unknowns": 3 * cells[0] * cells[1] * cells[2], "cd": cd}
        seconds = seconds[1:]
    return row | {"error": row["cd"] / exact - 1, "seconds": statistics.median(seconds)}


COLUMNS = "Re {reynolds:g} | solver {way} | unknowns {unknowns} | Cd {cd:.4f}"
COLUMNS += " | error against fine elements {error:+.2%} | time, without meshing {seconds:.2f} s"
STUDY = Study([Table(cases, measure, columns(COLUMNS), tiny="all")])
