"""What the third order of the far field's momentum flux in the body's force changes.

The bodies and their elements are those of the records of ``trust`` (symmetric) and ``lift``.
"""

import dataclasses
from collections.abc import Iterator
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from run import recorded
from studies.lift import BODIES
from studies.trust import against_elements
from study import Result, Row, Run, Study, Table, cases, columns
from tools import name_of

from surrogate import FIDELITIES, Fidelity, NotConverged, Shape, Unbounded, family_shape
from surrogate.flow.grid.discretise import fitted_domain
from surrogate.flow.grid.domain_2d import FAR_ORDER
from surrogate.flow.loads import drag, lift, moment
from surrogate.flow.solver.steady import assemble, body_flow

RANGES = ((0.0, 1.0), (1.0, 5.0), (5.0, 20.0), (20.0, 45.0), (45.0, 200.0))  # of Re
KINDS = ("symmetric", "with lift")
CASES = cases(kind=KINDS, order=(2, 3))


def symmetric_bodies() -> Iterator[tuple[Shape, float, np.ndarray]]:
    """Yield the symmetric bodies of ``trust`` with their Re and loads, by elements."""
    for row in against_elements(recorded("trust")):
        truth = row["drag"] / (1 + row["error"])
        yield family_shape(row["parameters"]), row["reynolds"], np.array([truth, 0.0, 0.0])


def lifting_bodies() -> Iterator[tuple[Shape, float, np.ndarray]]:
    """Yield the bodies of ``lift`` with their Re and loads, by elements."""
    parameters = {name_of(body): body for body, _ in BODIES}
    for row in recorded("lift")["rows"]:
        if row["fidelity"] == "standard":
            drag = row["cd"] / (1 + row["cd_error"])
            loads = (row[name] - row[f"{name}_error"] * drag for name in ("cd", "cl", "cm"))
            body = family_shape(parameters[row["body"]])
            yield body, row["reynolds"], np.array([*loads])


@partial(jax.jit, static_argnames="domain")
def _loads(domain, markers, reynolds):
    state, info = body_flow(domain, assemble(domain, markers, reynolds))
    at = domain.modes, state.amplitude, markers
    return jnp.stack([drag(*at), lift(*at), moment(*at)]), info.converged


def loads(level: Fidelity, order: int, shape: Shape, reynolds: float) -> np.ndarray:
    """Return Cd, Cl and Cm of a body with a far field of this order.

    Args:
      level: Fidelity.
      order: Of the far field's flux in the force.
      shape: The body.
      reynolds: U D / nu.
    """
    domain = fitted_domain(Unbounded(), level, shape, reynolds)
    domain = dataclasses.replace(domain, far_order=order)
    found, converged = _loads(domain, shape.markers(domain.nodes), jnp.asarray(reynolds))
    if not converged:
        raise NotConverged(f"flow at Re {reynolds:g}: not converged")
    return np.asarray(found)


def measure(run: Run, kind: str, order: int) -> list[Row]:
    """Return the mean and the largest errors of the loads over Cd in every range of Re.

    Args:
      run: How the study is run.
      kind: Of the bodies.
      order: Of the far field's flux in the force.
    """
    level = FIDELITIES[run.pick("draft", "standard")]
    bodies = list(symmetric_bodies() if kind == KINDS[0] else lifting_bodies())
    found = []
    for low, high in RANGES[:1] if run.tiny else RANGES:
        mine = [each for each in bodies if low < each[1] <= high]
        errors = np.abs(
            [
                (loads(level, order, shape, reynolds) - truth) / truth[0]
                for shape, reynolds, truth in (mine[:1] if run.tiny else mine)
            ]
        )
        row = {"low": low, "high": high, "flows": len(errors)}
        for k, name in enumerate(("cd", "cl", "cm") if kind == KINDS[1] else ("cd",)):
            row |= {name: errors[:, k].mean(), f"{name}_most": errors[:, k].max()}
        found.append(row)
    return found


def symmetric_errors(result: Result) -> tuple[int, float, float]:
    """Return the number of symmetric bodies, and the mean and the largest error of their Cd."""
    rows = [row for row in result["rows"] if row["kind"] == KINDS[0] and row["order"] == FAR_ORDER]
    flows = [row["flows"] for row in rows]
    mean = np.average([row["cd"] for row in rows], weights=flows)
    return sum(flows), float(mean), max(row["cd_most"] for row in rows)


COLUMNS = columns(
    "bodies {kind} | order {order} | Re above {low:g} | to {high:g} | flows {flows}"
    " | Cd: mean error {cd:.3%} | largest {cd_most:.2%} | Cl: mean, over Cd {cl:.3%}"
    " | largest {cl_most:.2%} | Cm: mean, over Cd {cm:.3%} | largest {cm_most:.2%}"
)
STUDIES = {"far_field": Study([Table(CASES, measure, COLUMNS)])}
