"""How often the estimated error covers the error in space: as trust.py, of random bodies.

python scripts/measure/trust_space.py
"""

import itertools
import sys
from collections.abc import Callable, Iterator

import jax
import numpy as np
from space import BETAS
from study import TINY, Result, Study, run_study, table
from trust import FORMS, HEADS, Case, compared, summary

from surrogate import Family, family_shape
from surrogate.scene.fidelity import SPACE_FIDELITIES

ASPECT = (0.45, 4.4)  # the promise is for 0.5 to 4
FAMILIES = {
    "of revolution": Family(dimension=3, aspect=ASPECT, **BETAS),
    "flattened": Family(dimension=3, aspect=ASPECT, flatness=(1.0, 2.0), **BETAS),
}
REYNOLDS = (0.08, 120.0)  # the promise is for 0.1 to 100
COUNTS = {"draft": 8, "standard": 3}  # bodies of each kind


def measure(tiny: bool, progress: Callable, seed: int) -> Result:
    """Draft against standard, standard against what fine flows tend to."""
    levels = list(SPACE_FIDELITIES.values())
    parts = []
    for k, (level, finer) in enumerate(itertools.pairwise(levels)):
        chosen = list(cases(1 if tiny else COUNTS[level.name], seed))
        rows = []
        for done, case in enumerate(chosen):
            told = f"{level.name}, {case.kind}, Re {case.reynolds:.3g}"
            progress((k + done / len(chosen)) / len(COUNTS), told)
            pair = (TINY, TINY) if tiny else (level, finer)
            rows.append(compared(case, *pair, extrapolated=finer is levels[-1]))
            jax.clear_caches()  # hardly a grid serves twice, and they add up
        parts.append({"fidelity": level.name, "promise": level.promise, "rows": rows})
    return {"parts": parts}


def cases(count: int, seed: int) -> Iterator[Case]:
    """As many of both kinds, Re spread evenly in the log."""
    for part, (kind, family) in enumerate(FAMILIES.items()):
        keys = jax.random.split(jax.random.key(seed + part))
        numbers = jax.random.permutation(keys[1], np.geomspace(*REYNOLDS, count))
        for body, re in zip(family.sample(keys[0], count), numbers, strict=True):
            shape = family_shape(family.named(np.asarray(body)), dimension=3)
            yield Case(kind, shape, float(re))


def tables(result: Result) -> str:
    rows = [
        row | {"fidelity": part["fidelity"]}
        for part in result["parts"]
        for row in summary(part, tuple(FAMILIES))
    ]
    return table(rows, f"fidelity | {HEADS}", f"{{fidelity}} | {FORMS}")


OPTIONS = {"--seed": {"type": int, "default": 0, "help": "of the bodies"}}
STUDY = Study("trust_space", measure, tables, options=OPTIONS)

if __name__ == "__main__":
    sys.exit(run_study(STUDY))
