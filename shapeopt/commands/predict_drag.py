"""Loads of a family body by a trained surrogate, with --verify also by the flow solver.

python scripts/predict_drag.py --surrogate pretrained --aspect 2 --reynolds 1,10,40
python scripts/predict_drag.py --surrogate out/sip --aspect 2 --beta2 0.1 --reynolds 20 --verify
python scripts/predict_drag.py --aspect 4 --chord-reynolds 2:60:log20 --reference chord --json
python scripts/predict_drag.py --surrogate pretrained:lift --aspect 3 --incidence 0,4 --reynolds 40
python scripts/predict_drag.py --aspect 6 --reynolds 45 --extrapolate --verify
python scripts/predict_drag.py --surrogate pretrained:particle --aspect 2.5 --incidence 30 \\
    --reynolds 10 --fluid 0.01,1e-3,1000

Bodies with camber or incidence have Cl and Cm too, where the surrogate was trained for them.
Errors are within the bounds for 95 % of bodies. Errors and bounds of Cd are relative, those of Cl
and Cm are of these themselves; expected_error and estimated_error are the flow's own, of Cd.
"""

import argparse
import dataclasses
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np

from shapeopt.commands.arguments import (
    SINGLE_VALUED,
    add_family_arguments,
    add_incidence_argument,
    add_surrogate_argument,
    check_aspect,
    family_named,
    incidences_of,
)
from shapeopt.commands.cli import Parser, emit
from shapeopt.commands.newtons import (
    add_fluid_argument,
    conditions_of,
    force_entries,
    forces_line,
)
from shapeopt.commands.reference import (
    CHORD,
    add_reference_argument,
    add_reynolds_arguments,
    by_reference,
    check_reference,
    moment_record,
    moment_text,
    reference_line,
    reference_record,
    reynolds_of,
    unsteady_remark,
)
from shapeopt.commands.sweep import (
    add_sweep_arguments,
    check_converged,
    check_outputs,
    polar_title,
    write_table,
)
from shapeopt.commands.verification import compared_with_flow
from surrogate.body.parameters import INCIDENCE
from surrogate.body.shape import Shape, family_shape
from surrogate.compilation import compiled
from surrogate.errors import InvalidInput
from surrogate.files import JsonObject
from surrogate.flow.forces import Conditions
from surrogate.flow.loads import LOADS
from surrogate.model.evaluation import network_loads
from surrogate.model.store import load
from surrogate.model.surrogate import Surrogate
from surrogate.scene.limits import onset_of

ROUNDING = 1e-4  # of Cd, by which an error may exceed its bound without a word


def main(argv: Sequence[str] | None = None) -> JsonObject:
    """Parse the arguments, predict the loads and report them."""
    arguments = _parser().parse_args(argv)
    check_aspect(arguments)
    check_outputs(arguments.table, arguments.plot)
    surrogate, incidences = load(arguments.surrogate), incidences_of(arguments)
    check_reference(arguments.reference, surrogate.scene.dimension, arguments.moment_about)
    results = [
        row for incidence in incidences for row in _at_incidence(surrogate, arguments, incidence)
    ]
    if arguments.plot and len(results) < 2:
        raise InvalidInput("--plot: needs several values of --incidence or --reynolds")
    family = surrogate.scene.family
    if arguments.verify:
        bodies = [family.parameters(_named(arguments, row["incidence"])) for row in results]
        results = compared_with_flow(surrogate, bodies, results)
    if arguments.table:
        write_table(results, arguments.table)
    if arguments.plot:
        _plot(arguments, results)
    result = {
        "results": results,
        "surrogate": arguments.surrogate,
        "method": surrogate.recorded("method"),
        "warning": surrogate.inaccuracy,
        "drag_error_mean": surrogate.recorded("drag_error_mean"),
        "parameters": family.named(family.parameters(_named(arguments, incidences[0]))),
    }
    if len(incidences) > 1:
        result["parameters"].pop(INCIDENCE.name, None)  # in each row
    lifting = any(row["cl"] or row["cm"] or row["incidence"] for row in results)
    lines = [reference_line(results[0]), *(_line(row, lifting) for row in results)]
    if any(row["cd_error_bound"] is not None for row in results):
        lines.append(f"+-: bounds for {100 * surrogate.bound_coverage:.0f} % of bodies")
    emit(result, arguments.json, "\n".join(lines))
    if arguments.verify:
        check_converged(results)
    return result


