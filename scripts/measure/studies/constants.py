"""The effect of each of the flow's empirical constants, while the others keep their values.

The drag in 3-D is compared with the elements of ``flow_3d``; safety factors are tried on the bodies
of ``trust``, ``trust_space`` and ``corners``. All of these are read from their records.
"""

from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import Any
from unittest import mock

import numpy as np
from kernel_errors import FIT, FITS, QUADRATURE, QUADRATURES, fit_errors, quadrature_errors
from run import recorded
from studies.trust import rows_of
from study import Row, Run, Study, Table, columns
from varied_flows import (
    CHOSEN_WALL,
    domains_uncovered,
    null_mode_changes,
    retracted_error,
    slip_changes,
    surface_errors,
    wake_errors,
    wall_errors,
)

from surrogate import FIDELITIES
from surrogate.body.nose import nose_of_ellipse
from surrogate.flow.check.error_model import ERROR_MODELS, ErrorModel2D, ErrorModel3D, Loads
from surrogate.flow.grid.discretise import DOMAINS
from surrogate.flow.solver import steady
from surrogate.flow.surface import forces_2d, pressure
from surrogate.scene.fidelity import NAMED

WALL = {
    "THIN_LAYER_RE": (20.0, 40.0, 80.0),
    "RETRACTED_SHARE": (0.6, 0.8, 1.0),
    "SECOND_ORDER": (6.0, 12.0, 18.0),
}
CHOSEN = CHOSEN_WALL | {
    "NULL_MODE_COMPLIANCE": steady.NULL_MODE_COMPLIANCE,
    "oseen_2d: nodes, panels, ratio": QUADRATURE,
    "oseen_3d: step of ln t, SINGULAR_CUT, BETAS": FIT,
    "VORTICITY_PROBES": forces_2d.VORTICITY_PROBES,
    "PRESSURE_PROBES": pressure.PRESSURE_PROBES,
    "Fidelity.wake": FIDELITIES["standard"].wake,
    "GRID_SHARE": ErrorModel2D.GRID_SHARE,
    "SPREAD": ErrorModel2D.SPREAD,
    "FEW_CELLS": ErrorModel3D.FEW_CELLS,
}
CHOSEN |= {f"slip_compliance, {d}-D": kind.slip_compliance for d, kind in DOMAINS.items()}
CHOSEN |= {f"DOMAIN_ERROR, {d}-D": model.DOMAIN_ERROR for d, model in ERROR_MODELS.items()}
CHOSEN |= {f"SAFETY, {d}-D": model.SAFETY.drag for d, model in ERROR_MODELS.items()}
PROBES = tuple((first, first + 1, first + 2) for first in (0.5, 1.5, 2.5, 3.5))


def sweep(name: str, values: Iterable[Any], what: str, errors: Callable) -> Iterator[Row]:
    """Yield one case for every value of a constant; ``errors(run, value)`` are measured later.

    Args:
      name: Of the constant, a key of ``CHOSEN``.
      values: That are tried.
      what: Is measured, in words.
      errors: Measures it.
    """
    for value in values:
        row = {"constant": name, "value": _text(value), "errors": partial(errors, value=value)}
        yield row | {"chosen": "chosen" if value == CHOSEN[name] else "", "what": what}


def _text(value):
    return ", ".join(map(_text, value)) if isinstance(value, tuple) else f"{value:.4g}"


def measure(run: Run, errors: Callable[[Run], Iterable[float]], **_: str) -> Row:
    """Return mean and largest size of the errors, or the share of the cases that are True."""
    found = np.abs(list(errors(run)))
    if not found.size:
        return {"cases": 0, "mean": None, "most": None}
    most = None if found.dtype == bool else found.max()
    return {"cases": found.size, "mean": found.mean(), "most": most}


def known_errors(dimension: int) -> list[Row]:
    """Return the recorded bodies with a likely error (a bound without SAFETY) and an error."""
    if dimension == 2:
        rows = rows_of(recorded("trust"))
    else:
        rows = rows_of(recorded("trust_space"))
        for row in recorded("corners")["rows"]:
            rows.append(row | {"bound": row["estimate"], "reynolds": row["re"]})
    known = [row for row in rows if row.get("bound") is not None]
    return [row | {"likely": row["bound"] / _safety(dimension, row)} for row in known]


def _safety(dimension, row):
    """Return the safety factor of a row; older rows have 2.5."""
    return ERROR_MODELS[dimension].SAFETY.drag if "expected" in row and "likely" not in row else 2.5


def uncovered(dimension: int, run: Run, value: float) -> Iterator[bool]:
    """Yield whether a body's error is beyond this multiple of its likely error."""
    yield from (abs(row["error"]) > value * row["likely"] for row in known_errors(dimension))


def _rows_with_parts():
    return [row for row in known_errors(2) if "grid" in row]


def parts_left(name: str, run: Run, value: float) -> Iterator[float]:
    """Yield what the errors of grid and domain leave of a 2-D body's error."""
    for row in _rows_with_parts():
        share, domain = ErrorModel2D.GRID_SHARE, row["domain"]
        if name == "GRID_SHARE":
            share = value
        else:
            domain *= (1 - ErrorModel2D.DOMAIN_ERROR) / (1 - value)
        yield row["error"] - share * row["grid"] - domain


