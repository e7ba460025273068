"""Options of solve_drag.py by which flows are kept in folders, and their forces are in newtons."""

import argparse
import dataclasses
from collections.abc import Callable
from pathlib import Path

from shapeopt.commands.arguments import body_settings
from shapeopt.commands.cli import Parser
from shapeopt.commands.newtons import add_fluid_argument, conditions_of, force_entries
from shapeopt.commands.sweep import Case
from surrogate.errors import InvalidInput
from surrogate.files import JsonObject
from surrogate.flow.solution import Solution
from surrogate.versions import command_line


def add_kept_arguments(parser: Parser) -> None:
    """Add the options --out (folder of the flow) and --fluid (forces in newtons)."""
    folder = "folder of contour, fields and picture; of several flows OUT/re10, OUT/incidence5_re10"
    parser.add_argument("--out", help=folder)
    parser.add_argument("--overwrite", action="store_true", help="replace another flow in --out")
    add_fluid_argument(parser)


def kept_flows(
    arguments: argparse.Namespace, cases: list[Case]
) -> Callable[[Case, Solution], JsonObject]:
    """Return a function that stores a solved flow and returns the entries for its row of results.

    The entries are the forces in newtons where --fluid is given, and the folder where --out is.

    Raises:
      InvalidInput: a folder holds something else or, without --overwrite, another flow; or U D / nu
        is not the Reynolds number.
    """
    if arguments.overwrite and arguments.out is None:
        raise InvalidInput("--overwrite: goes with --out")
    conditions, folders, settings = conditions_of(arguments.fluid), {}, {}
    for case in cases if conditions else ():
        conditions.check(case.reynolds)
    if arguments.out is not None:
        from surrogate.flow.output.folder import check_stored_flow  # imports pyvista: a second

        folders = {id(case): flow_folder(arguments.out, case, cases) for case in cases}
        if len(set(folders.values())) < len(cases):
            raise InvalidInput("--out: two of the flows are the same to nine digits; leave one out")
        settings = {id(case): _settings(arguments, case) for case in cases}
        for key, folder in folders.items():
            check_stored_flow(folder, None if arguments.overwrite else settings[key])

    def keep(case: Case, solution: Solution) -> JsonObject:
        gained: JsonObject = {}
        if conditions:
            forces = solution.forces(**dataclasses.asdict(conditions))
            gained |= force_entries(forces, conditions, case.reynolds, case.shape.dimension)
        if folders:
            notes = gained | {"settings": settings[id(case)], "command": command_line()}
            gained["out"] = str(solution.write(folders[id(case)], notes))
        return gained

    return keep


def _settings(arguments: argparse.Namespace, case: Case) -> JsonObject:
    """Return what a flow is asked for, by which a stored one is known to be the same."""
    solver = {name: getattr(arguments, name) for name in ("stream", "fidelity", "cells")}
    body = body_settings(arguments) | {"incidence": case.incidence}
    return {"body": body, "dimension": case.shape.dimension, "reynolds": case.reynolds} | solver


def flow_folder(out: str, case: Case, cases: list[Case]) -> Path:
    """Return a flow's folder: OUT for a single flow, else OUT/re10 or OUT/incidence5_re10."""
    if len(cases) == 1:
        return Path(out)
    name = f"re{case.reynolds:.9g}"
    if len({other.incidence for other in cases}) > 1:
        name = f"incidence{case.incidence:.9g}_{name}"
    return Path(out) / name
