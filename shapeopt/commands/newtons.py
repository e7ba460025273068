"""The option --fluid, by which commands also answer forces in newtons."""

import dataclasses

from shapeopt.commands.cli import Parser
from shapeopt.commands.ranges import few_numbers
from surrogate.files import JsonObject
from surrogate.flow.forces import Conditions, Forces

EXAMPLE = "0.3,0.001,1.2,1.5e-5"
FORMS = f"U,D,RHO or U,D,RHO,NU in m/s, m, kg/m^3 and m^2/s, without units, as {EXAMPLE}"


def add_fluid_argument(parser: Parser) -> None:
    """Add the option --fluid: speed, size and fluid, for forces in newtons."""
    fluid = (
        "forces in N (2-D: a metre of span) for U,D,RHO[,NU] in m/s, m, kg/m^3, m^2/s, D the "
        "equivalent diameter"
    )
    parser.add_argument("--fluid", help=f"{fluid}, as {EXAMPLE}; with NU it gives Re = U D / nu")


def conditions_of(text: str | None) -> Conditions | None:
    """Return the conditions that --fluid gives, or None where it is not given.

    Raises:
      InvalidInput: it is neither three nor four positive numbers.
    """
    if text is None:
        return None
    return Conditions(*few_numbers(text, "--fluid", FORMS, 3, 4))


def force_entries(
    forces: Forces, conditions: Conditions, reynolds: float, dimension: int
) -> JsonObject:
    """Return the entries of a row of results for its forces, span and kinematic viscosity."""
    return {
        "forces_N": dataclasses.asdict(forces),
        "forces_span": 1.0 if dimension == 2 else None,
        "viscosity": conditions.viscosity_at(reynolds),
    }


def forces_line(row: JsonObject) -> str:
    """Return the forces of a row as a line of text: drag and lift in N, moment in N m."""
    force = row["forces_N"]
    span = " per metre of span" if row["forces_span"] else ""
    return (
        f"incidence {row['incidence']:g}, Re {row['reynolds']:.4g}: drag {force['drag']:.4g} N, "
        f"lift {force['lift']:.4g} N, moment {force['moment']:.4g} N m about the centroid{span}, "
        f"for nu {row['viscosity']:.4g} m^2/s"
    )