def spread_uncovered(run: Run, value: float) -> Iterator[bool]:
    """Yield whether a 2-D body's error is beyond its bound with this spread."""
    model, cells = ERROR_MODELS[2], FIDELITIES["standard"].cells
    nose = nose_of_ellipse(1.0)
    with mock.patch.object(ErrorModel2D, "SPREAD", value):
        for row in _rows_with_parts():
            parts = (Loads(row[part], 0.0, 0.0) for part in ("grid", "domain"))
            likely = model.likely(*parts, model.spreads(cells, row["reynolds"], nose)).drag
            yield abs(row["error"]) > model.SAFETY.drag * likely


def accurate_errors(run: Run, value: float) -> Iterator[float]:
    """Yield errors of 3-D draft flows called accurate, over the error tolerance."""
    for row in (row for row in known_errors(3) if row["fidelity"] == "draft"):
        with mock.patch.object(ErrorModel3D, "FEW_CELLS", value):
            margin = ERROR_MODELS[3].margin(NAMED[3]["draft"].cells, row["reynolds"])
        if margin * row["likely"] <= row["tolerance"]:
            yield abs(row["error"]) / row["tolerance"]


def constants(run: Run) -> Iterator[Row]:
    """Yield every constant at every value that is tried."""
    what = "error of Cd: sphere and held-out bodies, Re 28 to 100"
    for name, values in WALL.items():
        yield from sweep(name, values, what, partial(wall_errors, name))
    what = "error of Cd: sphere, Re 1, retraction without slip law"
    yield from sweep("SECOND_ORDER", WALL["SECOND_ORDER"], what, retracted_error)
    what = "change of Cd and Cl: ellipse, aspect 2 at 10 degrees, Re 1 and 40"
    yield from sweep("NULL_MODE_COMPLIANCE", (0.01, 0.1, 1.0), what, null_mode_changes)
    for dimension, values in ((2, (1e-7, 1e-5, 1e-3)), (3, (1e-10, 1e-8, 1e-6))):
        name, what = f"slip_compliance, {dimension}-D", "change of Cd: aspect 2, Re 1"
        yield from sweep(name, values, what, partial(slip_changes, dimension))
    what, errors = "error of a point force's velocity: Re 0.001 to 300", quadrature_errors
    yield from sweep("oseen_2d: nodes, panels, ratio", QUADRATURES, what, errors)
    what, errors = "error of sigma^-1 and G_xx: Re 0.1 to 100", fit_errors
    yield from sweep("oseen_3d: step of ln t, SINGULAR_CUT, BETAS", FITS, what, errors)
    for name, what in (
        ("VORTICITY_PROBES", "error of friction drag"),
        ("VORTICITY_PROBES", "short waves of Cf, share"),
        ("PRESSURE_PROBES", "error of pressure drag"),
    ):
        where, errors = "cylinder, Re 1, draft and standard", partial(surface_errors, what)
        yield from sweep(name, PROBES, f"{what}: {where}", errors)
    what = "error of Cd, standard: aspect 0.5, 0.7, 1, Re 45"
    yield from sweep("Fidelity.wake", (0.0, 0.1, 0.2, 0.4), what, wake_errors)
    what = "share of domain errors beyond SAFETY times their estimate: standard, "
    what += "aspect 0.5 to 2, Re 1 to 40"
    for dimension, values in ((2, (0.2, 0.4, 0.6)), (3, (2.0, 3.0, 5.0, 8.0))):
        name, errors = f"DOMAIN_ERROR, {dimension}-D", partial(domains_uncovered, dimension)
        yield from sweep(name, values, what, errors)
    what = "error of Cd that the estimated errors of grid and domain leave, 2-D"
    for name, key, values in (
        ("DOMAIN_ERROR, 2-D", "DOMAIN_ERROR", (0.0, 0.2, 0.4, 0.6)),
        ("GRID_SHARE", "GRID_SHARE", (0.25, 0.5, 0.75, 1.0)),
    ):
        yield from sweep(name, values, what, partial(parts_left, key))
    what = "share of errors beyond their bound, 2-D"
    yield from sweep("SPREAD", (1.25e-4, 2.5e-4, 5e-4, 1e-3), what, spread_uncovered)
    for dimension in (2, 3):
        what = "share of errors beyond it times the likely error"
        values, errors = (1.0, 1.25, 1.5, 2.0, 2.25, 2.5), partial(uncovered, dimension)
        yield from sweep(f"SAFETY, {dimension}-D", values, what, errors)
    what = "error over tolerance of drags called accurate, 3-D draft"
    yield from sweep("FEW_CELLS", (1.0, 1.25, 1.5), what, accurate_errors)


COLUMNS = columns(
    "constant {constant} | value {value} | {chosen} | what is measured {what} | cases {cases}"
    " | mean or share {mean:.2g} | largest {most:.2g}"
)
STUDIES = {"constants": Study([Table(constants, measure, COLUMNS, tiny="all")])}
