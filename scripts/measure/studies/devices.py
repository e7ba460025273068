"""What more devices bring: flows per second, a model of the scaling beyond, whole trainings."""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import jax
import numpy as np
from figures import lines
from study import TINY, Result, Row, Run, Study, Table, cases, columns, words
from tools import free_port, timed_batch

from surrogate import FIDELITIES, Flow, NotConverged, Scene, load
from surrogate.devices import choose_devices
from surrogate.processes import first, join

SCRIPTS = Path(__file__).parents[2]
CHILD = ("-m", "studies.devices")  # this file as a program
SETUPS = {  # devices of a process, processes, whether each process has one core
    "one device, all cores": (1, 1, False),
    "one device, one core": (1, 1, True),
    "two devices": (2, 1, False),
    "two processes, a core each": (1, 2, True),
}
BODIES = {"draft": 96, "standard": 64, "fine": 12}
BATCHES = (2, 4, 8, 16)  # batch sizes per device
COUNTS = (1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1000)
MANY = 4096  # bodies of the model
NUMBERS = 40  # that are gathered per body: tractions, slopes, flags
BANDWIDTH = 1e9  # bytes per second, of a plain network


def batches(run: Run) -> list[Row]:
    """Return the cases: every grid on all devices, then larger batches on the first."""
    if run.tiny:
        return cases(fidelity=["draft"], setup=tuple(SETUPS)[-1:], device_batch=[1])
    one = cases(fidelity=BODIES, setup=SETUPS, device_batch=[1])
    return one + cases(fidelity=["draft"], setup=tuple(SETUPS)[:1], device_batch=BATCHES)


def flows(run: Run, fidelity: str, setup: str, device_batch: int) -> Row:
    """Return the flows per second of the same bodies, in processes of their own.

    Args:
      run: How the study is run.
      fidelity: Name of the grid's fidelity.
      setup: Devices and processes, a key of ``SETUPS``.
      device_batch: Batch size per device.
    """
    devices, processes, one_core = SETUPS[setup]
    asked = {
        "fidelity": fidelity,
        "devices": devices,
        "processes": processes,
        "one_core": one_core,
        "device_batch": device_batch,
        "bodies": run.pick(4, BODIES[fidelity]),
        "rounds": run.pick(1, 5),
        "coordinator": f"localhost:{free_port()}",
    }
    children = [
        _start([*CHILD, json.dumps(asked | {"process": process})]) for process in range(processes)
    ]
    answers = [_last_line(setup, child) for child in children]
    return json.loads(answers[0])


def _start(argv: list[str], cores: int | None = None, **environment: str) -> subprocess.Popen:
    """A Python process, on the first cores only where their number is given."""
    chosen = ",".join(map(str, sorted(os.sched_getaffinity(0))[:cores]))
    bound = ["taskset", "-c", chosen] if cores else []
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    argv = [*bound, sys.executable, *argv]
    environment = os.environ | {"JAX_PLATFORMS": "cpu"} | environment
    return subprocess.Popen(argv, env=environment, cwd=SCRIPTS / "measure", **pipes)


def _last_line(name: str, child: subprocess.Popen) -> str:
    """The last line that a process prints.

    Raises:
      NotConverged: The process failed.
    """
    said, problem = child.communicate()
    if child.returncode:
        raise NotConverged(f"{name}: {problem.strip().splitlines()[-1]}")
    return said.strip().rpartition("\n")[2]


def model(run: Run, result: Result) -> Result:
    """Return the modelled seconds of many flows over devices, from measurements on the first row.

    The measured convolutions with G are drawn anew for every body, and bodies are partitioned at
    random in equal numbers; the results of all bodies are gathered on all devices once.
    """
    works = [row.pop("green_applications") for row in result["rows"]]
    drawn = np.random.default_rng(0).choice(np.array(works[0]), MANY)
    rate, scaling = result["rows"][0]["flows_per_s"], []
    for count in COUNTS:
        shares = np.array_split(drawn, count)
        waste = count * max(share.sum() for share in shares) / drawn.sum() - 1
        solving, gathering = MANY / rate / count * (1 + waste), MANY * NUMBERS * 8 / BANDWIDTH
        row = {"devices": count, "waste": waste, "solving_s": solving, "gathering_s": gathering}
        scaling.append(row | {"gain": MANY / rate / (solving + gathering)})
    return {"work": works[0], "scaling": scaling}


