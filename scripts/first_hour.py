"""A first hour in Python, cell by cell, as a notebook would hold it.

python scripts/first_hour.py
python scripts/first_hour.py --out out/first_hour --fidelity standard
"""

import sys
from collections.abc import Sequence
from pathlib import Path

import jax
import numpy as np
from scipy.optimize import minimize

from shapeopt import Problem, optimise, save_run
from shapeopt.commands.cli import Parser, emit, run
from surrogate import Flow, Scene, contour_shape, load, naca4, train
from surrogate.files import JsonObject


def main(argv: Sequence[str] | None = None) -> JsonObject:
    """Run all cells."""
    parser = Parser(__doc__)
    parser.add_argument("--out", type=Path, default=Path("out/first_hour"), help="folder")
    parser.add_argument("--fidelity", default="draft", help="draft (default), standard or fine")
    parser.add_argument("--overwrite", action="store_true", help="train anew in the folder")
    arguments = parser.parse_args(argv)
    out = arguments.out

    # %% A scene says what is modelled; its flow is the solver, a network answers in microseconds.
    scene = Scene(reynolds=(1, 40), fidelity=arguments.fidelity)
    flow, net = Flow(scene), load("pretrained")
    body = np.array([2.0, 0.1, 0.0, 0.0])  # aspect, beta2, beta3, beta4
    by_flow, by_net = float(flow.drag(body, 20.0)), float(net.drag(body, 20.0))

    # %% Both can be differentiated; the network takes many bodies at once.
    gradient = jax.grad(flow.drag)(jax.numpy.asarray(body), 20.0)
    bodies = np.linspace([1.0, 0, 0, 0], [4.0, 0, 0, 0], 50)
    best_ellipse = bodies[np.argmin(net.drag(bodies, 20.0))]

    # %% SciPy's optimisers take the network as it is.
    drag = jax.jit(jax.value_and_grad(lambda parameters: net.drag(parameters, 40.0)))
    found = minimize(drag, [1.5, 0, 0, 0], jac=True, bounds=net.scene.family.bounds)

    # %% A section of your own at incidence: forces, estimated error, fields, and files to keep.
    section = contour_shape(naca4("2418"), 6.0)
    solution = flow.solve(section, 60 / section.chord)  # at a chord Reynolds number of 60
    newtons = solution.forces(speed=0.3, diameter=1e-3, density=1.2)
    solution.write(out / "section")

    # %% Train a network of your own for this scene (a small one, in seconds).
    mine = train(scene, method="hig", samples=16, out=out / "net", overwrite=arguments.overwrite)

    # %% Optimise: under constraints, to the optimum of the flow itself.
    problem = Problem(scene, reynolds=40, max_length=1.8)
    design = optimise(problem, mine, until="flow")
    save_run(out / "run", design)

    return emit(
        {
            "cd": {"flow": by_flow, "network": by_net, "gradient": gradient.tolist()},
            "best_ellipse": best_ellipse[0],
            "scipy": {"cd": float(found.fun), "parameters": found.x.tolist()},
            "section": {"cd": solution.drag, "cl": solution.lift, "lift_N": newtons.lift},
            "accuracy": solution.accuracy,
            "trained_error": mine.record["drag_error_mean"],
            "design": {
                "cd": design.drag,
                "flows": design.flows,
                "kkt_residual": design.kkt_residual,
            },
        },
        arguments.json,
        f"flow {by_flow:.4f}, network {by_net:.4f}; section Cl {solution.lift:.3f}, "
        f"{solution.accuracy}; design Cd {design.drag:.4f} after {design.flows} flows -> {out}",
    )


if __name__ == "__main__":
    sys.exit(run(main))
