"""The bodies whose critical Re study ``onset_2d`` finds; some of them the rule is fitted to."""

import functools
from collections.abc import Mapping
from typing import Any

from study import Row
from tools import name_of

from surrogate import Family, Scene, Shape, contour_shape, family_shape, naca4
from surrogate.scene.samples import training_samples

FITTED: tuple[dict[str, Any], ...] = (
    {"aspect": 1.0},
    {"aspect": 0.5},
    {"aspect": 2.0},
    {"aspect": 3.0, "incidence": 15.0},
    {"aspect": 6.0, "incidence": 30.0},
    {"aspect": 1.5, "beta2": 0.25},
    {"aspect": 2.0, "gamma2": 0.3},
    {"aspect": 1.0, "beta3": 0.15},
    {"aspect": 0.3},
    {"aspect": 3.0},
    {"aspect": 2.0, "incidence": 20.0},
    {"aspect": 4.0, "incidence": 10.0},
    {"aspect": 1.5, "beta2": -0.25},
    {"aspect": 3.0, "gamma3": 0.2, "incidence": 10.0},
    {"aspect": 3.0, "beta2": -0.15, "beta4": 0.08},
    {"section": "0012", "incidence": 10.0},
    {"aspect": 4.0},
    {"section": "0012", "incidence": 15.0},
    {"aspect": 2.5, "beta3": 0.15, "incidence": 5.0},
    {"aspect": 3.0, "beta2": 0.25, "beta3": -0.08, "beta4": 0.05},
    {"aspect": 2.0, "gamma2": 0.5},
    {"aspect": 3.0, "gamma2": 0.5, "incidence": 4.0},
    {"aspect": 3.5, "beta3": -0.1, "gamma2": 0.4, "gamma3": 0.1, "incidence": 10.0},
    {"aspect": 6.0, "gamma2": 0.4, "incidence": 15.0},
    {"aspect": 5.0, "beta2": 0.2, "gamma2": 0.3, "gamma3": 0.1, "incidence": 10.0},
    {"aspect": 6.0, "gamma2": 0.4, "incidence": 4.0},
    {"aspect": 5.0, "beta2": 0.3, "beta3": 0.1, "incidence": 12.0},
    {"aspect": 4.0, "beta2": 0.2, "gamma2": 0.3, "incidence": 10.0},
    {"aspect": 4.0, "gamma2": 0.4, "incidence": -10.0},
    {"aspect": 5.0, "gamma2": 0.3, "gamma3": -0.1, "incidence": 10.0},
    {"aspect": 2.5, "beta2": 0.2, "gamma2": 0.45, "gamma3": 0.1, "incidence": 5.0},
)
HELD_OUT: tuple[dict[str, Any], ...] = (
    {"aspect": 4.0, "incidence": 30.0},
    {"aspect": 2.0, "beta2": 0.2, "beta3": 0.1, "gamma2": 0.25, "incidence": 8.0},
    {"aspect": 0.6, "beta2": 0.2},
    {"aspect": 2.5},
    {"aspect": 6.0, "incidence": 15.0},
    {"aspect": 4.0, "beta2": 0.25, "gamma2": 0.2, "incidence": 20.0},
    {"aspect": 1.5, "beta3": -0.1},
    {"section": "2412", "incidence": 20.0},
    {"aspect": 1.2, "incidence": 30.0},
    {"aspect": 2.0, "beta2": -0.2, "beta3": 0.1},
    {"aspect": 1.5, "beta2": 0.15, "gamma2": 0.2, "gamma3": -0.1, "incidence": -10.0},
    {"aspect": 1.5, "gamma2": 0.5},
    {"aspect": 3.9, "gamma2": 0.5},
    {"aspect": 2.5, "gamma2": 0.4, "gamma3": -0.15, "incidence": 12.0},
    {"aspect": 5.0, "gamma2": 0.4, "incidence": 8.0},
    {"aspect": 4.5, "beta2": 0.15, "gamma2": 0.35, "gamma3": -0.1, "incidence": 14.0},
    {"aspect": 6.0, "beta2": 0.3, "beta3": 0.1, "gamma2": 0.25, "incidence": 12.0},
    {"aspect": 8.0, "gamma2": 0.3, "incidence": 8.0},
    {"aspect": 3.0, "gamma2": 0.3, "incidence": -4.0},
    {"aspect": 3.0, "beta2": -0.2, "gamma2": 0.3, "incidence": 10.0},
    {"aspect": 3.5, "gamma2": 0.2, "incidence": 12.0},
    {"aspect": 6.0, "beta2": 0.15, "gamma2": 0.15, "incidence": 8.0},
    {"aspect": 5.0, "gamma2": -0.2, "gamma3": 0.1, "incidence": 10.0},
)
AFTERWARDS: tuple[dict[str, Any], ...] = (  # long NACA sections, optima of study lift_designs
    {"section": "6409", "incidence": 10.0},
    {"section": "6409", "incidence": 5.0},
    {"section": "4412", "incidence": 5.0},
    {"aspect": 3.9, "beta2": -0.29, "beta3": 0.05, "beta4": 0.1, "gamma2": -0.2, "gamma3": 0.15}
    | {"incidence": 4.5},
    {"aspect": 2.8, "beta2": -0.3, "beta3": 0.15, "beta4": 0.1, "gamma2": -0.2, "gamma3": 0.15}
    | {"incidence": 7.5},
    {"aspect": 3.9, "beta2": 0.19, "beta3": 0.15, "beta4": -0.03, "gamma2": 0.5, "gamma3": -0.15}
    | {"incidence": 12.0},
)
LAST_CHOSEN: tuple[dict[str, Any], ...] = (  # a long section, a section for several lifts
    {"section": "4415", "incidence": 12.0},
    {"aspect": 3.9, "beta2": -0.1, "beta3": 0.08, "beta4": -0.06, "gamma2": -0.02, "gamma3": -0.02}
    | {"incidence": 12.0},
)
BEYOND: tuple[dict[str, Any], ...] = (  # wider than all that the rule is fitted to, or steeper
    {"aspect": 0.2},
    {"aspect": 3.0, "incidence": 75.0},
    {"aspect": 0.15},
    {"aspect": 5.0, "incidence": 60.0},
)
RANGES = {
    "aspect": (1.5, 6.0),
    "beta2": (-0.3, 0.3),
    "beta3": (-0.12, 0.15),
    "beta4": (-0.08, 0.08),
    "gamma2": (-0.2, 0.5),
    "gamma3": (-0.12, 0.12),
    "incidence": (-10.0, 20.0),
}
SEED, RANDOM, RANDOM_FITTED = 2816, 37, 13  # bodies drawn from the ranges; the first are fitted
RANDOM_AFTERWARDS = (25, 27, 29, 31, 33, 35, 36)  # of these, searched later than the others
LAST_SEED, LAST = 2817, 9  # bodies drawn after the form of the wake's estimate was chosen


