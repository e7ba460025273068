"""Seconds of the shipped surrogate of particles and of correlations, in C, for the same call."""

import ctypes
import itertools
import os
import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import correlations_at_incidence
import numpy as np
from correlations import bagheri_bonadonna, ellipsoid
from correlations_at_incidence import Inclined
from studies.exports import FEW, MANY, compile_c, in_c
from study import Result, Row, Run, Study, Table, cases, columns
from tools import medians

from surrogate import export, load
from surrogate.scene.samples import held_out_samples

SOURCE = Path(__file__).parents[1] / "correlations.c"
NAME = "pretrained:particle"
FORMULAS = ("froehlich", "zastawny", "hoelzer_sommerfeld", "ganser", "bagheri_bonadonna")
BY_SPHERICITY = ("hoelzer_sommerfeld", "ganser")
KINDS = {"double": (np.float64, "double"), "single": (np.float32, "float")}
Evaluate = Callable[[slice], np.ndarray]


def particles(name: str) -> np.ndarray:
    """Return ``FEW`` ellipsoids at incidence from the trained ranges, and their Re.

    Froehlich's correlation is given prolate spheroids and Re 1 for lower Re, Zastawny's its two
    spheroids.
    """
    net = load(NAME)
    samples = held_out_samples(net.scene, 3, FEW)
    few = np.column_stack([samples.parameters, samples.reynolds])
    few[:, 2] = 0.0  # beta2: correlations are for ellipsoids
    if name in ("froehlich", "zastawny"):
        few[:, 0] = np.maximum(few[:, 0], 1 / few[:, 0])
        few[:, 1] = 1.0
    if name == "froehlich":
        few[:, -1] = np.maximum(few[:, -1], 1.0)
    if name == "zastawny":
        few[:, 0] = np.resize(list(correlations_at_incidence.ZASTAWNY), FEW)
    return few


def measure(run: Run, name: str, precision: str) -> Row:
    """Return the seconds for the particles, and the largest difference of Cd from that in Python.

    Args:
      run: How the study is run.
      name: Of a correlation, or of the surrogate.
      precision: Of the numbers.
    """
    few, repeats = particles(name), run.pick(1, MANY // FEW)
    with tempfile.TemporaryDirectory() as folder:
        evaluate = _function(name, precision, few, repeats, Path(folder))
        size, cores = FEW * repeats, os.cpu_count() or 1
        ends = np.linspace(0, size, cores + 1).astype(int)
        parts = [slice(a, b) for a, b in itertools.pairwise(ends.tolist())]
        one = medians([lambda: evaluate(slice(size))], run.pick(1, 5))[0]
        with ThreadPoolExecutor(cores) as pool:
            both = medians([lambda: list(pool.map(evaluate, parts))], run.pick(1, 5))[0]
        found = evaluate(slice(FEW))[:, 0]
    right = _drags(name, few)
    difference = float(np.abs(found / right - 1).max())
    return {"one_core": one, "all_cores": both, "difference": difference}


def _function(name, precision, few, repeats, folder) -> Evaluate:
    """A compiled function of a slice of the particles, each repeated, that returns their loads."""
    dtype, real = KINDS[precision]
    known = [few]
    if name in BY_SPHERICITY:
        known.append(np.array([Inclined(*particle[:-1]).sphericity for particle in few]))
    arrays = [np.concatenate([values.astype(dtype)] * repeats) for values in known]
    if name == NAME:
        path = export(load(NAME), folder / "net.c", "c", precision=precision)
        loads_of = in_c(compile_c(path, folder), dtype, 3)
        return lambda part: loads_of(arrays[0][part])
    function = getattr(compile_c(SOURCE, folder, f"-DREAL={real}"), name)

    def evaluate(part: slice) -> np.ndarray:
        given = [values[part] for values in arrays]
        loads = np.empty((len(given[0]), 3), dtype)
        pointers = (values.ctypes.data_as(ctypes.c_void_p) for values in (*given, loads))
        function(ctypes.c_size_t(len(loads)), *pointers)
        return loads

    return evaluate


def _drags(name, particles):
    """Cd of all particles in Python; Bagheri and Bonadonna's is of random orientations."""
    if name == NAME:
        return np.asarray(load(NAME).drag(particles[:, :-1], particles[:, -1]))
    if name == "bagheri_bonadonna":
        return np.array([bagheri_bonadonna(ellipsoid(*p[:2]), p[-1]) for p in particles])
    correlation = getattr(correlations_at_incidence, name)
    return np.array([correlation(Inclined(*p[:-1]), p[-1]).cd for p in particles])


def text(result: Result) -> str:
    """Return a paragraph on what was called."""
    return (
        f"Seconds for {MANY:,} ellipsoids in one call, a thousand different ones of the trained "
        f"ranges of `{NAME}`; Froehlich's correlation is given prolate spheroids, at Re "
        "1 for lower Re, Zastawny's the two spheroids that it has. The surrogate and Froehlich's "
        "have all three loads, the others the drag alone; Hoelzer and Sommerfeld's and Ganser's "
        "are given each body's sphericity, and Bagheri and Bonadonna's is the mean over random "
        "orientations."
    )


COLUMNS = columns(
    "by {name} | numbers {precision} | seconds, one core {one_core:.2g} | all cores {all_cores:.2g}"
    " | Cd differs from that in Python by {difference:.0e}"
)
CASES = cases(name=(NAME, *FORMULAS), precision=tuple(KINDS))
STUDIES = {"particle_codes": Study([Table(CASES, measure, COLUMNS, tiny="all")], text)}
