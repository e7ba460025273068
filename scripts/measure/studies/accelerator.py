"""What a GPU brings: flows per second by batch size, beside one CPU device of the same machine."""

import jax
import numpy as np
from jax.sharding import Mesh
from study import Result, Row, Run, Study, Table, cases, columns
from tools import timed_batch

from surrogate import Flow, InvalidInput, Scene
from surrogate.devices import AXIS, Devices

ONE_BY_ONE, ROUNDS = 8, 3  # bodies on the CPU, repetitions
SCENES = {  # and their batch sizes on the accelerator
    "2-D, draft": (Scene(fidelity="draft"), (16, 128)),
    "2-D, standard": (Scene(), (64,)),
    "3-D, draft": (Scene(dimension=3, fidelity="draft"), (32,)),
}


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

    def solved(device, batch, count):
        devices = Devices(Mesh(np.array([device]), (AXIS,)), batch)
        row, found = timed_batch(flow, devices, count, run.pick(1, ROUNDS))
        name = "one CPU device" if device.platform == "cpu" else device.device_kind
        return {"device": name, "device_batch": batch, **row}, np.asarray(found.drag)

    row, reference = solved(processor, 1, few)
    rows = [row | {"difference": None}]
    for batch in run.pick((2,), batches):
        row, drags = solved(accelerator, batch, 2 * batch)
        off = np.abs(drags[:few] / reference - 1)
        rows.append(row | {"difference": float(off.max())})
    return rows


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
STUDIES = {"accelerator": Study([Table(cases(scene=SCENES), flows, FLOWS)])}
