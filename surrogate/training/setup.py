"""The setup of a training: what all methods share, samples, flows, operators, initial network."""

import time
from typing import NamedTuple

import jax
import numpy as np

from surrogate.compilation import same_options
from surrogate.devices import Devices, choose_devices
from surrogate.flow.batch import FlowBatch
from surrogate.flow.flow import Flow
from surrogate.model.network import LoadNetwork, make_network
from surrogate.scene.samples import Samples, network_key
from surrogate.training.held_out import Report, silent, solve_held_out
from surrogate.training.physics import Physics, partition_samples, prepare_physics
from surrogate.training.plan import Plan


class TrainingSetup(NamedTuple):
    """The part of a training that all methods share: flow solver, held-out flows, initial network.

    ``labels`` are the flows of the held-out bodies, those that were not found being left out and
    counted. ``setup_s`` are the seconds of assembling the operators, ``compile_s`` those of
    compiling that.
    """

    physics: Physics
    held_out: Samples
    labels: FlowBatch
    held_out_failed: int
    network: LoadNetwork
    setup_s: float
    compile_s: float


def make_setup(
    plan: Plan, devices: Devices | None = None, report: Report = silent
) -> TrainingSetup:
    """Draw samples, solve the held-out flows, assemble operators, build the initial network.

    Depends on the plan's scene, seed, counts, infill and width, not on its method.

    Args:
      plan: of the training.
      devices: over which the flows are distributed; by default those of ``choose_devices``.
      report: called with the number of held-out flows that are solved, and of all of them.

    Raises:
      InvalidInput: bodies of the scene do not fit its domain or tunnel, or one of the samples is
        thinner than the grid resolves.
      NotConverged: more than a tenth of the held-out flows, at least two, or all of them did not
        converge.
    """
    flow, devices = Flow(plan.scene), devices or choose_devices()
    held_out, labels = solve_held_out(flow, plan, devices, report)
    samples = plan.training_samples
    flow.bodies.check(samples.parameters)
    samples, partition = devices.place(
        (samples, partition_samples(plan.scene.family, samples, devices))
    )
    start = time.perf_counter()
    options = same_options(plan.scene.dimension)
    prepare = prepare_physics.lower(flow, samples, partition).compile(options)
    compiled = time.perf_counter()
    physics = jax.block_until_ready(prepare(samples, partition))
    setup_s, compile_s = time.perf_counter() - compiled, compiled - start
    arrays = map(np.asarray, (*samples, physics.tractions, physics.outputs))
    network = make_network(plan.scene, network_key(plan.seed), *arrays, plan.width)
    failed = plan.held_out - held_out.count
    return TrainingSetup(physics, held_out, labels, failed, network, setup_s, compile_s)
