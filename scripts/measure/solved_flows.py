"""The solved flows of a scene, with the gradients of their loads, that studies fit models to."""

import dataclasses
import time
from pathlib import Path
from typing import NamedTuple

import jax
import numpy as np
from study import Run

from surrogate import Flow, InvalidInput, Scene
from surrogate.devices import choose_devices
from surrogate.files import whole_file
from surrogate.flow.batch import FlowBatch
from surrogate.flow.derivatives import LoadsAndGradients
from surrogate.scene.samples import Samples, held_out_samples, training_samples

SCRIPTS = Path(__file__).parents[1]
ALL = {"allow_unsteady": True, "partial": True}  # flows, whatever becomes of them
HELD_OUT = {"particle": 48, "lift": 96}
CELLS = {"particle": 10, "lift": 8}  # per D in place of the scenes': a fifth of the time
TINY_CELLS = 7  # of tiny runs, in the domain that holds the scene's bodies


class SolvedFlows(NamedTuple):
    """The flows of a study: of training bodies with their gradients, and of held-out bodies."""

    samples: Samples  # the training bodies
    training: LoadsAndGradients
    held_out: FlowBatch
    seconds: np.ndarray  # of a training body's flow with its gradients, by the clock
    device: np.ndarray  # that solved them, one name


PARTS = {"samples": Samples, "training": LoadsAndGradients, "held_out": FlowBatch}  # of a file


def scene_of(name: str, tiny: bool) -> Scene:
    """Return the scene of this name on the cells of these studies."""
    scene = Scene.read(SCRIPTS / f"{name}.toml")
    cells = TINY_CELLS if tiny else CELLS[name]
    return dataclasses.replace(scene, fidelity=dataclasses.replace(scene.fidelity, cells=cells))


def bodies_of(name: str, tiny: bool, count: int) -> tuple[Flow, Samples, Samples]:
    """Return the flow of a scene, ``count`` training bodies and its held-out ones."""
    scene = scene_of(name, tiny)
    samples = training_samples(scene, 0, 16 if tiny else count)
    return Flow(scene), samples, held_out_samples(scene, 0, 4 if tiny else HELD_OUT[name])


def solve_flows(run: Run, flow: Flow, samples: Samples, unseen: Samples) -> SolvedFlows:
    """Solve the flows of bodies on all devices, in batches of the option ``--device-batch``."""
    devices = choose_devices(len(jax.devices()), run.options.get("device_batch"))
    truth = flow.solve_all(*unseen, devices, **ALL)
    unit, solved, seconds = devices.device_batch * devices.count, [], []
    size = unit * min(16, -(-samples.count // unit))
    for start in range(0, samples.count, size):
        run.progress(start / samples.count, f"flow {start} of {samples.count}")
        rows = np.minimum(np.arange(start, start + size), samples.count - 1)
        begin = time.perf_counter()
        solved.append(flow.solve_all(*samples.at(rows), devices, gradients=True, **ALL))
        seconds.append((time.perf_counter() - begin) / size)
    found = jax.tree.map(lambda *leaves: np.concatenate(leaves)[: samples.count], *solved)
    each = np.median(seconds[1:] or seconds)  # the first compiles
    device = f"{devices.count} {jax.devices()[0].device_kind}"
    return SolvedFlows(samples, found, truth, each, np.asarray(device))


def read_or_solve(run: Run, flow: Flow, samples: Samples, unseen: Samples) -> SolvedFlows:
    """Return the flows of the option ``--flows``, a file that is written if it does not exist.

    Raises:
      InvalidInput: The file has flows of other bodies.
    """
    path = run.options.get("flows")
    if path is None:
        return solve_flows(run, flow, samples, unseen)
    if not path.exists():
        write_flows(path, solve_flows(run, flow, samples, unseen))
    found = read_flows(path)
    shapes = found.samples.parameters.shape, samples.parameters.shape
    if shapes[0] != shapes[1] or not all(map(np.allclose, found.samples, samples)):
        raise InvalidInput(f"{path}: has the flows of other bodies; another --flows is needed")
    return found


def read_flows(path: Path) -> SolvedFlows:
    """Return the flows of a file by ``write_flows``."""
    with np.load(path) as file:
        parts = {
            name: kind(*(file[f"{name}.{field}"] for field in kind._fields))
            for name, kind in PARTS.items()
        }
        return SolvedFlows(**parts, seconds=file["seconds"], device=file["device"])


def write_flows(path: Path, flows: SolvedFlows) -> None:
    """Write flows to a file of NumPy."""
    arrays = {"seconds": flows.seconds, "device": flows.device}
    for name in PARTS:
        fields = getattr(flows, name)._asdict()
        arrays |= {f"{name}.{field}": values for field, values in fields.items()}
    with whole_file(path) as temporary, temporary.open("wb") as file:
        np.savez(file, **arrays)
