"""What more devices bring to a whole training: its seconds, and the same weights.

python scripts/measure/trainings_on_devices.py
python scripts/measure/trainings_on_devices.py --accelerator gpu
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from study import ACCELERATOR, TINY, Result, Study, platform_of, run_study, table_of_rows

from surrogate import NotConverged, Scene, load

COMMAND = Path(__file__).parents[1] / "train_surrogate.py"


class Way(NamedTuple):
    """Devices, and cores that the process may use: all of them where it is None."""

    name: str
    devices: int = 1
    cores: int | None = None
    accelerator: str | None = None


WAYS = (
    Way("one device, all cores"),
    Way("one device, one core", cores=1),
    Way("two devices", devices=2),
)


def measure(tiny: bool, progress: Callable, accelerator: str | None) -> Result:
    """HIG's full training every way, one after another, each in a process of its own."""
    ways = (*WAYS, Way("one accelerator", accelerator=accelerator)) if accelerator else WAYS
    ways, rows = ways[-1:] if tiny else ways, list[dict[str, Any]]()
    with tempfile.TemporaryDirectory() as scratch:
        for k, way in enumerate(ways):
            progress(k / len(ways), way.name)
            rows.append({"way": way.name} | _trained(way, Path(scratch), tiny))
        weights = [load(Path(scratch) / way.name).network.weights for way in ways]
    for row, found in zip(rows, weights, strict=True):
        row["weights_off"] = float(np.abs(found - weights[0]).max())
    return {"rows": rows}


def _trained(way: Way, folder: Path, tiny: bool) -> dict[str, Any]:
    """Seconds of one training, with nothing compiled before."""
    scene, out = folder / "scene.toml", folder / way.name
    Scene(fidelity=TINY if tiny else "standard").write(scene)
    words = ["--method", "hig", "--scene", str(scene), "--devices", str(way.devices)]
    words += ["--preset", "quick", "--samples", "8"] if tiny else ["--preset", "full"]
    cold = {"XDG_CACHE_HOME": str(folder / f"{way.name}, compiled")} | platform_of(way.accelerator)
    start = time.perf_counter()
    done = subprocess.run(
        [*_bound(way.cores), sys.executable, str(COMMAND), *words, "--out", str(out), "--json"],
        capture_output=True,
        text=True,
        env=os.environ | cold,
    )
    seconds = time.perf_counter() - start
    if done.returncode:
        raise NotConverged(f"{way.name}: {done.stderr.strip().splitlines()[-1]}")
    said, record = json.loads(done.stdout.splitlines()[-1]), load(out).record
    return {
        "seconds": seconds,
        "flows_and_steps_s": record["setup_s"] + record["train_s"],
        "compile_s": record["compile_s"],
        "waiting": record["waiting"] / record["green_applications"],
        "error_mean": said["drag_error_mean"],
    }


def _bound(cores: int | None) -> list[str]:
    """Words that keep a command on the first cores."""
    if cores is None:
        return []
    chosen = sorted(os.sched_getaffinity(0))[:cores]
    return ["taskset", "-c", ",".join(map(str, chosen))]


HEADS = "way | flows and steps | compilation | all, with held-out flows | waiting | error: mean"
FORMS = "{way} | {flows_and_steps_s:.0f} s | {compile_s:.0f} s | {seconds:.0f} s | {waiting:.1%} | "
FORMS += "{error_mean:.3%} | {weights_off:.0e}"
STUDY = Study(
    "trainings_on_devices",
    measure,
    table_of_rows(f"{HEADS} | weights off by", FORMS),
    options={"--accelerator": ACCELERATOR},
)

if __name__ == "__main__":
    sys.exit(run_study(STUDY))
