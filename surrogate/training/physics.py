"""The sample bodies of a training, prepared once: their cases and Oseen flows."""

import functools

import equinox as eqx
import jax
from jaxtyping import Array

from surrogate.flow.flow import Flow
from surrogate.flow.grid.domain import Domain
from surrogate.flow.solver import steady
from surrogate.flow.solver.steady import Case, FlowState
from surrogate.training.samples import Samples


class Physics(eqx.Module):
    """Everything the physics operator of every sample needs."""

    samples: Samples
    cases: Case
    oseen: FlowState
    flow: Flow = eqx.field(static=True)

    @property
    def domain(self) -> Domain:
        return self.flow.domain

    @property
    def count(self) -> int:
        return self.samples.count

    def case(self, index: Array) -> Case:
        return jax.tree.map(lambda leaf: leaf[index], self.cases)


@functools.partial(jax.jit, static_argnames="flow")
def prepare_physics(flow: Flow, samples: Samples) -> Physics:
    """Prepare all samples; costs ``preparation_cost`` applications of G each."""

    def one(sample):
        case = steady.prepare(flow.domain, flow.markers(sample[0]), sample[1])
        return case, steady.oseen_flow(flow.domain, case)

    cases, oseen = jax.lax.map(one, tuple(samples))
    return Physics(samples, cases, oseen, flow)