def _plot(arguments: argparse.Namespace, rows: list[JsonObject]) -> None:
    """Plot the polar, with the bounds of the surrogate's errors as bars."""
    from shapeopt.render.polar import ERRORS, plot_polar  # matplotlib takes half a second to import

    bars = dict(zip(ERRORS.values(), (f"{load}_error_bound" for load in LOADS), strict=True))
    known = [row | {bar: row[bound] for bar, bound in bars.items()} for row in rows]
    plot_polar(known, polar_title(arguments, rows[0]), arguments.plot)


def _named(arguments: argparse.Namespace, incidence: float) -> dict[str, float]:
    """Return the body's parameters by name, its incidence too unless it is 0."""
    named = family_named(arguments, SINGLE_VALUED)
    return named | {INCIDENCE.name: incidence} if incidence else named


def _at_incidence(
    surrogate: Surrogate, arguments: argparse.Namespace, incidence: float
) -> list[JsonObject]:
    """Return the rows of the body at one incidence, for every Re."""
    family, named = surrogate.scene.family, _named(arguments, incidence)
    shape = family_shape(named, dimension=family.dimension)  # refuses what is no body
    parameters, onset, rows = family.parameters(named), onset_of(shape), []
    conditions = conditions_of(arguments.fluid)
    for reynolds in reynolds_of(arguments, shape.chord, family.dimension):
        row = {
            "incidence": incidence,
            **_predict(surrogate, shape, parameters, reynolds, arguments),
            "onset": onset,
        }
        if conditions is not None:
            row |= _forces(surrogate, parameters, reynolds, conditions)
        rows.append(row)
    return rows


def _predict(
    surrogate: Surrogate,
    shape: Shape,
    parameters: np.ndarray,
    reynolds: float,
    arguments: argparse.Namespace,
) -> JsonObject:
    family, by = surrogate.scene.family, shape.chord if arguments.reference == CHORD else 1.0
    units = np.array([by, by, by**2])  # of the moment the square of the reference length
    by_diameter = surrogate.loads(parameters, reynolds, extrapolate=arguments.extrapolate).tolist()
    row = reference_record(reynolds, shape, arguments.reference)
    row |= dict(zip(LOADS, by_diameter, strict=True))
    row |= moment_record(shape, arguments.moment_about, *by_diameter)
    at = jnp.asarray(parameters, float), jnp.asarray(reynolds, float)
    by_body, by_re = _jacobian(surrogate.network, *at)
    gradients = {
        load: family.named(row) | {"reynolds": slope}
        for load, row, slope in zip(LOADS, np.asarray(by_body), by_re.tolist(), strict=True)
    }
    row |= {"glide": row["cl"] / row["cd"]}
    row |= {"gradient": gradients if family.has_lift else gradients["cd"]}
    outside = surrogate.outside(parameters, reynolds)
    confidence = "inside"
    if outside:
        worst = max(outside, key=outside.__getitem__)
        confidence = f"outside: {worst} by {outside[worst]:.2g} of its trained range"
    return {
        **by_reference(row, shape),
        **_error_bounds(surrogate, parameters, reynolds, by_diameter[0] / units, bool(outside)),
        "in_trained_range": not outside,
        "confidence": confidence,
    }


def _forces(
    surrogate: Surrogate, parameters: np.ndarray, reynolds: float, conditions: Conditions
) -> JsonObject:
    """Return the entries of a row for the forces in newtons."""
    given = dataclasses.asdict(conditions)
    forces = surrogate.forces(parameters, reynolds, extrapolate=True, **given)
    return force_entries(forces, conditions, reynolds, surrogate.scene.dimension)


