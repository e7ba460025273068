"""Solvers: GMRES, Newton, the two steady problems, adjoints of loads and linearised flows."""
