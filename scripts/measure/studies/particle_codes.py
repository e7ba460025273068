"""Answers a second of the correlations of particle codes, in C as the exported surrogates are."""

import ctypes
import itertools
import os
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import correlations_at_incidence
import numpy as np
from correlations import bagheri_bonadonna, ellipsoid
from correlations_at_incidence import Inclined
from studies.exports import FEW, MANY, compile_c
from study import Result, Row, Run, Study, Table, cases, columns
from tools import medians

SOURCE = Path(__file__).parents[1] / "correlations.c"
FORMULAS = ("froehlich", "zastawny", "hoelzer_sommerfeld", "ganser", "bagheri_bonadonna")
BY_SPHERICITY = ("hoelzer_sommerfeld", "ganser")
KINDS = {"double": (np.float64, "double"), "single": (np.float32, "float")}
RANGES = np.array([[1.05, 4], [1, 1], [0, 0], [0, 90], [1, 100]])  # of prolate spheroids, and Re


def measure(run: Run, correlation: str, precision: str) -> Row:
    """Return the answers per second, and the largest difference of Cd from that in Python."""
    dtype, real = KINDS[precision]
    few = RANGES[:, 0] + np.ptp(RANGES, axis=1) * np.random.default_rng(0).random((FEW, 5))
    if correlation == "zastawny":
        few[:, 0] = np.resize(list(correlations_at_incidence.ZASTAWNY), FEW)
    known = [few]
    if correlation in BY_SPHERICITY:
        known.append(np.array([1 / ellipsoid(*body[:2]).surface for body in few]))
    repeats = run.pick(1, MANY // FEW)
    arrays = [np.concatenate([values.astype(dtype)] * repeats) for values in known]
    with tempfile.TemporaryDirectory() as folder:
        function = getattr(compile_c(SOURCE, Path(folder), f"-DREAL={real}"), correlation)

        def evaluate(part: slice) -> np.ndarray:
            given = [values[part] for values in arrays]
            loads = np.empty((len(given[0]), 3), dtype)
            pointers = (values.ctypes.data_as(ctypes.c_void_p) for values in (*given, loads))
            function(ctypes.c_size_t(len(loads)), *pointers)
            return loads

        size, cores = len(arrays[0]), os.cpu_count() or 1
        ends = np.linspace(0, size, cores + 1).astype(int)
        parts = [slice(a, b) for a, b in itertools.pairwise(ends.tolist())]
        one = medians([lambda: evaluate(slice(size))], run.pick(1, 3))[0]
        with ThreadPoolExecutor(cores) as pool:
            both = medians([lambda: list(pool.map(evaluate, parts))], run.pick(1, 3))[0]
        found = evaluate(slice(FEW))[:, 0]
    right = np.array([_drag(correlation, *body.tolist()) for body in few])
    difference = float(np.abs(found / right - 1).max())
    return {"one_core": size / one, "all_cores": size / both, "difference": difference}


def _drag(correlation, aspect, flatness, beta2, incidence, reynolds):
    """Return Cd by a correlation in Python; Bagheri and Bonadonna's is of random orientations."""
    if correlation == "bagheri_bonadonna":
        return bagheri_bonadonna(ellipsoid(aspect, flatness), reynolds)
    body = Inclined(aspect, flatness, beta2, incidence)
    return getattr(correlations_at_incidence, correlation)(body, reynolds).cd


def text(result: Result) -> str:
    """Return a paragraph on what was called."""
    return (
        f"{MANY:,} prolate spheroids in one call, a thousand different ones, Zastawny's of the two "
        "aspects that it has. All but Froehlich's are of the drag alone; Hoelzer and Sommerfeld's "
        "and Ganser's are given each body's sphericity, and Bagheri and Bonadonna's is the mean "
        "over random orientations."
    )


COLUMNS = columns(
    "correlation {correlation} | numbers {precision} | answers/s, one core {one_core:,.0f}"
    " | all cores {all_cores:,.0f} | Cd differs from that in Python by {difference:.0e}"
)
CASES = cases(correlation=FORMULAS, precision=tuple(KINDS))
STUDIES = {"particle_codes": Study([Table(CASES, measure, COLUMNS, tiny="all")], text)}