@compiled()
def _jacobian(network, parameters, reynolds):
    """Return the derivatives of a body's loads by its parameters and by U D / nu."""
    return jax.jacrev(network_loads, argnums=(1, 2))(network, parameters, reynolds)


def _error_bounds(
    surrogate: Surrogate,
    parameters: np.ndarray,
    reynolds: float,
    drags: np.ndarray,
    outside: bool,
) -> JsonObject:
    """Return bounds of 95 % of the errors, of Cd relative, of Cl and Cm of these themselves.

    They are null outside the ranges, where none are known. ``drags`` are Cd in the units of each
    load.
    """
    keys = [f"{load}_error_bound" for load in LOADS]
    if outside or "drag_error_scale" not in surrogate.record:
        return dict.fromkeys(keys)
    bounds = surrogate.error_bounds(parameters, reynolds) * [1.0, *drags[1:]]
    return dict(zip(keys, bounds.tolist(), strict=True))


def _line(r: JsonObject, lifts: bool) -> str:
    """Return a row as text, with incidence, Cl and Cm if any row has them."""
    turned = f"incidence {r['incidence']:<5g} " if lifts else ""
    known = r["cd_error_bound"] is not None
    bounds = {load: f" +- {r[f'{load}_error_bound']:.2g}" if known else "" for load in LOADS}
    if known:
        bounds["cd"] = f" +- {100 * r['cd_error_bound']:.2g} %"
    loads = [load for load in LOADS if lifts or load == "cd"]
    words = (f"{load.capitalize()} {r[load]:.4f}{bounds[load]}" for load in loads)
    line = f"{turned}Re {r['reynolds']:<8g} {'  '.join(words)}  {moment_text(r)}".rstrip()
    if not r.get("converged", True):
        line += "  the flow did not converge"
    elif "cd_flow" in r:
        line += f"  by the flow {r['cd_flow']:.4f}"
        line += f", {r['cl_flow']:.4f}, {r['cm_flow']:.4f}" if lifts else ""
        line += f", which {r['accuracy']}"
        line += f", error {100 * r['cd_error']:.3f} %"
        line += f", of Cl {r['cl_error']:.2g}, of Cm {r['cm_error']:.2g}" if lifts else ""
        line += _excess_words(r, lifts)
    line += "" if r["in_trained_range"] else f"  ({r['confidence']})"
    line += f"\n  {unsteady_remark(r)}" if r["reynolds"] > r["onset"] else ""
    return line + (f"\n  {forces_line(r)}" if "forces_N" in r else "")


def _excess_words(r: JsonObject, lifts: bool) -> str:
    """Say which errors of a row exceed their bounds; empty where none does."""
    if r["cd_error_bound"] is None:
        return ""
    excess = {"Cd": r["cd_error"] - r["cd_error_bound"]}
    for name in ("cl", "cm") if lifts else ():
        excess[name.capitalize()] = (r[f"{name}_error"] - r[f"{name}_error_bound"]) / r["cd"]
    found = [symbol for symbol, by in excess.items() if by > ROUNDING]
    return f"; of {', '.join(found)} more than the bound" if found else ""


def _parser() -> Parser:
    parser = Parser(__doc__)
    add_surrogate_argument(parser)
    add_family_arguments(parser, SINGLE_VALUED)
    add_incidence_argument(parser)
    add_reynolds_arguments(parser)
    add_reference_argument(parser)
    add_fluid_argument(parser)
    beyond = "answer outside the trained ranges too"
    parser.add_argument("--extrapolate", action="store_true", help=beyond)
    beside = "solve the flow too, also beyond the estimated onset of instability, and compare"
    parser.add_argument("--verify", action="store_true", help=beside)
    add_sweep_arguments(parser)
    return parser
