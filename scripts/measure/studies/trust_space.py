"""How often the estimated error covers the error, and the status misleads: random 3-D bodies."""

from collections.abc import Iterator

import jax
import numpy as np
from studies.flow_3d import BETAS
from studies.trust import SUMMARY, compared, rows_of, summary
from study import TINY, Result, Row, Run, Study, Table, columns, values

from surrogate import Family, family_shape
from surrogate.scene.fidelity import SPACE_FIDELITIES

ASPECT = (0.45, 4.4)  # the error tolerance is for 0.5 to 4
FAMILIES = {
    "of revolution": Family(dimension=3, aspect=ASPECT, **BETAS),
    "flattened": Family(dimension=3, aspect=ASPECT, flatness=(1.0, 2.0), **BETAS),
}
REYNOLDS = (0.08, 120.0)  # the error tolerance is for 0.1 to 100
COUNTS = {"draft": 8, "standard": 3}  # bodies of each kind


def cases(run: Run) -> Iterator[Row]:
    """As many of both kinds, Re spread evenly in its logarithm."""
    for name, usual in COUNTS.items():
        count = run.pick(1, usual)
        for part, (kind, family) in enumerate(FAMILIES.items()):
            keys = jax.random.split(jax.random.key(run.options["seed"] + part))
            numbers = jax.random.permutation(keys[1], np.geomspace(*REYNOLDS, count))
            for body, re in zip(family.sample(keys[0], count), numbers, strict=True):
                shape = family_shape(family.named(np.asarray(body)), dimension=3)
                row = {"fidelity": name, "kind": kind, "reynolds": float(re)}
                yield row | {"stream": "unbounded", "shape": shape}


def measure(run, fidelity, reynolds, stream, shape, **_) -> Row:
    """Draft against standard, standard against what fine flows tend to."""
    draft, standard, fine = SPACE_FIDELITIES.values()
    pair = run.pick((TINY, TINY), (draft, standard) if fidelity == "draft" else (standard, fine))
    return compared(shape, reynolds, stream, *pair, extrapolated=fidelity == "standard")


def text(result: Result) -> str:
    rows, lines = rows_of(result), []
    for name in values(rows, "fidelity"):
        mine = summary([row for row in rows if row["fidelity"] == name], FAMILIES)
        lines += [row | {"fidelity": name} for row in mine]
    return columns(f"fidelity {{fidelity}} | {SUMMARY}")(lines)


OPTIONS = {"--seed": {"type": int, "default": 0, "help": "of the bodies"}}
STUDY = Study([Table(cases, measure, tiny="all")], text, options=OPTIONS)
