"""Options of solve_drag.py by which flows are kept in folders, and their forces are in newtons."""

import argparse
import dataclasses
from collections.abc import Callable
from pathlib import Path

from shapeopt.commands.cli import Parser
from shapeopt.commands.ranges import numbers
from shapeopt.commands.sweep import Case
from surrogate.errors import InvalidInput
from surrogate.files import JsonObject
from surrogate.flow.forces import Conditions
from surrogate.flow.solution import Solution

EXAMPLE = "0.3,0.001,1.2,1.5e-5"


def add_kept_arguments(parser: Parser) -> None:
    """Add the options --out (folder of the flow) and --fluid (forces in newtons)."""
    parser.add_argument("--out", help="folder of contour, fields and picture; one each of several")
    fluid = (
        "forces in N (2-D: a metre of span) for U,D,RHO[,NU] in m/s, m, kg/m^3, m^2/s, D the "
        "equivalent diameter"
    )
    parser.add_argument("--fluid", help=f"{fluid}, as {EXAMPLE}; NU checks that Re = U D / nu")


def kept_flows(
    arguments: argparse.Namespace, cases: list[Case]
) -> Callable[[Case, Solution], JsonObject]:
    """Return a function that stores a solved flow and returns the entries for its row of results.

    The entries are the forces in newtons where --fluid is given, and the folder where --out is.

    Raises:
      InvalidInput: a folder holds something else, or U D / nu is not the Reynolds number.
    """
    conditions, folders = _conditions(arguments.fluid), {}
    for case in cases if conditions else ():
        conditions.check(case.reynolds)
    if arguments.out is not None:
        from surrogate.flow.output.folder import check_flow_folder  # imports pyvista: a second

        folders = {id(case): flow_folder(arguments.out, case, cases) for case in cases}
        for folder in folders.values():
            check_flow_folder(folder)

    def keep(case: Case, solution: Solution) -> JsonObject:
        gained: JsonObject = {}
        if conditions:
            forces = solution.forces(**dataclasses.asdict(conditions))
            gained["forces_N"] = dataclasses.asdict(forces)
            gained["forces_span"] = 1.0 if case.shape.dimension == 2 else None
        if folders:
            gained["out"] = str(solution.write(folders[id(case)]))
        return gained

    return keep


def forces_line(row: JsonObject) -> str:
    """Return the forces of a row as a line of text: drag and lift in N, moment in N m."""
    force = row["forces_N"]
    span = " per metre of span" if row["forces_span"] else ""
    return (
        f"incidence {row['incidence']:g}, Re {row['reynolds']:.4g}: drag {force['drag']:.4g} N, "
        f"lift {force['lift']:.4g} N, moment {force['moment']:.4g} N m{span}"
    )


def flow_folder(out: str, case: Case, cases: list[Case]) -> Path:
    """Return a flow's folder: OUT for a single flow, else OUT/re10 or OUT/incidence5_re10."""
    if len(cases) == 1:
        return Path(out)
    name = f"re{case.reynolds:.9g}"
    if len({other.incidence for other in cases}) > 1:
        name = f"incidence{case.incidence:.9g}_{name}"
    return Path(out) / name


def _conditions(text: str | None) -> Conditions | None:
    if text is None:
        return None
    values = numbers(text, "--fluid", EXAMPLE)
    if len(values) not in (3, 4):
        raise InvalidInput(f"--fluid {text}: U,D,RHO or U,D,RHO,NU, as {EXAMPLE}")
    return Conditions(*values)
