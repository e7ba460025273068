"""Shape optimisation with a drag surrogate, or directly with the flow's adjoint."""
