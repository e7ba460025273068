"""Solvers: GMRES, Newton, the two steady problems, and the flow linearised at a state."""
