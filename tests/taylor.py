"""Taylor remainders of the objective and of the constraints on loads, on the flow."""

import numpy as np

from shapeopt import Problem
from shapeopt.search.evaluated import evaluate_design
from shapeopt.search.memory import Memory
from surrogate import Flow

STEPS = 0.04, 0.02


def taylor_rates(problem: Problem, variables: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Return the orders at which the remainders vanish: of the objective, then the constraints."""
    memory = Memory(Flow(problem.scene), None)
    at, remainders = evaluate_design(problem, memory, variables), []
    slopes = np.vstack([at.gradient, at.by_loads]) @ direction
    for step in STEPS:
        moved = evaluate_design(problem, memory, variables + step * direction)
        values = np.append(moved.value - at.value, moved.of_loads - at.of_loads)
        remainders.append(np.abs(values - step * slopes))
    return np.log2(remainders[0] / remainders[1]) / np.log2(STEPS[0] / STEPS[1])
