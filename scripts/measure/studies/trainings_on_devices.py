"""What more devices bring to a whole training: its seconds, and whether the weights agree."""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from study import TINY, Result, Row, Run, Study, Table, columns
from tools import ACCELERATOR, platform_of

from surrogate import NotConverged, Scene, load

COMMAND = Path(__file__).parents[2] / "train_surrogate.py"


def cases(run: Run) -> Iterator[Row]:
    """Devices, cores that the process may use (all where None), and the accelerator."""
    yield {"way": "one device, all cores"}
    yield {"way": "one device, one core", "cores": 1}
    yield {"way": "two devices", "devices": 2}
    if accelerator := run.options["accelerator"]:
        yield {"way": "one accelerator", "accelerator": accelerator}


def measure(run, way, devices=1, cores=None, accelerator=None) -> Row:
    """HIG's full training in a process of its own, with nothing compiled before."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        scene, out = folder / "scene.toml", folder / "surrogate"
        Scene(fidelity=run.pick(TINY, "standard")).write(scene)
        argv = ["--method", "hig", "--scene", str(scene), "--devices", str(devices)]
        argv += run.pick(["--preset", "quick", "--samples", "8"], ["--preset", "full"])
        argv = [*_bound(cores), sys.executable, str(COMMAND), *argv, "--out", str(out), "--json"]
        cold = {"XDG_CACHE_HOME": str(folder / "compiled")} | platform_of(accelerator)
        start = time.perf_counter()
        done = subprocess.run(argv, capture_output=True, text=True, env=os.environ | cold)
        seconds = time.perf_counter() - start
        if done.returncode:
            raise NotConverged(f"{way}: {done.stderr.strip().splitlines()[-1]}")
        said, trained = json.loads(done.stdout.splitlines()[-1]), load(out)
    record = trained.record
    return {
        "seconds": seconds,
        "flows_and_steps_s": record["setup_s"] + record["train_s"],
        "compile_s": record["compile_s"],
        "waiting": record["waiting"] / record["green_applications"],
        "error_mean": said["drag_error_mean"],
        "weights": np.asarray(trained.network.weights),
    }


def compared(run: Run, result: Result) -> Result:
    """The largest difference of a weight from those of the first training."""
    weights = [np.array(row.pop("weights")) for row in result["rows"]]
    for row, mine in zip(result["rows"], weights, strict=True):
        row["weights_off"] = float(np.abs(mine - weights[0]).max())
    return {}


def _bound(cores: int | None) -> list[str]:
    """The command that keeps another one on the first cores."""
    if cores is None:
        return []
    chosen = sorted(os.sched_getaffinity(0))[:cores]
    return ["taskset", "-c", ",".join(map(str, chosen))]


COLUMNS = (
    "devices {way} | flows and steps {flows_and_steps_s:.0f} s | compilation {compile_s:.0f} s"
)
COLUMNS += " | total, with held-out flows {seconds:.0f} s | idle work {waiting:.1%}"
COLUMNS += " | mean error {error_mean:.3%} | difference of weights {weights_off:.0e}"
OPTIONS = {"--accelerator": ACCELERATOR}
TABLE = Table(cases, measure, columns(COLUMNS), tiny="last")
STUDY = Study([TABLE], extra=compared, options=OPTIONS)
