"""The sample bodies of a training, prepared once: their cases and Oseen flows."""

import functools

import equinox as eqx
import jax
from jaxtyping import Array, Float

from surrogate.arrays import AnyArray
from surrogate.devices import Deal, Devices, Owned, deal_bodies
from surrogate.flow.flow import Flow
from surrogate.flow.grid.domain import Domain
from surrogate.flow.solver import steady
from surrogate.flow.solver.steady import Case, preparation_cost
from surrogate.flow.steps import hardness
from surrogate.training.samples import Samples


class Physics(eqx.Module):
    """Everything the physics operator of every sample needs.

    Cases stay with the bodies' owners; the tractions of Oseen flows are everybody's. In space,
    where a case takes tens of megabytes, only bodies and Reynolds numbers are kept and a case is
    prepared anew at every visit.
    """

    samples: Samples
    cases: Owned
    tractions: Float[AnyArray, "samples modes"]
    deal: Deal
    flow: Flow = eqx.field(static=True)

    @property
    def domain(self) -> Domain:
        return self.flow.domain

    @property
    def count(self) -> int:
        return self.samples.count

    def case(self, row: Array) -> Case:
        """Of a row of this device, in a visit: among those of the batch."""
        return self.unpacked(jax.tree.map(lambda leaf: leaf[row], self.cases.rows))

    def unpacked(self, kept: Case | tuple[Array, Array]) -> Case:
        """The case of what is kept of a sample."""
        return kept if isinstance(kept, Case) else _prepared(self.flow, *kept)

    @property
    def renewal(self) -> int:
        """Applications of G that a visit takes to prepare its case anew."""
        return 0 if isinstance(self.cases.rows, Case) else preparation_cost(self.domain)


def deal_samples(samples: Samples, devices: Devices) -> Deal:
    """Which device owns which sample."""
    return deal_bodies(devices, hardness(*samples))


@functools.partial(jax.jit, static_argnames="flow")
def prepare_physics(flow: Flow, samples: Samples, deal: Deal) -> tuple[Physics, Owned]:
    """Samples and velocities of their Oseen flows; ``preparation_cost`` applications of G each."""

    def one(sample):
        case = _prepared(flow, *sample)
        kept = sample if flow.scene.dimension == 3 else case
        return kept, steady.oseen_flow(flow.domain, case)

    cases, oseen = deal.each(one, deal.dealt(tuple(samples))).rows
    tractions = deal.gathered(Owned(oseen.amplitude))
    return Physics(samples, Owned(cases), tractions, deal, flow), Owned(oseen.velocity)


def _prepared(flow, parameters, reynolds):
    return steady.prepare(flow.domain, flow.markers(parameters), reynolds)
