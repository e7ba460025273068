"""The sample bodies of a training, prepared once: their operators and Oseen flows."""

import functools

import equinox as eqx
import jax
from jaxtyping import Array, Float

from surrogate.arrays import AnyArray
from surrogate.body.family import Family
from surrogate.devices import Devices, Partition, Sharded, partition_bodies
from surrogate.flow.batch import estimated_cost
from surrogate.flow.flow import Flow
from surrogate.flow.grid.domain import Domain
from surrogate.flow.solver import steady
from surrogate.flow.solver.steady import Operators
from surrogate.training.samples import Samples


class Physics(eqx.Module):
    """Everything the physics operator of every sample needs.

    Cases stay with the bodies' owners; the tractions of Oseen flows are everybody's. In space,
    where a case takes tens of megabytes, only bodies and Reynolds numbers are kept and a case is
    prepared anew at every visit.
    """

    samples: Samples
    operators: Sharded
    tractions: Float[AnyArray, "samples modes"]
    partition: Partition
    flow: Flow = eqx.field(static=True)

    @property
    def domain(self) -> Domain:
        return self.flow.domain

    @property
    def count(self) -> int:
        return self.samples.count

    def operators_of(self, row: Array) -> Operators:
        """Of a row of this device, in a visit: among those of the batch."""
        return self.unpacked(jax.tree.map(lambda leaf: leaf[row], self.operators.rows))

    def unpacked(self, kept: Operators | tuple[Array, Array]) -> Operators:
        """The operators of what is kept of a sample."""
        return kept if isinstance(kept, Operators) else _prepared(self.flow, *kept)

    @property
    def renewal(self) -> int:
        """Applications of G that a visit takes to prepare its operators anew."""
        return 0 if isinstance(self.operators.rows, Operators) else self.domain.assembly_cost


def partition_samples(family: Family, samples: Samples, devices: Devices) -> Partition:
    """Which device owns which sample."""
    return partition_bodies(devices, estimated_cost(family, *samples))


@functools.partial(jax.jit, static_argnames="flow")
def prepare_physics(flow: Flow, samples: Samples, partition: Partition) -> tuple[Physics, Sharded]:
    """Samples and velocities of their Oseen flows; ``assembly_cost`` applications of G each."""

    def one(sample):
        operators = _prepared(flow, *sample)
        kept = sample if flow.scene.dimension == 3 else operators
        return kept, steady.oseen_flow(flow.domain, operators)

    operators, oseen = partition.each(one, partition.scatter(tuple(samples))).rows
    tractions = partition.gather(Sharded(oseen.amplitude))
    return Physics(samples, Sharded(operators), tractions, partition, flow), Sharded(oseen.velocity)


def _prepared(flow, parameters, reynolds):
    return steady.assemble(flow.domain, flow.markers(parameters), reynolds)
