"""What more devices bring: flows per second, batch sizes, and a model of the scaling beyond."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from figures import Line, Panel, draw_lines
from study import Result, Row, Run, Study, Table, columns, words
from tools import ACCELERATOR, free_port, platform_of

from surrogate import NotConverged

CHILD = Path(__file__).parents[1] / "flows_on_devices.py"
WAYS = {  # devices of a process, processes, whether each process has one core
    "one device, all cores": (1, 1, False),
    "one device, one core": (1, 1, True),
    "two devices": (2, 1, False),
    "two processes, a core each": (1, 2, True),
}
ACCELERATED = {"one accelerator": (1, 1, False)}
BODIES = {"draft": 96, "standard": 64, "fine": 12}
CPU_LANES, GPU_LANES = (2, 4, 8, 16), (8, 32, 128)  # batch sizes per device
COUNTS = (1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1000)
MANY = 4096  # bodies of the model
NUMBERS = 40  # that are gathered per body: tractions, slopes, flags
BANDWIDTH = 1e9  # bytes per second, of a plain network


def cases(run: Run) -> Iterator[Row]:
    """Every grid on all devices, then larger batches on the first."""
    accelerator = run.options["accelerator"]
    ways = ACCELERATED if accelerator else WAYS
    if run.tiny:
        yield {"fidelity": "draft", "way": list(ways)[-1], "lanes": 1}
        return
    for fidelity in BODIES:
        for way in ways:
            yield {"fidelity": fidelity, "way": way, "lanes": 1}
    for fidelity in BODIES if accelerator else ("draft",):
        for lanes in GPU_LANES if accelerator else CPU_LANES:
            yield {"fidelity": fidelity, "way": next(iter(ways)), "lanes": lanes}


def measure(run: Run, fidelity: str, way: str, lanes: int) -> Row:
    """Solve the same bodies in processes of their own."""
    accelerator = run.options["accelerator"]
    devices, processes, one_core = (WAYS | ACCELERATED)[way]
    asked = {
        "fidelity": fidelity,
        "devices": devices,
        "processes": processes,
        "one_core": one_core,
        "lanes": lanes,
        "bodies": run.pick(4, BODIES[fidelity] * (4 if accelerator else 1)),
        "rounds": run.pick(1, 5),
        "coordinator": f"localhost:{free_port()}",
        "accelerator": accelerator,
    }
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    children = [
        subprocess.Popen(
            [sys.executable, str(CHILD), json.dumps(asked | {"process": process})],
            env=os.environ | platform_of(accelerator),
            **pipes,
        )
        for process in range(processes)
    ]
    said = [child.communicate() for child in children]
    if any(child.returncode for child in children):
        raise NotConverged(f"flows on devices: {said[0][1].strip().splitlines()[-1]}")
    return json.loads(said[0][0].strip().splitlines()[-1])


def model(run: Run, result: Result) -> Result:
    """Seconds of many flows over devices, from the rate and the work measured on the first.

    The measured convolutions with G are drawn anew for every body, and bodies are partitioned at
    random in equal numbers; the results of all bodies are gathered on all devices once.
    """
    works = [row.pop("green_applications") for row in result["rows"]]
    work = np.array(works[0])
    drawn = np.random.default_rng(0).choice(work, MANY)
    rate, scaling = result["rows"][0]["flows_per_s"], []
    for count in COUNTS:
        shares = np.array_split(drawn, count)
        waste = count * max(share.sum() for share in shares) / drawn.sum() - 1
        solving, telling = MANY / rate / count * (1 + waste), MANY * NUMBERS * 8 / BANDWIDTH
        row = {"devices": count, "waste": waste, "solving_s": solving, "telling_s": telling}
        scaling.append(row | {"gain": MANY / rate / (solving + telling)})
    return {"work": work.tolist(), "scaling": scaling}


def text(result: Result) -> str:
    """The work per body, then the model."""
    form = (
        "A body takes {mean:.0f} convolutions with G on average and {most} at most. From that, a "
        "model (not a measurement) of the flows of {bodies} bodies on the grid of the first row, "
        "partitioned in equal numbers: all devices wait for the slowest, then the results are "
        "gathered ({kilobytes:.0f} kB at {bandwidth:.0e} bytes per second). The network's steps "
        "run on one device and take as long as there."
    )
    work = np.array(result["work"])
    sizes = {"bodies": MANY, "kilobytes": MANY * NUMBERS * 8 / 1e3, "bandwidth": BANDWIDTH}
    told = words(form, mean=work.mean(), most=int(work.max()), **sizes)
    scaling = columns(
        "devices {devices} | idle work {waste:.0%} | solving {solving_s:.2f} s"
        " | gathering {telling_s:.4f} s | speedup {gain:.0f}"
    )
    return f"{told}\n\n{scaling(result['scaling'])}"


def draw(result: Result, path: Path) -> None:
    """The model over devices."""
    gains = [(row["devices"], row["gain"]) for row in result["scaling"]]
    ideal = [(count, count) for count, _ in gains]
    lines = [Line(gains, "model"), Line(ideal, "no idle work", {"color": "0.6", "ls": "--"})]
    draw_lines([Panel(lines, "devices")], "speedup", path)


COLUMNS = "grid {fidelity} | devices {way} | batch size per device {lanes}"
COLUMNS += " | flows per second {flows_per_s:.1f} | MiB per body of a batch {mib_per_lane:.0f}"
TABLE = Table(cases, measure, columns(COLUMNS), tiny="all")
STUDY = Study([TABLE], text, model, draw, {"--accelerator": ACCELERATOR})
