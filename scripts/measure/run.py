"""Measure one study: keep its record in results/, draw its picture, print its tables.

python scripts/measure/run.py flow
python scripts/measure/run.py onset --tiny --out out/tiny

An interrupted study is resumed by the same command at the first case that was not measured.
"""

import contextlib
import datetime
import functools
import importlib
import importlib.metadata
import json
import os
import platform
import re
import shlex
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import jax
from study import Result, Row, Run, Study, Table, Unavailable, plain

from shapeopt.commands.cli import Parser, emit, run
from surrogate import InvalidInput
from surrogate.files import make_folder, whole_file
from surrogate.progress import progress_bar
from surrogate.versions import versions

HERE = Path(__file__).parent
RESULTS = HERE / "results"
PICTURES = HERE.parents[1] / ".pictures"  # of the results that the project keeps
MODULES = {  # the studies of every module
    "accelerator": "accelerator",
    "accuracy": "flow gradients precision march",
    "accuracy_3d": "flow_3d corners extrapolated",
    "compilation": "compilation",
    "confidence": "confidence",
    "constants": "constants",
    "designs": "designs scenarios foreseen",
    "devices": "devices trainings_on_devices",
    "dimension": "dimension",
    "exports": "exports",
    "extremes": "extremes extremes_lift",
    "falls": "falls swings",
    "far_field": "far_field",
    "fit_memory": "fit_memory",
    "harmonics": "harmonics",
    "incidence": "incidence incidence_elements elements_in_space",
    "infill": "infill",
    "lift": "lift",
    "lift_cost": "lift_cost",
    "lift_designs": "lift_designs",
    "lift_methods": "lift_methods particle_methods lift_trainings particle_trainings",
    "literature": "literature",
    "low_reynolds": "low_reynolds",
    "machines": "shards streams",
    "methods": "seeds safeguards stability hig",
    "onset": "onset",
    "onset_2d": "onset_2d",
    "onset_incidence": "onset_incidence",
    "optima": "least",
    "particle": "particle",
    "particle_codes": "particle_codes",
    "particle_designs": "particle_designs",
    "random_sections": "random_sections",
    "section_designs": "section_designs",
    "settling": "settling",
    "speed": "speed network",
    "speed_3d": "space_speed space_rival",
    "three_loads": "three_loads three_loads_lift",
    "torque": "torque",
    "training": "training training_space",
    "trust": "trust trust_space",
    "wide_bodies": "wide_bodies",
}
NAMES = {name: module for module, names in MODULES.items() for name in names.split()}
OPTIONAL = ("pyvista", "scikit-learn", "ngsolve")  # recorded where they are installed


def load_study(name: str) -> Study:
    """Return the study of this name.

    Raises:
      InvalidInput: There is none.
    """
    if name not in NAMES:
        raise InvalidInput(f"study {name!r}: one of {', '.join(sorted(NAMES))}")
    return importlib.import_module(f"studies.{NAMES[name]}").STUDIES[name]


def main(argv: Sequence[str] | None = None) -> Result:
    """Run a study, and return its record."""
    argv = sys.argv[1:] if argv is None else argv
    study = load_study(argv[0]) if argv and not argv[0].startswith("-") else Study(())
    parser = Parser(__doc__)
    parser.add_argument("study", choices=NAMES, metavar="STUDY", help=", ".join(sorted(NAMES)))
    parser.add_argument("--tiny", action="store_true", help="seconds long; numbers mean nothing")
    parser.add_argument("--out", type=Path, default=RESULTS, help="folder of the record")
    for flag, settings in study.options.items():
        parser.add_argument(flag, **settings)
    options = vars(parser.parse_args(argv))
    name, tiny, out, as_json = (options.pop(key) for key in ("study", "tiny", "out", "json"))
    make_folder(out)
    command = shlex.join(["python", "scripts/measure/run.py", *argv])
    checkpoint = Checkpoint(out / f".{name}.json", {"command": command, "versions": versions()})
    with contextlib.ExitStack() as stack:  # the bar appears when the study first speaks
        bar = functools.cache(lambda: stack.enter_context(progress_bar(name)))
        scale = Run(tiny, options, lambda done, state="": bar()(done, state))
        result, seconds = measure(study, scale, checkpoint)
    record = keep(name, result, command, seconds, out)
    checkpoint.path.unlink(missing_ok=True)
    if study.draw:
        folder = PICTURES if out.resolve() == RESULTS else out
        study.draw(record["result"], folder / f"{name}.png")
    return emit(record, as_json, study.markdown(record["result"]))


