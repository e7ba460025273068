"""Options of solve_drag.py by which flows are kept in folders, and their forces are in newtons."""

import argparse
import dataclasses
from collections.abc import Callable
from pathlib import Path

from shapeopt.commands.cli import Parser
from shapeopt.commands.newtons import add_fluid_argument, conditions_of, force_entries
from shapeopt.commands.sweep import Case
from surrogate.errors import InvalidInput
from surrogate.files import JsonObject
from surrogate.flow.solution import Solution


def add_kept_arguments(parser: Parser) -> None:
    """Add the options --out (folder of the flow) and --fluid (forces in newtons)."""
    parser.add_argument("--out", help="folder of contour, fields and picture; one each of several")
    add_fluid_argument(parser)


def kept_flows(
    arguments: argparse.Namespace, cases: list[Case]
) -> Callable[[Case, Solution], JsonObject]:
    """Return a function that stores a solved flow and returns the entries for its row of results.

    The entries are the forces in newtons where --fluid is given, and the folder where --out is.

    Raises:
      InvalidInput: a folder holds something else, or U D / nu is not the Reynolds number.
    """
    conditions, folders = conditions_of(arguments.fluid), {}
    for case in cases if conditions else ():
        conditions.check(case.reynolds)
    if arguments.out is not None:
        from surrogate.flow.output.folder import check_flow_folder  # imports pyvista: a second

        folders = {id(case): flow_folder(arguments.out, case, cases) for case in cases}
        if len(set(folders.values())) < len(cases):
            raise InvalidInput("--out: two of the flows are the same to nine digits; leave one out")
        for folder in folders.values():
            check_flow_folder(folder)

    def keep(case: Case, solution: Solution) -> JsonObject:
        gained: JsonObject = {}
        if conditions:
            forces = solution.forces(**dataclasses.asdict(conditions))
            gained |= force_entries(forces, conditions, case.reynolds, case.shape.dimension)
        if folders:
            gained["out"] = str(solution.write(folders[id(case)]))
        return gained

    return keep


def flow_folder(out: str, case: Case, cases: list[Case]) -> Path:
    """Return a flow's folder: OUT for a single flow, else OUT/re10 or OUT/incidence5_re10."""
    if len(cases) == 1:
        return Path(out)
    name = f"re{case.reynolds:.9g}"
    if len({other.incidence for other in cases}) > 1:
        name = f"incidence{case.incidence:.9g}_{name}"
    return Path(out) / name
