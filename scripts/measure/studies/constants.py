"""The effect of each of the flow's empirical constants, while the others keep their values.

The drag in 3-D is compared with the elements of ``flow_3d``; safety factors are tried on the bodies
of ``trust``, ``trust_space`` and ``corners``. All of these are read from their records.
"""

import dataclasses
import json
import math
from collections.abc import Callable, Iterable, Iterator
from functools import cache, partial
from typing import Any
from unittest import mock

import jax
import jax.numpy as jnp
import numpy as np
from kernel_errors import FIT, FITS, QUADRATURE, QUADRATURES, fit_errors, quadrature_errors
from run import RESULTS
from studies.accuracy_3d import HELD_OUT, SPHERE, held_out
from studies.trust import rows_of
from study import TINY, Result, Row, Run, Study, Table, columns

from surrogate import FIDELITIES, Fidelity, Shape, Unbounded, family_shape
from surrogate.body.nose import nose_of_ellipse
from surrogate.flow.check.error_estimate import ERROR_MODELS, ErrorModel2D, ErrorModel3D, Loads
from surrogate.flow.grid import wall_3d
from surrogate.flow.grid.discretise import DOMAINS, fitted_domain
from surrogate.flow.grid.domain import Domain
from surrogate.flow.grid.wall_2d import outward
from surrogate.flow.loads import drag_coefficient
from surrogate.flow.solver import steady
from surrogate.flow.surface import forces_2d, pressure
from surrogate.flow.surface.surface import surface_of
from surrogate.scene.fidelity import NAMED, SPACE_FIDELITIES

WALL = {
    "THIN_LAYER_RE": (20.0, 40.0, 80.0),
    "RETRACTED_SHARE": (0.6, 0.8, 1.0),
    "SECOND_ORDER": (6.0, 12.0, 18.0),
}
CHOSEN_WALL = {name: getattr(wall_3d, name) for name in WALL}
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
PRESSURE, FRICTION = 5.22, 5.11  # parts of the cylinder's Cd at Re 1, body-fitted elements
COARSE_3D = dataclasses.replace(SPACE_FIDELITIES["standard"], cells=12)
Body = tuple[tuple[str, float], ...]
ROUND: Body = (("aspect", 1.0),)


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


@partial(jax.jit, static_argnames="domain")
def _flow(domain, markers, reynolds, compliance, wall):
    """Solve body flow with constants that are traced, so that one compilation serves all values."""
    null_mode = mock.patch.object(steady, "NULL_MODE_COMPLIANCE", compliance)
    with mock.patch.multiple(wall_3d, **wall), null_mode:
        return steady.body_flow(domain, steady.assemble(domain, markers, reynolds))


def solve(domain: Domain, shape: Shape, reynolds: float, **values: float) -> steady.FlowState:
    """Return the flow's state with some constants at other values; NaN where it did not converge.

    Args:
      domain: The discrete problem.
      shape: The body.
      reynolds: U D / nu.
      **values: Of the constants in ``WALL`` and of NULL_MODE_COMPLIANCE.
    """
    compliance = values.pop("NULL_MODE_COMPLIANCE", steady.NULL_MODE_COMPLIANCE)
    body = shape.markers(domain.nodes), jnp.asarray(reynolds)
    state, info = _flow(domain, *body, compliance, CHOSEN_WALL | values)
    return jax.tree.map(lambda part: jnp.where(info.converged, part, math.nan), state)


@cache
def cd(body: Body, reynolds: float, level: Fidelity, dimension: int = 2, **values: float) -> float:
    """Return the drag coefficient Cd of a body with some constants at other values.

    Args:
      body: Names and values of the parameters.
      reynolds: U D / nu.
      level: Fidelity.
      dimension: 2 or 3.
      **values: Of the constants.
    """
    shape = family_shape(dict(body), dimension=dimension)
    domain = fitted_domain(Unbounded(), level, shape, reynolds)
    return float(drag_coefficient(solve(domain, shape, reynolds, **values).amplitude))


def record(name: str) -> Result:
    """Return the result of another study from its record."""
    return json.loads((RESULTS / f"{name}.json").read_text())["result"]


def wall_errors(name: str, run: Run, value: float) -> Iterator[float]:
    """Yield errors of Cd at Re above 20, where boundary layers have few cells."""
    rows = [row for row in record("flow_3d")["rows"] if row["panel"] == HELD_OUT]
    exact = [row["cd"] for row in rows if row["column"] == "finite elements"]
    known = [(ROUND, re, SPHERE[re]) for re in (40.0, 100.0)]
    for (body, re), drag in zip(held_out(), exact, strict=True):
        known += [(tuple(body.items()), re, drag)] if re > 20 else []
    for body, re, drag in known[: run.pick(1, None)]:
        yield cd(body, re, run.pick(TINY, COARSE_3D), 3, **{name: value}) / drag - 1