class Checkpoint:
    """The rows and seconds of the cases measured so far, in a file until the record is written.

    A file with another ``head`` is of another command or other versions, and is replaced. Cases
    that lacked a package are measured again.
    """

    def __init__(self, path: Path, head: Row):
        self.path, self.head, self.cases = path, head, []
        if path.is_file() and (found := json.loads(path.read_text()))["head"] == head:
            self.cases = found["cases"]

    def lacks(self, k: int) -> bool:
        """Return whether case ``k`` is to be measured."""
        return k >= len(self.cases) or "unavailable" in self.cases[k]

    def put(self, k: int, case: Row) -> None:
        """Add case ``k``, the next one at most, or replace it, and write the file."""
        self.cases[k : k + 1] = [case]
        with whole_file(self.path) as part:
            part.write_text(json.dumps({"head": self.head, "cases": self.cases}))


def measure(study: Study, run: Run, checkpoint: Checkpoint) -> tuple[Result, float]:
    """Measure every case of every table, and return the result and the seconds that it took."""
    jobs = [(table, case) for table in study.tables for case in table.chosen(run)]
    for k, (table, case) in enumerate(jobs):
        if not checkpoint.lacks(k):
            continue
        shown = [f"{x:g}" if isinstance(x, float) else x for x in case.values()]
        run.progress(k / len(jobs), ", ".join(str(x) for x in shown if isinstance(x, str | int)))
        checkpoint.put(k, _measured(run, table, case))
    result: Result = {table.key: [] for table in study.tables}
    for (table, _), case in zip(jobs, checkpoint.cases, strict=True):
        result[table.key] += case["rows"]
        result |= {"unavailable": case["unavailable"]} if "unavailable" in case else {}
    start, seconds = time.perf_counter(), sum(case["seconds"] for case in checkpoint.cases)
    result |= study.extra(run, result)
    return result, seconds + time.perf_counter() - start


def _measured(run: Run, table: Table, case: Row) -> Row:
    """Rows and seconds of one case; without an optional package nothing of it is measured."""
    start = time.perf_counter()
    try:
        found = {"rows": table.rows(run, case)}
    except Unavailable as reason:
        found = {"rows": [], "unavailable": str(reason)}
    return found | {"seconds": time.perf_counter() - start}


def keep(
    name: str, result: Result, command: str, seconds: float | None = None, out: Path = RESULTS
) -> Result:
    """Write a result with its command, versions, machine and date to ``out/name.json``.

    Args:
      name: Of the study.
      result: Of the study.
      command: That measured it.
      seconds: That it took, if known.
      out: Folder.

    Returns:
      The record, as in the file.
    """
    installed = {one.name: one.version for one in importlib.metadata.distributions()}
    optional = {package: installed[package] for package in OPTIONAL if package in installed}
    record = plain(
        {
            "command": command,
            "versions": versions() | {"python": platform.python_version()} | optional,
            "machine": _machine(),
            "date": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
            "seconds": seconds,
            "result": result,
        }
    )
    with whole_file(Path(out) / f"{name}.json") as part:
        part.write_text(json.dumps(record, indent=1, allow_nan=False) + "\n")
    return record


def recorded(name: str) -> Result:
    """Return the result of a study from its record."""
    return json.loads((RESULTS / f"{name}.json").read_text())["result"]


def _machine() -> Row:
    """Processor, cores, memory, system; and the accelerator, where JAX uses one."""
    listing, device = Path("/proc/cpuinfo"), jax.devices()[0]
    known = listing.read_text() if listing.is_file() else ""
    named = re.search(r"model name\s*: (.*)", known)
    return {
        "processor": named[1] if named else platform.machine(),
        "avx512": " avx512f " in known,
        "cores": os.cpu_count(),
        "memory_gib": round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30, 1),
        "system": f"{platform.system()} {platform.machine()}",
        "accelerator": None if device.platform == "cpu" else device.device_kind,
    }


if __name__ == "__main__":
    sys.exit(run(main))
