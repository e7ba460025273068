"""The optimisation problem: objectives, constraints, feasible bodies, conflicting constraints."""
