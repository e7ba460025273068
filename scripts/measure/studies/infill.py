"""Whether further samples where a surrogate knows least buy more than further random samples."""

import dataclasses
import functools
from pathlib import Path

import numpy as np
from study import TINY, Result, Row, Run, Study, Table, cases, columns, values, words

from surrogate import Scene, Surrogate, train
from surrogate.model.outputs import LOAD_NAMES

SCRIPTS = Path(__file__).parents[2]
SYMMETRIC, LIFTING = "symmetric bodies, Re 1 to 40", "sections of lift.toml, 8 cells per D"
CELLS = 8  # of the sections, in place of the scene's: a fifth of the time
FIRST, MORE, HELD_OUT = 64, 32, 128  # samples at first and added, and held-out bodies
KINDS = ("none added", "Sobol sequence", "infill")


def scene_of(name: str, tiny: bool) -> Scene:
    """Return a scene by its name in the table."""
    scene = Scene(reynolds=(1, 40)) if name == SYMMETRIC else Scene.read(SCRIPTS / "lift.toml")
    if name == LIFTING:
        level = dataclasses.replace(scene.fidelity, cells=CELLS)
        scene = dataclasses.replace(scene, fidelity=level)
    return dataclasses.replace(scene, fidelity=TINY) if tiny else scene


@functools.lru_cache(maxsize=2)
def trained(name: str, added: str, seed: int, tiny: bool) -> Surrogate:
    """Return a surrogate trained by regression on the first samples, and on those added.

    Args:
      name: of the scene.
      added: one of ``KINDS``.
      seed: of the training.
      tiny: Whether the run is tiny.
    """
    first, more, held_out = (8, 4, 4) if tiny else (FIRST, MORE, HELD_OUT)
    samples = first if added == KINDS[0] else first + more
    start = trained(name, KINDS[0], seed, tiny) if added == "infill" else None
    options = {"samples": samples, "held_out": held_out, "seed": seed, "infill_from": start}
    return train(scene_of(name, tiny), "supervised", progress=False, **options)


def measure(run: Run, scene: str, seed: int, added: str) -> Row:
    """Return the errors of a training over Cd on held-out bodies.

    Args:
      run: How the study is run.
      scene: Its name.
      seed: Of the training.
      added: Which samples were added to the first.
    """
    record = trained(scene, added, seed, run.tiny).record
    keys = [f"{load}_error_{kind}" for load in LOAD_NAMES for kind in ("mean", "p95", "max")]
    return {"samples": record["samples"]} | {key: record.get(key) for key in keys}


def text(result: Result) -> str:
    """Return a sentence for each scene on the errors of Cd with either kind of added samples."""
    form = (
        "Of {scene}, {samples} samples err in Cd by {sobol[0]:.3%} on average and {sobol[1]:.2%} "
        "at most where the last ones go on with the sequence, by {infill[0]:.3%} and "
        "{infill[1]:.2%} where they are infill (means over the seeds)."
    )
    texts = []
    for scene in values(result["rows"], "scene"):
        mine = [row for row in result["rows"] if row["scene"] == scene]
        sobol, infill = (_means(mine, kind) for kind in KINDS[1:])
        samples = max(row["samples"] for row in mine)
        texts.append(words(form, scene=scene, samples=samples, sobol=sobol, infill=infill))
    return "\n\n".join(texts)


def _means(rows, added):
    """Mean and largest error of Cd, averaged over the seeds; dashes where none was measured."""
    rows = [row for row in rows if row["added"] == added]
    keys = ("drag_error_mean", "drag_error_max")
    return [np.mean([row[key] for row in rows]) if rows else None for key in keys]


COLUMNS = columns(
    "scene {scene} | seed {seed} | added {added} | samples {samples}"
    " | error of Cd: mean {drag_error_mean:.3%} | 95 % below {drag_error_p95:.3%}"
    " | largest {drag_error_max:.2%}"
    " | of Cl over Cd: mean {lift_error_mean:.3%} | 95 % below {lift_error_p95:.3%}"
    " | largest {lift_error_max:.2%}"
    " | of Cm over Cd: mean {moment_error_mean:.3%} | 95 % below {moment_error_p95:.3%}"
    " | largest {moment_error_max:.2%}"
)
CASES = cases(scene=(SYMMETRIC,), seed=(0, 1, 2), added=KINDS)
CASES += cases(scene=(LIFTING,), seed=(0,), added=KINDS)
STUDIES = {"infill": Study([Table(CASES, measure, COLUMNS, tiny="last")], text)}
