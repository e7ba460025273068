"""What a GPU brings: flows per second by batch size, beside the processor of the same machine."""

from collections.abc import Iterator

import jax
import numpy as np
from jax.sharding import Mesh
from study import Row, Run, Study, Table, Unavailable, columns
from tools import medians

from surrogate import Flow, Scene
from surrogate.devices import AXIS, Devices
from surrogate.flow.batch import batch_solver, estimated_cost
from surrogate.partition import partition_bodies
from surrogate.scene.samples import training_samples

PROCESSOR_BODIES, ROUNDS = 8, 3
SCENES = {  # and their batch sizes on the accelerator
    "drag, draft": (Scene(fidelity="draft"), (1, 16, 128)),
    "drag, standard": (Scene(), (64,)),
    "drag in 3-D, draft": (Scene(dimension=3, fidelity="draft"), (32,)),
}


def scenes(run: Run) -> Iterator[Row]:
    """Yield the names of the scenes."""
    yield from ({"scene": name} for name in SCENES)


def flows(run: Run, scene: str) -> list[Row]:
    """Return flows per second on the processor, one by one, and on the accelerator in batches.

    The bodies of the processor are among those of every batch; ``difference`` is the largest of
    their drags from those of the processor.

    Raises:
      Unavailable: JAX finds no accelerator, and the run is not a tiny one.
    """
    accelerators = [device for device in jax.devices() if device.platform != "cpu"]
    if not accelerators and not run.tiny:
        raise Unavailable("JAX finds no accelerator")
    where = jax.devices("cpu")[:1], (accelerators or jax.devices("cpu"))[:1]
    given, batches = SCENES[scene]
    flow, few = Flow(given), run.pick(2, PROCESSOR_BODIES)
    sizes = [
        (where[0], 1, few),
        *((where[1], batch, 2 * batch) for batch in run.pick((2,), batches)),
    ]
    rows, reference = [], None
    for devices, batch, bodies in sizes:
        row, drags = _measured(run, flow, Devices(Mesh(np.array(devices), (AXIS,)), batch), bodies)
        reference = drags if reference is None else reference
        common = min(len(drags), few)
        off = np.abs(drags[:common] / reference[:common] - 1)
        rows.append(row | {"difference": float(off.max())})
    return rows


def _measured(run: Run, flow: Flow, devices: Devices, count: int) -> tuple[Row, np.ndarray]:
    """The rate of one batch size, and the drags of the bodies."""
    samples = training_samples(flow.scene, 0, count)
    partition = partition_bodies(devices, estimated_cost(flow.scene.family, *samples))
    given, found = devices.place((partition, *samples)), []
    program = batch_solver(flow.bodies, devices).lower(*given).compile()

    def solve():
        found.append(jax.block_until_ready(program(*given)))
        return found[-1]

    seconds = medians([solve], run.pick(1, ROUNDS))[0]
    device = devices.mesh.devices.flat[0]
    row = {
        "device": "processor" if device.platform == "cpu" else device.device_kind,
        "device_batch": devices.device_batch,
        "flows_per_s": count / seconds,
        "mib_per_body": program.memory_analysis().temp_size_in_bytes / devices.device_batch / 2**20,
    }
    return row, np.asarray(found[-1].drag)


FLOWS = columns(
    "flows {scene} | device {device} | batch size {device_batch}"
    " | flows per second {flows_per_s:.1f} | MiB per body of a batch {mib_per_body:.0f}"
    " | drag differs from the processor's by {difference:.0e}"
)
STUDIES = {"accelerator": Study([Table(scenes, flows, FLOWS)])}
