"""The flow solver of a training: operators of all samples, loads of their Oseen flows."""

import functools
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from surrogate.arrays import AnyArray
from surrogate.body.family import Family
from surrogate.devices import Devices, Sharded
from surrogate.flow.batch import estimated_cost
from surrogate.flow.flow import Flow
from surrogate.flow.grid.domain import Domain
from surrogate.flow.loads import load_values
from surrogate.flow.solver import steady
from surrogate.flow.solver.steady import Operators
from surrogate.model.outputs import outputs_of
from surrogate.partition import Evaluated, Partition, partition_bodies
from surrogate.scene.samples import Samples

StoredOperators = Operators | tuple[Array, Array]  # or parameters and Reynolds number, where large


class Sample(eqx.Module):
    """One sample during its evaluation: body, Reynolds number, traction of its Oseen flow."""

    parameters: Float[AnyArray, " parameters"]
    reynolds: Float[AnyArray, ""]
    oseen: Float[AnyArray, " modes"]
    stored: StoredOperators  # of all samples on this device
    row: Int[AnyArray, ""]
    flow: Flow = eqx.field(static=True)

    @property
    def domain(self) -> Domain:
        """Computational domain of the flow solver."""
        return self.flow.domain

    def loads(self, amplitude: Float[AnyArray, " modes"]) -> Float[Array, " loads"]:
        """Return Cd, and where there is lift Cl and Cm, of a traction on this body."""
        return _loads(self.flow, self.parameters, amplitude)

    def outputs(self, amplitude: Float[AnyArray, " modes"]) -> Float[Array, " loads"]:
        """Return log Cd (, and with lift Cl / Cd and Cm / Cd) of a traction on this body."""
        return outputs_of(self.loads(amplitude))

    def start(self, operators: Operators, last: Float[Array, "axes ..."]) -> Array:
        """Return the velocity from which a flow is solved: the last one, or that of the Oseen flow.

        There is no last one where ``last`` is zero.
        """
        return jnp.where(jnp.any(last), last, operators.response(self.oseen))

    @property
    def renewal(self) -> int:
        """Convolutions that ``operators`` takes: 0 where the operators are stored."""
        return 0 if isinstance(self.stored, Operators) else self.domain.assembly_cost

    def operators(self) -> Operators:
        """Return the operators of the flow solver; where they are large they are assembled here."""
        return restored(self.flow, jax.tree.map(lambda leaf: leaf[self.row], self.stored))


class Physics(eqx.Module):
    """The flow solver of all training samples, apart from the last velocities of their flows.

    Operators are sharded; samples, the tractions and outputs of their Oseen flows and the influence
    matrices dy/da of these are replicated. In 3-D, and of lifting bodies, the operators of a sample
    take tens of megabytes: only its parameters are stored, and every evaluation assembles anew.
    """

    samples: Samples
    operators: Sharded
    tractions: Float[AnyArray, "samples modes"]
    outputs: Float[AnyArray, "samples loads"]
    influence: Float[AnyArray, "samples modes modes"]
    partition: Partition
    flow: Flow = eqx.field(static=True)

    @property
    def domain(self) -> Domain:
        """Computational domain of the flow solver."""
        return self.flow.domain

    @property
    def count(self) -> int:
        """Number of samples."""
        return self.samples.count

    @property
    def velocity_shape(self) -> tuple[int, ...]:
        """Shape of the velocity of one sample: its components, then the cells of the lattice."""
        return self.domain.lattice.dimension, *self.domain.lattice.shape

    def evaluate(
        self, batch: Array, velocities: Sharded, function: Callable, *arguments: Array | tuple
    ) -> Evaluated:
        """Evaluate a function of each sample of a batch with its operators and last velocity.

        Runs inside ``shard_map``, on this device's rows of operators and velocities; see
        ``Partition.evaluate``.

        Args:
          batch: indices of the samples; the index ``count`` is padding.
          velocities: this device's rows.
          function: ``(sample, velocity, *arguments) -> (result, velocity)``; a result has a field
            ``convolutions``, the number of convolutions that it took.
          arguments: pytrees with one row per entry of the batch.

        Returns:
          The results, replicated, this device's new velocities, and the idle work.
        """

        def evaluate_sample(row, velocity, argument):
            (parameters, reynolds), oseen, arguments = argument
            sample = Sample(parameters, reynolds, oseen, self.operators.rows, row, self.flow)
            return function(sample, velocity, *arguments)

        replicated = self.samples.at(batch), self.tractions[batch], arguments
        return self.partition.evaluate(batch, velocities, evaluate_sample, replicated)


def partition_samples(family: Family, samples: Samples, devices: Devices) -> Partition:
    """Balance samples over devices by the estimated cost of their flows."""
    return partition_bodies(devices, estimated_cost(family, *samples))


@functools.partial(jax.jit, static_argnames="flow")
def prepare_physics(flow: Flow, samples: Samples, partition: Partition) -> Physics:
    """Assemble the operators of all samples and solve their Oseen flows.

    Takes ``assembly_cost`` convolutions per sample.

    Args:
      flow: solver of the scene.
      samples: bodies and Reynolds numbers, replicated.
      partition: of the samples over devices.
    """

    def prepare(sample):
        operators = restored(flow, sample)
        stored = operators if flow.domain.operators_are_small else sample
        oseen = steady.eliminate(operators).oseen_flow()
        influence = steady.influence_matrix(operators)
        outputs = outputs_of(_loads(flow, sample[0], oseen.amplitude))
        return stored, (oseen.amplitude, outputs, influence)

    rows = partition.map(prepare, partition.scatter(tuple(samples))).rows
    stored, small = (Sharded(part) for part in rows)
    return Physics(samples, stored, *partition.gather(small), partition, flow)


def _loads(flow, parameters, amplitude):
    bodies = flow.bodies
    return load_values(bodies.domain.modes, bodies.loads, amplitude, bodies.markers(parameters))


def restored(flow: Flow, stored: StoredOperators) -> Operators:
    """Return the operators of a sample, assembled where only its parameters are stored."""
    if isinstance(stored, Operators):
        return stored
    parameters, reynolds = stored
    return steady.assemble(flow.domain, flow.bodies.markers(parameters), reynolds)
