"""Errors of flows whose empirical constants have other values, as study ``constants`` varies them.

Every function takes how the study is run and a value of one constant, and yields relative errors
or changes, or whether an error is beyond its bound. The drag in 3-D is compared with the elements
of ``flow_3d``, read from its record.
"""

import dataclasses
import math
from collections.abc import Iterator
from functools import cache, partial
from unittest import mock

import jax
import jax.numpy as jnp
import numpy as np
from run import recorded
from studies.accuracy_3d import HELD_OUT, SPHERE, held_out
from study import TINY, Run

from surrogate import FIDELITIES, Fidelity, Shape, Unbounded, family_shape
from surrogate.flow.check.error_model import ERROR_MODELS
from surrogate.flow.grid import wall_3d
from surrogate.flow.grid.discretise import fitted_domain
from surrogate.flow.grid.domain import Domain
from surrogate.flow.grid.wall_2d import outward
from surrogate.flow.loads import drag_coefficient
from surrogate.flow.solver import steady
from surrogate.flow.surface import forces_2d, pressure
from surrogate.flow.surface.surface import surface_of
from surrogate.scene.fidelity import NAMED

PRESSURE, FRICTION = 5.22, 5.11  # parts of the cylinder's Cd at Re 1, body-fitted elements
COARSE_3D = dataclasses.replace(NAMED[3]["standard"], cells=12)
Body = tuple[tuple[str, float], ...]
ROUND: Body = (("aspect", 1.0),)
WALL = ("THIN_LAYER_RE", "RETRACTED_SHARE", "SECOND_ORDER")
CHOSEN_WALL = {name: getattr(wall_3d, name) for name in WALL}


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


def wall_errors(name: str, run: Run, value: float) -> Iterator[float]:
    """Yield errors of Cd at Re above 20, where boundary layers have few cells."""
    rows = [row for row in recorded("flow_3d")["rows"] if row["panel"] == HELD_OUT]
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
        markers, state = shape.markers(domain.nodes), solve(domain, shape, 1.0)
        flow = state.velocity, pressure.pressure(domain, markers, state, 1.0)
        vorticity = mock.patch.object(forces_2d, "VORTICITY_PROBES", value)
        with vorticity, mock.patch.object(pressure, "PRESSURE_PROBES", value):
            forces_2d.friction_coefficient.clear_cache()  # compiled with the last value
            found = surface_of(domain, *flow, shape.draw(400), 1.0)
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
