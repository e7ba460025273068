"""The steady flow past a body, solved by ``Flow`` (flow.py); the notes are in README.md.

grid: the discrete problem in 2-D and 3-D; solver: GMRES, Newton, adjoints; loads.py: drag, lift and
moment as functionals; surface: pressure and friction on the wall; check: the estimated error, and
a march in time.
"""
