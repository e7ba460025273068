"""Scenarios of an objective, the objective as one number of their loads, and bounds on loads.

Search on a model, search on the flow and verification share this definition; symbols as in
``shapeopt/README.md``, section 1.
"""

from typing import NamedTuple, Protocol, runtime_checkable

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from surrogate.arrays import AnyArray

# Least magnitude of an objective that relative changes are taken of: a glide ratio may be zero.
LEAST_OBJECTIVE = 0.1


@runtime_checkable
class LoadModel(Protocol):
    """A differentiable model of the loads that JAX can trace: a network, or kriging."""

    def loads(
        self, parameters: Float[AnyArray, " parameters"], reynolds: Float[AnyArray, ""]
    ) -> Float[Array, " loads"]:
        """Return Cd, and where there is lift Cl and Cm, of a body at a Reynolds number."""
        ...


class LoadBound(NamedTuple):
    """A kind of bound that a problem may set on the load ``index`` among Cd, Cl and Cm.

    ``sense`` is 1 of a minimum and -1 of a maximum; ``symbol`` is the load's, for messages.
    """

    index: int
    sense: int
    symbol: str


NO_LIFT = (
    "the bodies of this scene have no lift; those of pretrained:lift have, and those of scenes "
    "with camber or incidence"
)
LOAD_BOUNDS = {
    "lift": LoadBound(1, 1, "Cl"),
    "min_moment": LoadBound(2, 1, "Cm"),
    "max_moment": LoadBound(2, -1, "Cm"),
}
UNBOUNDED = 1e5  # magnitude of a bound that every load satisfies: at Re 0.001 Cd is about 3e4


class Scenarios(NamedTuple):
    """The cases i of an objective: shape changes s_i, Reynolds numbers Re_i and weights w_i.

    ``variable`` says which of the variables of the search are the parameters of the body in each
    case: all cases share them, except those that an objective leaves free in every case, as
    ``MultiPoint`` does the incidence. Weights sum to 1. The loss of a case is Cd; with ``relative``
    it is divided by the drag of the ``round_body`` (cylinder, in 3-D sphere) at the same Re; with
    ``glide`` it is -Cl / Cd, with ``force`` sqrt(Cd^2 + Cl^2). ``level`` is the CVaR level: the
    objective is the mean of the worst share 1 - level of the cases, and of all cases at level 0.
    ``load_bounds`` are the values of ``LOAD_BOUNDS`` in every case; there are none where there is
    no lift.
    """

    variable: Int[AnyArray, "cases parameters"]
    shift: Float[AnyArray, "cases parameters"]
    reynolds: Float[AnyArray, " cases"]
    weight: Float[AnyArray, " cases"]
    relative: Bool[AnyArray, ""]
    glide: Bool[AnyArray, ""]
    force: Bool[AnyArray, ""]
    level: Float[AnyArray, ""]
    round_body: Float[AnyArray, " parameters"]
    load_bounds: Float[AnyArray, "load_bounds cases"]

    def bodies(
        self, variables: Float[AnyArray, " variables"]
    ) -> Float[AnyArray, "cases parameters"]:
        """Return the parameters of the body in every case."""
        return variables[self.variable] + self.shift

    def by_variables(
        self, slopes: Float[np.ndarray, "cases loads parameters"], count: int
    ) -> Float[np.ndarray, "cases loads variables"]:
        """Return derivatives by all ``count`` variables from those by each case's parameters."""
        found = np.zeros((*slopes.shape[:2], count))
        np.put_along_axis(found, np.asarray(self.variable)[:, None], slopes, axis=2)
        return found

    def padded(self, count: int) -> "Scenarios":
        """Return the same objective with ``count`` cases, the last one repeated with weight 0."""
        missing = count - len(self.weight)
        return self._replace(
            variable=np.pad(self.variable, ((0, missing), (0, 0)), mode="edge"),
            shift=np.pad(self.shift, ((0, missing), (0, 0)), mode="edge"),
            reynolds=np.pad(self.reynolds, (0, missing), mode="edge"),
            weight=np.pad(self.weight, (0, missing)),
            load_bounds=np.pad(self.load_bounds, ((0, 0), (0, missing)), mode="edge"),
        )


@jax.jit
def combine(
    loads: Float[AnyArray, "cases loads"],
    round_drags: Float[AnyArray, " cases"],
    scenarios: Scenarios,
) -> Float[Array, ""]:
    """Return the objective from a body's loads and the round body's drags in all scenarios."""
    drags, lifts = loads[:, 0], loads[:, 1:2].sum(axis=1)  # no lift where there is none
    losses = drags / jnp.where(scenarios.relative, round_drags, 1.0)
    losses = jnp.where(scenarios.glide, -lifts / drags, losses)
    losses = jnp.where(scenarios.force, jnp.sqrt(drags**2 + lifts**2), losses)
    return conditional_value_at_risk(losses, scenarios.weight, scenarios.level)


def load_constraints(
    loads: Float[AnyArray, "cases loads"], scenarios: Scenarios
) -> Float[Array, " constraints"]:
    """Return constraint values that are >= 0 where the loads satisfy their bounds.

    They are the distances of Cl and Cm from their bounds over Cd, for every bound in every case;
    empty where bodies have no lift.
    """
    if not len(scenarios.load_bounds):
        return jnp.zeros(0)
    rows = [
        bound.sense * (loads[:, bound.index] - scenarios.load_bounds[k]) / loads[:, 0]
        for k, bound in enumerate(LOAD_BOUNDS.values())
    ]
    return jnp.concatenate(rows)


def conditional_value_at_risk(
    losses: Float[AnyArray, " cases"], weight: Float[AnyArray, " cases"], level: AnyArray | float
) -> Float[Array, ""]:
    """Return the conditional value at risk (CVaR): the mean of the worst share 1 - level of losses.

    The closed form of min over t of t + E max(loss - t, 0) / (1 - level) (Rockafellar and Uryasev
    2000): the case at the border of the worst share counts with the part of its weight inside.
    """
    order = jnp.argsort(-losses)
    weight = weight[order]
    worse = jnp.cumsum(weight) - weight
    tail = jnp.clip(1 - level - worse, 0, weight)
    return tail @ losses[order] / (1 - level)


def model_objective(
    model: LoadModel, variables: Float[AnyArray, " variables"], scenarios: Scenarios
) -> Float[Array, ""]:
    """Return the objective of a body as a model predicts it, differentiable in the variables."""
    return objective_and_constraints(model, variables, scenarios)[0]


@jax.jit  # inside other programs it is traced once for all of them
def objective_and_constraints(
    model: LoadModel, variables: Float[AnyArray, " variables"], scenarios: Scenarios
) -> tuple[Float[Array, ""], Float[Array, " constraints"]]:
    """Return the objective of a body and its ``load_constraints`` as a model predicts them."""
    loads, round_drags = model_loads(model, variables, scenarios)
    return combine(loads, round_drags, scenarios), load_constraints(loads, scenarios)


@jax.jit
def model_loads(
    model: LoadModel, variables: Float[AnyArray, " variables"], scenarios: Scenarios
) -> tuple[Float[Array, "cases loads"], Float[Array, " cases"]]:
    """Return the loads of a body and the drags of the round body in every scenario, by a model."""
    loads = jax.vmap(model.loads)(scenarios.bodies(variables), scenarios.reynolds)
    of_round = jax.vmap(model.loads, in_axes=(None, 0))(scenarios.round_body, scenarios.reynolds)
    return loads, of_round[:, 0]
