"""Scenarios of an objective, and the objective as one number made of their drags.

Search on a model, search on the flow and verification share this definition; symbols as in
``shapeopt/README.md``, section 1.
"""

from typing import NamedTuple, Protocol, runtime_checkable

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from surrogate.arrays import AnyArray


@runtime_checkable
class DragModel(Protocol):
    """A differentiable drag model that JAX can trace: a network, or kriging."""

    def drag(
        self, parameters: Float[AnyArray, " parameters"], reynolds: Float[AnyArray, ""]
    ) -> Float[Array, ""]:
        """Return the drag coefficient Cd of a body at a Reynolds number."""
        ...


class Scenarios(NamedTuple):
    """The cases i of an objective: shape changes s_i, Reynolds numbers Re_i and weights w_i.

    Weights sum to 1. With ``relative``, drags are divided by the drag of the ``round_body``
    (cylinder, in 3-D sphere) at the same Re. ``level`` is the CVaR level: the objective is the
    mean of the worst share 1 - level of the cases, and of all cases at level 0.
    """

    shift: Float[AnyArray, "cases parameters"]
    reynolds: Float[AnyArray, " cases"]
    weight: Float[AnyArray, " cases"]
    relative: Bool[AnyArray, ""]
    level: Float[AnyArray, ""]
    round_body: Float[AnyArray, " parameters"]

    def padded(self, count: int) -> "Scenarios":
        """Return the same objective with ``count`` cases, the last one repeated at weight 0."""
        missing = count - len(self.weight)
        return self._replace(
            shift=np.pad(self.shift, ((0, missing), (0, 0)), mode="edge"),
            reynolds=np.pad(self.reynolds, (0, missing), mode="edge"),
            weight=np.pad(self.weight, (0, missing)),
        )


def combine(
    drags: Float[AnyArray, " cases"],
    round_drags: Float[AnyArray, " cases"],
    scenarios: Scenarios,
) -> Float[Array, ""]:
    """Return the objective from the drags of a body and of the round body in all scenarios."""
    losses = drags / jnp.where(scenarios.relative, round_drags, 1.0)
    return conditional_value_at_risk(losses, scenarios.weight, scenarios.level)


def conditional_value_at_risk(
    losses: Float[AnyArray, " cases"], weight: Float[AnyArray, " cases"], level: AnyArray | float
) -> Float[Array, ""]:
    """Return the mean of the worst share 1 - level of the losses, CVaR.

    The closed form of min over t of t + E max(loss - t, 0) / (1 - level) (Rockafellar and Uryasev
    2000): the case at the border of the worst share counts with the part of its weight inside.
    """
    order = jnp.argsort(-losses)
    weight = weight[order]
    worse = jnp.cumsum(weight) - weight
    tail = jnp.clip(1 - level - worse, 0, weight)
    return tail @ losses[order] / (1 - level)


def model_objective(
    model: DragModel, parameters: Float[AnyArray, " parameters"], scenarios: Scenarios
) -> Float[Array, ""]:
    """Return the objective of a body as a model predicts it; differentiable in the parameters."""
    return combine(*model_drags(model, parameters, scenarios), scenarios)


def model_drags(
    model: DragModel, parameters: Float[AnyArray, " parameters"], scenarios: Scenarios
) -> tuple[Float[Array, " cases"], Float[Array, " cases"]]:
    """Return the predicted Cd of a body and of the round body in every scenario."""
    drags = jax.vmap(model.drag)(parameters + scenarios.shift, scenarios.reynolds)
    of_round = jax.vmap(model.drag, in_axes=(None, 0))(scenarios.round_body, scenarios.reynolds)
    return drags, of_round
