"""Cd, Cl and Cm of random cambered sections at incidence against body-fitted finite elements."""

import functools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from studies.lift import LOADS_TEXT, OPTIONS, levels, measure
from study import Result, Row, Run, Study, Table, columns
from tools import LOADS, name_of

from surrogate import FIDELITIES, Family, Scene, family_shape
from surrogate.flow.check.error_estimate import LOAD_TOLERANCE, load_tolerances
from surrogate.scene.limits import onset_of
from surrogate.scene.samples import held_out_samples

LIFT = Path(__file__).parents[2] / "lift.toml"


class Draws(NamedTuple):
    """Random sections of a scene.

    Attributes:
      scene: Reads or makes the scene.
      seed: Of the random numbers. Constants were fitted to seeds 2811 to 2813.
      counts: How many sections are solved, by fidelity.
      beyond_onset: Whether sections whose Re is beyond their onset of instability are kept.
    """

    scene: Callable[[], Scene]
    seed: int
    counts: dict[str, int]
    beyond_onset: bool


def wide_scene() -> Scene:
    """Return a scene of longer and steeper sections than those of ``lift.toml``."""
    family = Family(
        aspect=(1.5, 6.0),
        beta2=(-0.2, 0.3),
        beta3=(-0.1, 0.15),
        beta4=(-0.05, 0.05),
        gamma2=(-0.2, 0.4),
        gamma3=(-0.1, 0.1),
        incidence=(-4.0, 15.0),
    )
    return Scene(reynolds=(1.0, 200.0), family=family)


DRAWS = {
    "lift.toml": Draws(lambda: Scene.read(LIFT), 2814, {"standard": 16, "fine": 4}, True),
    "wide": Draws(wide_scene, 2815, {"standard": 20, "fine": 6}, False),
}
CANDIDATES = 128  # sections among which those up to their onset are found


@functools.cache
def drawn(scene: str) -> list[tuple[dict[str, float], float]]:
    """Return random sections, their parameters by name, and the Re of each.

    Args:
      scene: Name of the draws.
    """
    draws = DRAWS[scene]
    ranges, most = draws.scene(), max(draws.counts.values())
    samples = held_out_samples(ranges, draws.seed, most if draws.beyond_onset else CANDIDATES)
    found = []
    for parameters, reynolds in zip(samples.parameters, samples.reynolds, strict=True):
        body = {n: round(x, 3) for n, x in ranges.family.named(parameters).items()}
        case = body, round(float(reynolds), 1)
        if draws.beyond_onset or case[1] <= onset_of(family_shape(body)):
            found.append(case)
    return found[:most]


def measure_drawn(run: Run, scene: str, draw: int, fidelity: str) -> Row:
    """Return a random section, its random Re, and its errors as ``lift.measure`` does.

    Args:
      run: How the study is run.
      scene: Name of the draws.
      draw: Number of the section.
      fidelity: Its name.
    """
    body, reynolds = drawn(scene)[draw]
    row: Row = {"body": name_of(body), "parameters": body, "reynolds": reynolds}
    return row | measure(run, body, reynolds, fidelity)


def with_onset(rows: Sequence[Row]) -> list[Row]:
    """Return rows with the onset of instability of each section, by the rule."""
    onsets = [onset_of(family_shape(row["parameters"])) for row in rows]
    return [row | {"onset": onset} for row, onset in zip(rows, onsets, strict=True)]


def steady(rows: Sequence[Row]) -> list[Row]:
    """Return those rows of ``with_onset`` whose Re is not beyond the onset of instability."""
    return [row for row in rows if row["reynolds"] <= row["onset"]]


def text(result: Result) -> str:
    """Return tables of every random section and of the fidelities, and sentences on both.

    The tables of fidelities are of the flows up to their onset of instability.
    """
    rows, wide = (with_onset(result[key]) for key in ("rows", "wide"))
    up_to_onset = steady(rows)
    return (
        f"{RANDOM(rows)}\n\n{levels(up_to_onset)}\n\n"
        f"{len(rows) - len(up_to_onset)} of the {len(rows)} flows are beyond the onset of "
        "instability, where `Flow` refuses them unless asked; the second table leaves them out. "
        f"{_trust(rows)}\n\nOver {_ranges()}:\n\n{RANDOM(wide)}\n\n{levels(wide)}\n\n{_trust(wide)}"
    )


def _trust(rows):
    """Return a sentence on how many of the flows called accurate exceed a tolerance."""
    called = [row for row in rows if row["status"] == "accurate"]
    return (
        f"Of {len(called)} flows that are called accurate {sum(map(_exceeds, called))} exceed the "
        f"tolerance of Cd or, {LOAD_TOLERANCE:g} times that, of Cl or Cm."
    )


def _exceeds(row):
    """Return whether a load errs by more than its tolerance."""
    tolerances = load_tolerances(FIDELITIES[row["fidelity"]].tolerance)
    pairs = zip(LOADS, tolerances, strict=True)
    return any(abs(row[f"{load}_error"]) > most for load, most in pairs)


def _ranges():
    """Return the ranges of the wide scene in words."""
    scene = wide_scene()
    ranges = [*scene.family.ranges, ("Re", scene.reynolds)]
    return ", ".join(f"{name} {low:g} to {high:g}" for name, (low, high) in ranges)


def _cases(scene):
    counts = DRAWS[scene].counts.items()
    return [
        {"scene": scene, "draw": k, "fidelity": level}
        for level, count in counts
        for k in range(count)
    ]


RANDOM = columns(f"body {{body}} | onset Re {{onset:.0f}} | Re {{reynolds:g}} | {LOADS_TEXT}")
TABLES = [
    Table(_cases("lift.toml"), measure_drawn),
    Table(_cases("wide"), measure_drawn, key="wide"),
]
STUDIES = {"random_sections": Study(TABLES, text, options=OPTIONS)}
