"""The body that settles fastest: a surrogate's drag coupled with the body's weight in OpenMDAO.

python scripts/settling_speed.py --archimedes 1000

A body falls where weight and drag balance, 4/3 Ar = Cd(shape, Re) Re^2, with the Archimedes number
Ar = (rho_body / rho - 1) g D^3 / nu^2. The fastest body has the least drag at its own Re.
"""

import sys
import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from shapeopt import Problem, optimise
from shapeopt.commands.cli import Parser, emit, run
from surrogate import InvalidInput, NotConverged, Surrogate, load
from surrogate.checks import physical_number
from surrogate.files import JsonObject

if TYPE_CHECKING:
    import openmdao.api as om

BALANCED = 1e-8  # relative difference of weight and drag at the end


def fastest(archimedes: float) -> "om.Problem":
    """Return the solved problem, whose outputs are the shape, ``cd`` and ``reynolds``.

    Raises:
      InvalidInput: OpenMDAO is not installed, or bodies fall at Re outside the trained range.
      NotConverged: SLSQP found no optimum or left the bodies, or weight and drag do not balance.
    """
    try:
        from shapeopt.openmdao import LoadsComponent, om
    except ImportError as reason:
        raise InvalidInput(str(reason)) from None
    problem, surrogate = om.Problem(reports=False), load("pretrained:space")
    body, model = LoadsComponent(model=surrogate), problem.model
    cycle = model.add_subsystem("cycle", om.Group(), promotes=["*"])
    cycle.add_subsystem("body", body, promotes=["*"])
    balance = "reynolds = (4 * weight / (3 * cd)) ** 0.5"
    fall = om.ExecComp(balance, weight=archimedes, reynolds=20.0, cd=2.0)
    cycle.add_subsystem("fall", fall, promotes=["*"])
    cycle.nonlinear_solver = om.NonlinearBlockGS(maxiter=60, rtol=1e-12, iprint=-1)
    cycle.linear_solver = om.DirectSolver()
    for name in surrogate.scene.family.names:
        model.add_design_var(name, *body.ranges[name])
    model.add_objective("reynolds", scaler=-0.05)
    problem.driver = om.ScipyOptimizeDriver(optimizer="SLSQP", tol=1e-9, disp=False)
    problem.setup()
    try:
        with warnings.catch_warnings():  # that the cycle is solved as a whole, as it must be
            warnings.simplefilter("ignore", om.OpenMDAOWarning)
            found = problem.run_driver().success
    except om.AnalysisError as reason:
        if "Reynolds number" not in str(reason):
            raise NotConverged(f"Archimedes number {archimedes:g}: {reason}") from None
        (low, high), (least, greatest) = surrogate.scene.reynolds, archimedes_range(surrogate)
        raise InvalidInput(
            f"Archimedes number {archimedes:g}: bodies fall at Re outside the trained {low:g} to "
            f"{high:g}; about {least:.4g} to {greatest:.4g} are within it"
        ) from None
    cd, reynolds = (problem.get_val(name).item() for name in ("cd", "reynolds"))
    if not found or abs(3 * cd * reynolds**2 / (4 * archimedes) - 1) > BALANCED:
        raise NotConverged(f"Archimedes number {archimedes:g}: no fastest body was found")
    return problem


def archimedes_range(surrogate: Surrogate) -> tuple[float, float]:
    """Return the Archimedes numbers at which the middle body falls at the trained Re's ends."""
    middle = [(low + high) / 2 for _, (low, high) in surrogate.scene.family.ranges]
    reynolds = np.array(surrogate.scene.reynolds)
    return tuple((0.75 * surrogate.drag(middle, reynolds) * reynolds**2).tolist())


def main(argv: Sequence[str] | None = None) -> JsonObject:
    """Find the fastest body, and the body of least drag at its Re by ``optimise``."""
    parser = Parser(__doc__)
    parser.add_argument("--archimedes", type=float, default=1000.0, help="number, above 0 (1000)")
    arguments = parser.parse_args(argv)
    physical_number("Archimedes number", arguments.archimedes)
    found, surrogate = fastest(arguments.archimedes), load("pretrained:space")
    reynolds, cd = (found.get_val(name).item() for name in ("reynolds", "cd"))
    least = optimise(Problem(surrogate.scene, reynolds), surrogate).drag
    body = {name: found.get_val(name).item() for name in surrogate.scene.family.names}
    result = {"reynolds": reynolds, "cd": cd, "parameters": body, "cd_by_optimise": least}
    text = f"falls fastest at Re {reynolds:.4g}, Cd {cd:.4f} (by optimise {least:.4f}): "
    return emit(result, arguments.json, text + ", ".join(f"{n} {body[n]:.4f}" for n in body))


if __name__ == "__main__":
    sys.exit(run(main))