@functools.cache
def cases() -> list[Row]:
    """Return the cases: names and parameters of all bodies, and whether the rule is fitted to them.

    That is None of bodies beyond those.
    """
    chosen = [(body, True) for body in FITTED] + [(body, False) for body in HELD_OUT]
    chosen += [(body, k < RANDOM_FITTED) for k, body in enumerate(random_bodies(SEED, RANDOM))]
    chosen += [(body, False) for body in (*AFTERWARDS, *last_bodies())]
    chosen += [(body, None) for body in BEYOND]
    return [
        {"body": name_of(body, ""), "parameters": body, "fitted": fitted} for body, fitted in chosen
    ]


@functools.cache
def unseen_bodies() -> dict[str, str]:
    """Return by name the bodies whose onset was found after a form was chosen, and which one.

    It is that of the outline's rule, or of the wake's estimate too.
    """
    bodies = random_bodies(SEED, RANDOM)
    later = [*(bodies[k] for k in RANDOM_AFTERWARDS), *AFTERWARDS]
    by_rule = {name_of(body, ""): "blind" for body in later}
    return by_rule | {name_of(body, ""): "blind, wake too" for body in last_bodies()}


def last_bodies() -> list[dict[str, Any]]:
    """Return the parameters of the bodies whose onset was found last."""
    return [*random_bodies(LAST_SEED, LAST), *LAST_CHOSEN]


def random_bodies(seed: int, count: int) -> list[dict[str, float]]:
    """Return the parameters of bodies drawn evenly from ``RANGES``, rounded."""
    family = Family(**RANGES)
    digits = {"aspect": 1, "incidence": 1}
    samples = training_samples(Scene(family=family), seed, count)
    return [
        {name: round(float(x), digits.get(name, 2)) + 0.0 for name, x in family.named(body).items()}
        for body in samples.parameters
    ]


def shape_of(parameters: Mapping[str, Any]) -> Shape:
    """Return the body of the family with these parameters, or the NACA section at incidence."""
    if "section" in parameters:
        return contour_shape(naca4(parameters["section"]), parameters["incidence"])
    return family_shape(parameters)
