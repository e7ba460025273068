"""The body that settles fastest: a surrogate's drag coupled with the body's weight in OpenMDAO.

python scripts/settling_speed.py

A body of volume pi D^3 / 6 and given excess weight falls at the Reynolds number where weight and
drag balance, 4/3 Ar = Cd(shape, Re) Re^2, with the Archimedes number Ar = (rho_body / rho - 1) g
D^3 / nu^2. Its drag depends on Re and Re on the drag, a cycle that is iterated to convergence. The
fastest body is one of least drag at its own Re: ``optimise`` finds the same there.
"""

import openmdao.api as om

from shapeopt import Problem, optimise
from shapeopt.openmdao import LoadsComponent
from surrogate import load

ARCHIMEDES = 1000.0


def fastest(archimedes: float = ARCHIMEDES) -> om.Problem:
    """Return the solved problem, whose outputs are the shape, ``cd`` and ``reynolds``."""
    problem, surrogate = om.Problem(reports=False), load("pretrained:space")
    body = LoadsComponent(model=surrogate)
    model = problem.model
    cycle = model.add_subsystem("cycle", om.Group(), promotes=["*"])
    cycle.add_subsystem("body", body, promotes=["*"])
    balance = om.ExecComp("reynolds = (4 * weight / (3 * cd)) ** 0.5", reynolds=20.0, cd=2.0)
    cycle.add_subsystem("fall", balance, promotes=["*"])
    cycle.nonlinear_solver = om.NonlinearBlockGS(maxiter=60, rtol=1e-12, iprint=-1)
    cycle.linear_solver = om.DirectSolver()
    for name in surrogate.scene.family.names:
        model.add_design_var(name, *body.ranges[name])
    model.add_objective("reynolds", scaler=-0.05)
    problem.driver = om.ScipyOptimizeDriver(optimizer="SLSQP", tol=1e-9, disp=False)
    problem.setup()
    problem.set_val("weight", archimedes)
    problem.run_driver()
    return problem


if __name__ == "__main__":
    found = fastest()
    reynolds = found.get_val("reynolds").item()
    print(f"it falls at Re {reynolds:.4g} with Cd {found.get_val('cd').item():.4f}")
    surrogate = load("pretrained:space")
    design = optimise(Problem(surrogate.scene, reynolds), surrogate)
    print(f"least drag at that Re by optimise: {design.drag:.4f}, {design!r}")
    for name, value in zip(surrogate.scene.family.names, design.parameters, strict=True):
        print(f"{name:>9}: {found.get_val(name).item():8.4f} and by optimise {value:8.4f}")
