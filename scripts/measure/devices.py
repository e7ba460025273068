"""What more devices bring: flows a second, lanes, and a model of the scaling beyond.

python scripts/measure/devices.py
python scripts/measure/devices.py --accelerator gpu
"""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from study import ACCELERATOR, Result, Study, free_port, platform_of, run_study, table, words

from shapeopt.render.figures import STYLE, plt, save_figure
from surrogate import NotConverged

CHILD = Path(__file__).with_name("flows_on_devices.py")
WAYS = {  # devices of a process, processes, whether each process has one core
    "one device, all cores": (1, 1, False),
    "one device, one core": (1, 1, True),
    "two devices": (2, 1, False),
    "two processes, a core each": (1, 2, True),
}
BODIES = {"draft": 96, "standard": 64, "fine": 12}
CPU_LANES, GPU_LANES = (1, 2, 4, 8, 16), (1, 8, 32, 128)
COUNTS = (1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1000)
SET = 4096  # bodies of the model
NUMBERS = 40  # that everybody is told of a body: tractions, slopes, flags
LINK = 1e9  # bytes a second, of a plain network


def measure(tiny: bool, progress: Callable, accelerator: str | None) -> Result:
    """Every way in a process of its own, one after another, in one run."""
    fidelities = ("draft",) if tiny else tuple(BODIES)
    ways = {"one accelerator": (1, 1, False)} if accelerator else WAYS
    ways = dict(list(ways.items())[-1:]) if tiny else ways
    lanes = (1,) if tiny else GPU_LANES if accelerator else CPU_LANES
    jobs = [(f, way, 1) for f in fidelities for way in ways]
    jobs += [(f, next(iter(ways)), n) for f in (fidelities if accelerator else ("draft",))
             for n in lanes[1:]]  # fmt: skip
    rows: list[dict[str, Any]] = []
    for k, (fidelity, way, count) in enumerate(jobs):
        progress(k / len(jobs), f"{fidelity}, {way}, {count} lanes")
        bodies = 4 if tiny else BODIES[fidelity] * (4 if accelerator else 1)
        found = _solve(fidelity, ways[way], count, bodies, tiny, accelerator)
        rows.append({"fidelity": fidelity, "way": way, "lanes": count} | found)
    works = [row.pop("green_applications") for row in rows]
    work = np.array(works[0])
    return {"rows": rows, "work": work, "scaling": _model(rows[0]["flows_per_s"], work)}


def _solve(fidelity, way, lanes, bodies, tiny, accelerator) -> dict[str, Any]:
    devices, processes, one_core = way
    asked = {
        "fidelity": fidelity,
        "devices": devices,
        "processes": processes,
        "one_core": one_core,
        "lanes": lanes,
        "bodies": bodies,
        "rounds": 1 if tiny else 5,
        "coordinator": f"localhost:{free_port()}",
        "accelerator": accelerator,
    }
    environment = os.environ | platform_of(accelerator)
    children = [
        subprocess.Popen(
            [sys.executable, str(CHILD), json.dumps(asked | {"process": process})],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=environment,
        )
        for process in range(processes)
    ]
    said = [child.communicate() for child in children]
    if any(child.returncode for child in children):
        raise NotConverged(f"flows on devices: {said[0][1].strip().splitlines()[-1]}")
    return json.loads(said[0][0].strip().splitlines()[-1])


def _model(rate: float, work: np.ndarray) -> list[dict[str, Any]]:
    """Seconds of a set's flows over devices, from what one device takes.

    Stragglers: the measured applications of G, drawn anew for every body and scatter at random in
    equal numbers; the answers of all bodies reach all devices once.
    """
    rng = np.random.default_rng(0)
    drawn = rng.choice(work, SET)
    found = []
    for count in COUNTS:
        shares = np.array_split(drawn, count)
        waste = count * max(share.sum() for share in shares) / drawn.sum() - 1
        solving, telling = SET / rate / count * (1 + waste), SET * NUMBERS * 8 / LINK
        row = {"devices": count, "waste": waste, "solving_s": solving, "telling_s": telling}
        found.append(row | {"gain": SET / rate / (solving + telling)})
    return found


def tables(result: Result) -> str:
    """What was measured, then the model."""
    heads = "grid | way | lanes | flows a second | MiB a lane"
    forms = "{fidelity} | {way} | {lanes} | {flows_per_s:.1f} | {mib_per_lane:.0f}"
    measured = table(result["rows"], heads, forms)
    work = np.array(result["work"])
    said = words(
        "A body takes {mean:.0f} applications of G on average and {most} at most. From that, a "
        "model (not a measurement) of the flows of {bodies} bodies on the grid of the first row, "
        "scatter in equal numbers: all wait for the slowest device, then tell each other the answers "
        "({kilobytes:.0f} kB at {link:.0e} bytes a second). The network's steps are done by one "
        "device and take as long as there.",
        mean=work.mean(),
        most=int(work.max()),
        bodies=SET,
        kilobytes=SET * NUMBERS * 8 / 1e3,
        link=LINK,
    )
    heads = "devices | waiting for stragglers | solving | telling | times as fast"
    forms = "{devices} | {waste:.0%} | {solving_s:.2f} s | {telling_s:.4f} s | {gain:.0f}"
    return f"{measured}\n\n{said}\n\n{table(result['scaling'], heads, forms)}"


def draw(result: Result, path: Path) -> None:
    """The model over devices."""
    rows = result["scaling"]
    with plt.rc_context(STYLE):
        figure, axis = plt.subplots(figsize=(6.4, 4), layout="constrained")
    counts = [row["devices"] for row in rows]
    axis.loglog(counts, [row["gain"] for row in rows], "o-", ms=3, label="model")
    axis.loglog(counts, counts, color="0.6", lw=1, ls="--", label="nobody waiting")
    axis.set(xlabel="devices", ylabel="times as fast as one")
    axis.legend(frameon=False)
    save_figure(figure, path)


STUDY = Study("devices", measure, tables, draw, {"--accelerator": ACCELERATOR})

if __name__ == "__main__":
    sys.exit(run_study(STUDY))