def model_text(result: Result) -> str:
    """Return the work per body and the model as text."""
    form = (
        "A body takes {mean:.0f} convolutions with G on average and {most} at most. From that, a "
        "model (not a measurement) of the flows of {bodies} bodies on the grid of the first row, "
        "partitioned in equal numbers: all devices wait for the slowest, then the results are "
        "gathered ({kilobytes:.0f} kB at {bandwidth:.0e} bytes per second). The network's steps "
        "run on one device and take as long as there."
    )
    work = {"mean": np.mean(result["work"]), "most": max(result["work"])}
    sizes = {"bodies": MANY, "kilobytes": MANY * NUMBERS * 8 / 1e3, "bandwidth": BANDWIDTH}
    return f"{words(form, **work, **sizes)}\n\n{SCALING(result['scaling'])}"


def trainings(run: Run) -> Iterator[Row]:
    """Yield the number of devices, and of cores that the process may use (all where None)."""
    yield {"setup": "one device, all cores"}
    yield {"setup": "one device, one core", "cores": 1}
    yield {"setup": "two devices", "devices": 2}


def training(run: Run, setup: str, devices: int = 1, cores: int | None = None) -> Row:
    """Return the time and error of HIG's full training in a process of its own.

    Nothing is compiled before.

    Args:
      run: How the study is run.
      setup: Name of the case.
      devices: Number of devices.
      cores: Number of cores that the process may use; None for all.
    """
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        scene, out = folder / "scene.toml", folder / "surrogate"
        Scene(fidelity=run.pick(TINY, "standard")).write(scene)
        argv = [
            str(SCRIPTS / "train_surrogate.py"),
            "--method",
            "hig",
            "--scene",
            str(scene),
            "--devices",
            str(devices),
        ]
        argv += run.pick(["--preset", "quick", "--samples", "8"], ["--preset", "full"])
        argv += ["--out", str(out), "--json"]
        start = time.perf_counter()
        child = _start(argv, cores, XDG_CACHE_HOME=str(folder / "compiled"))
        said = json.loads(_last_line(setup, child))
        seconds, trained = time.perf_counter() - start, load(out)
    record = trained.record
    return {
        "seconds": seconds,
        "flows_and_steps_s": record["setup_s"] + record["train_s"],
        "compile_s": record["compile_s"],
        "waiting": record["idle_work"] / record["green_applications"],
        "error_mean": said["drag_error_mean"],
        "weights": np.asarray(trained.network.weights),
    }


def difference(run: Run, result: Result) -> Result:
    """Add to each row the largest difference of a weight from those of the first training."""
    weights = [np.array(row.pop("weights")) for row in result["rows"]]
    for row, mine in zip(result["rows"], weights, strict=True):
        row["weights_off"] = float(np.abs(mine - weights[0]).max())
    return {}


def child(asked: Row) -> Row:
    """Solve the same bodies a few times, in one of the processes of ``flows``."""
    if asked["one_core"]:
        cores = sorted(os.sched_getaffinity(0))
        os.sched_setaffinity(0, {cores[asked["process"] % len(cores)]})
    jax.config.update("jax_num_cpu_devices", asked["devices"])
    if asked["processes"] > 1:
        join(asked["coordinator"], asked["processes"], asked["process"])
    flow = Flow(Scene(fidelity=FIDELITIES[asked["fidelity"]]))
    devices = choose_devices(asked["devices"] * asked["processes"], asked["device_batch"])
    row, found = timed_batch(flow, devices, asked["bodies"], asked["rounds"])
    return row | {
        "green_applications": np.asarray(found.green_applications).tolist(),
        "device": jax.devices()[0].device_kind,
    }


FLOWS = columns(
    "grid {fidelity} | devices {setup} | batch size per device {device_batch}"
    " | flows per second {flows_per_s:.1f} | MiB per body of a batch {mib_per_body:.0f}"
)
SCALING = columns(
    "devices {devices} | idle work {waste:.0%} | solving {solving_s:.2f} s"
    " | gathering {gathering_s:.4f} s | speedup {gain:.0f}"
)
TRAININGS = columns(
    "devices {setup} | flows and steps {flows_and_steps_s:.0f} s | compilation {compile_s:.0f} s"
    " | total, with held-out flows {seconds:.0f} s | idle work {waiting:.1%}"
    " | mean error {error_mean:.3%} | difference of weights {weights_off:.0e}"
)
SPEEDUP = lines("devices", "gain", None, ("devices", "speedup (model)"), key="scaling")
TABLE = Table(trainings, training, TRAININGS, tiny="last")
STUDIES = {
    "devices": Study([Table(batches, flows, FLOWS)], model_text, model, SPEEDUP),
    "trainings_on_devices": Study([TABLE], extra=difference),
}

if __name__ == "__main__":
    answer = child(json.loads(sys.argv[1]))
    if first():
        print(json.dumps(answer))
