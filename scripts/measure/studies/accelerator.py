"""What a GPU brings: flows per second by batch size, beside one CPU device of the same machine."""

from collections.abc import Iterator

import jax
import numpy as np
from jax.sharding import Mesh
from study import Result, Row, Run, Study, Table, columns
from tools import medians

from surrogate import Flow, InvalidInput, Scene
from surrogate.devices import AXIS, Devices
from surrogate.flow.batch import batch_solver, estimated_cost
from surrogate.partition import partition_bodies
from surrogate.scene.samples import training_samples

ONE_BY_ONE, ROUNDS = 8, 3  # bodies on the CPU, repetitions
SCENES = {  # and their batch sizes on the accelerator
    "2-D, draft": (Scene(fidelity="draft"), (16, 128)),
    "2-D, standard": (Scene(), (64,)),
    "3-D, draft": (Scene(dimension=3, fidelity="draft"), (32,)),
}


def scenes(run: Run) -> Iterator[Row]:
    """Yield the names of the scenes."""
    yield from ({"scene": name} for name in SCENES)


def flows(run: Run, scene: str) -> list[Row]:
    """Return flows per second one by one on a CPU device, and in batches on the accelerator.

    The first bodies are the same everywhere; ``difference`` is the largest relative one of their
    drags from those of the CPU.

    Raises:
      InvalidInput: JAX finds no accelerator, and the run is not a tiny one.
    """
    processor = jax.devices("cpu")[0]
    found = [device for device in jax.devices() if device.platform != "cpu"]
    if not found and not run.tiny:
        raise InvalidInput("accelerator: JAX finds none here")
    accelerator = (found or [processor])[0]
    given, batches = SCENES[scene]
    flow, few = Flow(given), run.pick(2, ONE_BY_ONE)
    row, reference = _measured(run, flow, processor, 1, few)
    rows = [row | {"difference": None}]
    for batch in run.pick((2,), batches):
        row, drags = _measured(run, flow, accelerator, batch, 2 * batch)
        off = np.abs(drags[:few] / reference - 1)
        rows.append(row | {"difference": float(off.max())})
    return rows


def _measured(
    run: Run, flow: Flow, device: jax.Device, batch: int, count: int
) -> tuple[Row, np.ndarray]:
    """The rate of one batch size, and the drags of the bodies."""
    devices, found = Devices(Mesh(np.array([device]), (AXIS,)), batch), []
    samples = training_samples(flow.scene, 0, count)
    partition = partition_bodies(devices, estimated_cost(flow.scene.family, *samples))
    given = devices.place((partition, *samples))
    program = batch_solver(flow.bodies, devices).lower(*given).compile()

    def solve():
        found.append(jax.block_until_ready(program(*given)))
        return found[-1]

    seconds = medians([solve], run.pick(1, ROUNDS))[0]
    row = {
        "device": "one CPU device" if device.platform == "cpu" else device.device_kind,
        "device_batch": batch,
        "flows_per_s": count / seconds,
        "mib_per_body": program.memory_analysis().temp_size_in_bytes / batch / 2**20,
    }
    return row, np.asarray(found[-1].drag)


def gain(result: Result, scene: str) -> Row:
    """Return the accelerator's name, and its flows per second over those of the CPU device."""
    reference, *others = (row for row in result["rows"] if row["scene"] == scene)
    best = max(others, key=lambda row: row["flows_per_s"])
    return {
        "device": best["device"],
        "gain": best["flows_per_s"] / reference["flows_per_s"],
    }


FLOWS = columns(
    "scene {scene} | device {device} | batch size {device_batch}"
    " | flows per second {flows_per_s:.1f} | MiB per body of a batch {mib_per_body:.0f}"
    " | drag differs from the CPU's by {difference:.0e}"
)
STUDIES = {"accelerator": Study([Table(scenes, flows, FLOWS)])}