def retracted_error(run: Run, value: float) -> list[float]:
    """Return the error of the sphere's Cd at Re 1 where markers are retracted as at high Re."""
    alone = {"THIN_LAYER_RE": 1e-3, "RETRACTED_SHARE": 1.0, "SECOND_ORDER": value}
    return [cd(ROUND, 1.0, run.pick(TINY, COARSE_3D), 3, **alone) / SPHERE[1.0] - 1]


def null_mode_changes(run: Run, value: float) -> Iterator[float]:
    """Yield relative changes of Cd and Cl of an inclined ellipse."""
    shape = family_shape({"aspect": 2.0}, 10.0)
    domain = fitted_domain(Unbounded(), run.fidelity("standard"), shape, 40.0)
    loads, pair = np.array([0, domain.modes.lift_index]), ({"NULL_MODE_COMPLIANCE": value}, {})
    for re in (1.0, 40.0):
        other, usual = (solve(domain, shape, re, **constant) for constant in pair)
        yield from (other.amplitude / usual.amplitude - 1)[loads]


def slip_changes(dimension: int, run: Run, value: float) -> Iterator[float]:
    """Yield the relative change of Cd at Re 1 against a wall without compliance."""
    shape = family_shape({"aspect": 2.0}, dimension=dimension)
    domain = fitted_domain(Unbounded(), run.fidelity("standard", dimension), shape, 1.0)
    pair = (dataclasses.replace(domain, slip_compliance=slip) for slip in (value, 0.0))
    drag, exact = (solve(one, shape, 1.0).amplitude[0] for one in pair)
    yield drag / exact - 1


def surface_errors(what: str, run: Run, value: tuple[float, ...]) -> Iterator[float]:
    """Yield errors of the cylinder's drag, or the share of Cf's harmonics from the tenth on."""
    shape = family_shape({"aspect": 1.0})
    for level in run.pick([TINY], [FIDELITIES["draft"], FIDELITIES["standard"]]):
        domain = fitted_domain(Unbounded(), level, shape, 1.0)
        body = domain, shape.markers(domain.nodes), solve(domain, shape, 1.0)
        vorticity = mock.patch.object(forces_2d, "VORTICITY_PROBES", value)
        with vorticity, mock.patch.object(pressure, "PRESSURE_PROBES", value):
            found = surface_of(*body, shape.draw(400), 1.0)
        along, waves = outward(jnp.asarray(found.markers))[:, 1], abs(np.fft.rfft(found.cf))
        yield {
            "error of pressure drag": found.pressure_drag / PRESSURE - 1,
            "error of friction drag": 2 * np.pi * np.mean(found.cf * along) / FRICTION - 1,
            "short waves of Cf, share": waves[10:].sum() / waves.max(),
        }[what]


def wake_errors(run: Run, value: float) -> Iterator[float]:
    """Yield errors of Cd on few cells, against a far larger domain."""
    large = Fidelity("large", run.pick(6, 8), 12, 48, 24, wake=0.0)
    level = dataclasses.replace(FIDELITIES["standard"], cells=large.cells, wake=value)
    for aspect in run.pick((0.5,), (0.5, 0.7, 1.0)):
        drag, exact = (cd((("aspect", aspect),), 45.0, one) for one in (level, large))
        yield drag / exact - 1


def domains_uncovered(dimension: int, run: Run, value: float) -> Iterator[bool]:
    """Yield whether the domain's error is beyond the bound that another domain gives."""
    model = ERROR_MODELS[dimension]
    level = dataclasses.replace(NAMED[dimension]["standard"], cells={2: 8, 3: 6}[dimension])
    sizes = 2.0, 1.0, model.OTHER_DOMAIN  # the largest is taken as exact
    for aspect in run.pick((1.0,), (0.5, 1.0, 2.0)):
        body = (("aspect", aspect),)
        height = float(family_shape(dict(body), dimension=dimension).extent[-1])
        for re in run.pick((10.0,), (1.0, 10.0, 40.0)):
            usual = dataclasses.replace(level.for_wake(re, height), wake=0.0)
            exact, whole, other = (cd(body, re, usual.scaled(x), dimension) for x in sizes)
            yield abs(whole - exact) > model.SAFETY.drag * abs((whole - other) / (1 - value))


def known_errors(dimension: int) -> list[Row]:
    """Return the recorded bodies with a likely error (a bound without SAFETY) and an error."""
    if dimension == 2:
        rows = rows_of(record("trust"))
    else:
        rows = rows_of(record("trust_space"))
        for row in record("corners")["rows"]:
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
            margin = ERROR_MODELS[3].margin(SPACE_FIDELITIES["draft"].cells, row["reynolds"])
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
