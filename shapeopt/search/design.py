"""A design: the best body that a search found, and what the flow itself says of it."""

import dataclasses
import functools
from typing import Any

from jaxtyping import Float

from shapeopt.problem.problem import Problem
from shapeopt.search.verify import Verified, verify
from surrogate.arrays import AnyArray


@dataclasses.dataclass(frozen=True)
class Design:
    """The best body found, its objective, and its Cd at the nominal Reynolds number.

    Both are of the model that was searched last, and so is ``kkt_residual``; ``start`` is the
    objective where that search began. ``calls`` counts drags asked of models, ``flows`` those of
    the flow (one per scenario and step), ``green_applications`` their work with that of the
    adjoints. ``path`` holds the bodies on the way.
    """

    problem: Problem
    parameters: Float[AnyArray, " parameters"]
    objective: float
    drag: float
    kkt_residual: float
    start: float
    path: Float[AnyArray, "steps parameters"]
    calls: int
    flows: int
    green_applications: int
    seconds: float

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "verified"}

    @functools.cached_property
    def verified(self) -> Verified:
        """What the flow says of it: solved, with estimates, when first asked for.

        Raises:
          NotConverged: a flow was not found.
        """
        return verify(self.problem, self.parameters)

    @property
    def status(self) -> str:
        """Of its flows: accurate where every one is, else degraded."""
        return self.verified.status

    @property
    def estimated_error(self) -> float | None:
        """The largest of its flows', relative; None where one has no estimate."""
        return self.verified.estimated_error
