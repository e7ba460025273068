"""How fast axisymmetric elements are beside the flow in space, on meshes that an expert would dare.

python scripts/measure/space_rival.py

The elements need NGSolve: pip install -e '.[bench]'.
"""

import statistics
import sys
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from axisymmetric import (
    ELEMENTS,
    cd_by_axisymmetric_elements,
    solve_by_axisymmetric_elements,
)
from elements import Elements, stopwatch
from space import COARSE, relative_error
from study import TINY, Result, Study, run_study, table_of_rows

from surrogate import Family, Fidelity, Flow, Scene
from surrogate.scene.fidelity import SPACE_FIDELITIES

NUMBERS = (1.0, 10.0, 40.0)
FAMILY = Family(dimension=3, aspect=(1.0, 2.0))
ASPECT = 2.0
MESHES = (Elements(2, 12.0, 0.3, 0.8, 3.0), Elements(3, 30.0, 0.4, 1.0, 4.0))
HEADS = "Re | way | unknowns | Cd | off fine elements by | time, of elements without meshing"
FORMS = "{reynolds:g} | {way} | {unknowns} | {cd:.4f} | {error:+.2%} | {seconds:.2f} s"
Rows = Iterator[dict[str, Any]]


def measure(tiny: bool, progress: Callable) -> Result:
    """The spheroid of aspect 2 by both."""
    levels = [TINY] if tiny else [SPACE_FIDELITIES[name] for name in ("draft", "standard")]
    rows, repeats = [], 1 if tiny else 5
    numbers = NUMBERS[:1] if tiny else NUMBERS
    for k, re in enumerate(numbers):
        progress(k / len(numbers), f"Re {re:g}")
        exact = cd_by_axisymmetric_elements({"aspect": ASPECT}, re, COARSE if tiny else ELEMENTS)
        meshes = (COARSE._replace(wall=0.4),) if tiny else MESHES
        rivals = () if exact is None else _by_elements(re, meshes, repeats)
        for row in (*_by_flow(re, levels, repeats), *rivals):
            rows.append({"reynolds": re, "error": relative_error(row["cd"], exact)} | row)
    return {"rows": rows}


def _by_flow(re: float, levels: Sequence[Fidelity], repeats: int) -> Rows:
    """After compilation."""
    for fidelity in levels:
        scene = Scene(family=FAMILY, reynolds=(NUMBERS[0], NUMBERS[-1]), fidelity=fidelity)
        flow, query = Flow(scene), (jnp.array([ASPECT]), jnp.asarray(re))
        drag, times = jax.jit(flow.drag), []
        cd = float(drag(*query))
        for _ in range(repeats):
            seconds = stopwatch()
            jax.block_until_ready(drag(*query))
            times.append(seconds())
        unknowns = 3 * int(np.prod(flow.domain.lattice.shape))
        row = {"way": fidelity.name, "unknowns": unknowns, "cd": cd}
        yield row | {"seconds": statistics.median(times)}


def _by_elements(re: float, meshes: Sequence[Elements], repeats: int) -> Rows:
    for elements in meshes:
        tries = [
            solve_by_axisymmetric_elements({"aspect": ASPECT}, re, elements)
            for _ in range(repeats + 1)
        ]
        seconds = statistics.median(one.seconds for one in tries[1:])
        row = {"way": f"elements of degree {elements.order}", "unknowns": tries[0].unknowns}
        yield row | {"cd": tries[0].cd, "seconds": seconds}


STUDY = Study("space_rival", measure, table_of_rows(HEADS, FORMS))

if __name__ == "__main__":
    sys.exit(run_study(STUDY))
