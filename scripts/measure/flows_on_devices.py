"""Run by devices.py, in a process of its own: flows a second on so many devices, as JSON."""

import json
import os
import sys
import time

import jax
import numpy as np

from surrogate import FIDELITIES, Flow, Scene
from surrogate.cache import use_compilation_cache
from surrogate.devices import choose_devices, partition_bodies
from surrogate.flow.batch import batch_solver, estimated_cost
from surrogate.processes import first, join
from surrogate.training.samples import training_samples


def main() -> None:
    """Solve the same bodies a few times; print rates, applications of G, bytes."""
    asked = json.loads(sys.argv[1])
    if asked["one_core"]:
        cores = sorted(os.sched_getaffinity(0))
        os.sched_setaffinity(0, {cores[asked["process"] % len(cores)]})
    if asked["accelerator"] is None:
        jax.config.update("jax_num_cpu_devices", asked["devices"])
    if asked["processes"] > 1:
        join(asked["coordinator"], asked["processes"], asked["process"])
    use_compilation_cache()
    scene = Scene(fidelity=FIDELITIES[asked["fidelity"]])
    flow, samples = Flow(scene), training_samples(scene, 0, asked["bodies"])
    devices = choose_devices(asked["devices"] * asked["processes"], asked["lanes"])
    partition = partition_bodies(devices, estimated_cost(scene.family, *samples))
    given = devices.share((partition, *map(np.asarray, samples)))
    solve = batch_solver(flow, devices).lower(*given).compile()
    seconds = []
    for _ in range(1 + asked["rounds"]):
        start = time.perf_counter()
        found = jax.block_until_ready(solve(*given))
        seconds.append(time.perf_counter() - start)
    memory = solve.memory_analysis()
    if first():
        answer = {
            "flows_per_s": asked["bodies"] / float(np.median(seconds[1:])),
            "green_applications": np.asarray(found.green_applications).tolist(),
            "mib_per_lane": memory.temp_size_in_bytes / devices.lanes / 2**20,
            "device": jax.devices()[0].device_kind,
        }
        print(json.dumps(answer))


if __name__ == "__main__":
    main()
