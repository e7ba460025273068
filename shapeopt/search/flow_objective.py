"""The objective of a problem by body flows and adjoints, its work counted."""

import jax
import jax.numpy as jnp
import numpy as np

from shapeopt.problem.objective import combine
from shapeopt.problem.problem import Problem
from shapeopt.search.verify import cylinder_drags
from surrogate.errors import NotConverged
from surrogate.flow.flow import Flow


class FlowObjective:
    """Value and gradient of the objective: one flow and one adjoint per scenario and call.

    ``flows`` and ``green_applications`` count them, ``first`` is the first value asked for.
    """

    def __init__(self, problem: Problem, flow: Flow):
        self.flow, self.scenarios = flow, problem.scenarios
        relative = bool(self.scenarios.relative)
        self.cylinder = cylinder_drags(problem) if relative else np.ones(len(self.scenarios.weight))
        self.flows, self.green_applications, self.first = 0, 0, float("nan")

    def __call__(self, parameters: np.ndarray) -> tuple[float, np.ndarray]:
        drags, slopes = [], []
        for shift, reynolds in zip(self.scenarios.shift, self.scenarios.reynolds, strict=True):
            found = self.flow.slope(parameters + shift, reynolds)
            if not bool(found.converged):
                raise NotConverged(f"optimise on the flow: no flow or adjoint at Re {reynolds:g}")
            self.flows += 1
            self.green_applications += int(found.green_applications)
            drags.append(float(found.drag))
            slopes.append(np.asarray(found.gradient))
        value, weights = _combined(np.array(drags), self.cylinder, self.scenarios)
        if np.isnan(self.first):
            self.first = float(value)
        return float(value), np.asarray(weights) @ np.array(slopes)


@jax.jit
def _combined(drags, cylinder, scenarios):
    return jax.value_and_grad(combine)(jnp.asarray(drags), cylinder, scenarios)
