"""What all studies share: one way to run, to keep a result with how it came about, to tell it."""

import contextlib
import dataclasses
import datetime
import functools
import importlib.metadata
import importlib.util
import json
import math
import os
import platform
import re
import shlex
import socket
import string
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np
from jax.experimental.compilation_cache import compilation_cache

from shapeopt.commands.cli import Parser, emit, run
from shapeopt.render.tables import markdown
from surrogate import Fidelity, InvalidInput
from surrogate.files import make_folder, whole_file
from surrogate.progress import progress_bar
from surrogate.versions import versions

RESULTS = Path(__file__).parent / "results"
PICTURES = Path(__file__).parents[2] / ".pictures"  # of the results that the project keeps
BESIDES = ("pyvista", "scikit-learn", "ngsolve")  # their versions are kept where they are installed
TINY = Fidelity("tiny", 8, 2.5, 4, 4, 5)  # of tiny measurements: real in every part
Result = dict[str, Any]


@dataclasses.dataclass(frozen=True)
class Study:
    """One thing that is measured.

    ``measure(tiny, progress, **options)`` answers in numbers, arrays and texts; ``tiny`` takes
    seconds, for tests. ``tables(result)`` is their Markdown, ``draw(result, path)`` their picture;
    ``options`` are flags of its own, with argparse's settings.
    """

    name: str
    measure: Callable[..., Result]
    tables: Callable[[Result], str]
    draw: Callable[[Result, Path], Any] | None = None
    options: Mapping[str, dict[str, Any]] = dataclasses.field(default_factory=dict)


def run_study(study: Study) -> int:
    """Run a study as a command; its exit status."""
    return run(functools.partial(carry_out, study))


def carry_out(study: Study, argv: Sequence[str] | None = None) -> Result:
    """Measure, keep the record and the picture, print the tables."""
    argv = sys.argv[1:] if argv is None else argv
    parser = Parser(sys.modules[study.measure.__module__].__doc__)
    parser.add_argument("--tiny", action="store_true", help="so small that numbers mean nothing")
    parser.add_argument("--out", type=Path, default=RESULTS, help="folder of the record")
    for flag, settings in study.options.items():
        parser.add_argument(flag, **settings)
    chosen = vars(parser.parse_args(argv))
    tiny, out, as_json = (chosen.pop(name) for name in ("tiny", "out", "json"))
    make_folder(out)
    start = time.perf_counter()
    with contextlib.ExitStack() as stack:  # the bar appears when the study first speaks
        bar = functools.cache(lambda: stack.enter_context(progress_bar(study.name)))
        result = study.measure(tiny, lambda done, state="": bar()(done, state), **chosen)
    command = shlex.join(["python", f"scripts/measure/{study.name}.py", *argv])
    record = keep(study.name, result, command, time.perf_counter() - start, out)
    if study.draw:
        kept_here = out.resolve() == RESULTS
        study.draw(record["result"], (PICTURES if kept_here else out) / f"{study.name}.png")
    return emit(record, as_json, study.tables(record["result"]))


def keep(
    name: str, result: Result, command: str, seconds: float | None = None, out: Path = RESULTS
) -> Result:
    """Write a result with how it came about, whole, to ``out/name.json``; the record."""
    installed = importlib.metadata.distributions()
    besides = {one.name: one.version for one in installed if one.name in BESIDES}
    record = plain(
        {
            "command": command,
            "versions": versions() | {"python": platform.python_version()} | besides,
            "machine": _machine(),
            "date": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
            "seconds": seconds,
            "result": result,
        }
    )
    with whole_file(Path(out) / f"{name}.json") as part:
        part.write_text(json.dumps(record, indent=1, allow_nan=False) + "\n")
    return record


def has_ngsolve() -> bool:
    """Whether the package of the finite elements is installed."""
    return importlib.util.find_spec("ngsolve") is not None


def ngsolve() -> Any:
    """The package of the finite elements.

    Raises:
      InvalidInput: it is not installed.
    """
    try:
        return importlib.import_module("ngsolve")
    except ImportError:
        raise InvalidInput("the rival needs NGSolve: pip install -e '.[bench]'") from None


