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
from surrogate.flow.solver.steady import Case
from surrogate.flow.steps import hardness
from surrogate.training.samples import Samples


class Physics(eqx.Module):
    """Everything the physics operator of every sample needs.

    Cases and the velocities of the Oseen flows stay with the bodies' owners; the Oseen flows'
    tractions are everybody's.
    """

    samples: Samples
    cases: Owned
    velocities: Owned
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
        """Of a row of this device."""
        return jax.tree.map(lambda leaf: leaf[row], self.cases.rows)


def deal_samples(samples: Samples, devices: Devices) -> Deal:
    """Which device owns which sample."""
    return deal_bodies(devices, hardness(*samples))


@functools.partial(jax.jit, static_argnames="flow")
def prepare_physics(flow: Flow, samples: Samples, deal: Deal) -> Physics:
    """Prepare all samples; costs ``preparation_cost`` applications of G each."""

    def one(sample):
        case = steady.prepare(flow.domain, flow.markers(sample[0]), sample[1])
        return case, steady.oseen_flow(flow.domain, case)

    cases, oseen = deal.each(one, deal.dealt(tuple(samples))).rows
    tractions = deal.gathered(Owned(oseen.amplitude))
    return Physics(samples, Owned(cases), Owned(oseen.velocity), tractions, deal, flow)
