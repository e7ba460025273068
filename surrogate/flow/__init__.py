"""The steady flow around a body, solved by ``Flow`` (flow.py); the rooms are its parts.

grid: where the unknowns live and what they answer; solver: Krylov, Newton, tangents;
loads: forces and pressures on the body; check: estimated error, and a march in time.
"""