ACCELERATOR = {"choices": ["gpu", "cpu"], "help": "measure there; cpu tries the same script"}


def platform_of(accelerator: str | None) -> dict[str, str]:
    """Environment in which JAX works there, or on the processor; told by a process of its own.

    Raises:
      InvalidInput: there is no such accelerator.
    """
    if accelerator != "gpu":
        return {"JAX_PLATFORMS": "cpu"}
    ask = [sys.executable, "-c", "import jax; print(jax.default_backend())"]
    if (found := subprocess.run(ask, capture_output=True, text=True).stdout.strip()) != "gpu":
        raise InvalidInput(f"--accelerator gpu: JAX finds {found or 'nothing'} alone")
    return {}


def free_port() -> int:
    """Of this machine, for processes that are to find each other."""
    with socket.socket() as probe:
        probe.bind(("localhost", 0))
        return probe.getsockname()[1]


def plain(value: Any) -> Any:
    """The same as JSON takes it; what is no finite number is None."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, np.ndarray | np.generic | jax.Array):
        return plain(value.tolist())
    return None if isinstance(value, float) and not math.isfinite(value) else value


class Words(string.Formatter):
    """Format strings, in which what is missing is a dash and a per cent sign stands off."""

    def format_field(self, value: Any, spec: str) -> str:
        if value is None:
            return "-"
        if spec.endswith("%"):
            return f"{100 * value:{spec[:-1]}f} %"
        return super().format_field(value, spec)


def words(form: str, **values: Any) -> str:
    """``form`` filled in."""
    return Words().vformat(form, (), values)


def table(rows: Sequence[Mapping[str, Any]], heads: str, forms: str) -> str:
    """Markdown of rows; heads and format strings are divided by |."""
    lines = [[words(form.strip(), **row) for form in forms.split("|")] for row in rows]
    return markdown([head.strip() for head in heads.split("|")], lines)


def table_of_rows(heads: str, forms: str) -> Callable[[Result], str]:
    """As ``tables`` of a study whose result has ``rows``."""
    return lambda result: table(result["rows"], heads, forms)


def medians(calls: Sequence[Callable[[], Any]], repeats: int = 7) -> list[float]:
    """Median seconds of every call, compilation left out.

    Taken in turns, so that a busy machine hurts all alike.
    """
    seconds = np.zeros((repeats + 1, len(calls)))
    for row in seconds:
        for k, call in enumerate(calls):
            start = time.perf_counter()
            jax.block_until_ready(call())
            row[k] = time.perf_counter() - start
    return np.median(seconds[1:], axis=0).tolist()


@contextlib.contextmanager
def cold_cache() -> Iterator[None]:
    """What was compiled before is not found, and nothing is kept."""
    before = jax.config.jax_enable_compilation_cache
    jax.config.update("jax_enable_compilation_cache", False)
    compilation_cache.reset_cache()
    try:
        yield
    finally:
        jax.config.update("jax_enable_compilation_cache", before)
        compilation_cache.reset_cache()


def megabytes(compiled: Any) -> float:
    """Memory of a compiled call, its answers included."""
    memory = compiled.memory_analysis()
    return (memory.temp_size_in_bytes + memory.output_size_in_bytes) / 1e6


def power_of(rows: Sequence[Mapping[str, Any]], x: str, y: str) -> float | None:
    """Of x, with which |y| goes, fitted; one row alone does not tell."""
    logs = np.log([[row[x], abs(row[y])] for row in rows]).T
    return float(np.polyfit(*logs, 1)[0]) if len(rows) > 1 else None


def _machine():
    """Processor, cores, memory, system; and the accelerator, where JAX uses one."""
    listing, device = Path("/proc/cpuinfo"), jax.devices()[0]
    named = re.search(r"model name\s*: (.*)", listing.read_text() if listing.is_file() else "")
    return {
        "processor": named[1] if named else platform.machine(),
        "cores": os.cpu_count(),
        "memory_gib": round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30, 1),
        "system": f"{platform.system()} {platform.machine()}",
        "accelerator": None if device.platform == "cpu" else device.device_kind,
    }
