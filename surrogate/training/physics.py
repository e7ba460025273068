"""The sample bodies of a training, prepared once: their cases, Oseen tractions and stored flows."""

import functools
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from surrogate.arrays import AnyArray
from surrogate.body import family_markers
from surrogate.errors import NotConverged
from surrogate.flow import steady
from surrogate.flow.domain import Domain, make_domain
from surrogate.flow.steady import Case, FlowState
from surrogate.scene import Scene


class Samples(NamedTuple):
    """Bodies and Reynolds numbers."""

    parameters: Float[AnyArray, "samples parameters"]
    reynolds: Float[AnyArray, " samples"]


class Physics(eqx.Module):
    """Everything the physics operator of every sample needs."""

    samples: Samples
    cases: Case
    oseen: FlowState
    domain: Domain = eqx.field(static=True)

    @property
    def count(self) -> int:
        return self.samples.reynolds.size

    def case(self, index: Array) -> Case:
        return jax.tree.map(lambda leaf: leaf[index], self.cases)


def scene_domain(scene: Scene) -> Domain:
    """The domain that holds every body of a scene, and the cylinder, at every Re of it."""
    extent = tuple(max(side, 1.0) for side in scene.family.extent)
    fidelity = scene.fidelity.reaching(scene.reynolds[1], extent[1])
    return make_domain(scene.stream, fidelity, extent, symmetric=True)


def draw_samples(scene: Scene, key: jax.Array, count: int) -> Samples:
    """Bodies uniform in the family's bounds, Re uniform in its logarithm."""
    shape_key, re_key = jax.random.split(key)
    low, high = np.log(scene.reynolds)
    return Samples(
        scene.family.sample(shape_key, count),
        jnp.exp(jax.random.uniform(re_key, (count,), minval=low, maxval=high)),
    )


@functools.partial(jax.jit, static_argnames="domain")
def prepare_physics(domain: Domain, samples: Samples) -> Physics:
    """Prepare all samples; costs ``preparation_cost`` applications of G each."""

    def one(sample):
        parameters, reynolds = sample
        case = steady.prepare(domain, family_markers(parameters, domain.nodes), reynolds)
        return case, steady.oseen_flow(domain, case)

    cases, oseen = jax.lax.map(one, samples)
    return Physics(samples, cases, oseen, domain)


class Labels(NamedTuple):
    """Solved body flows of samples: traction, cost, and whether each solve converged."""

    amplitude: Float[AnyArray, "samples modes"]
    products: Array
    converged: Array


@functools.partial(jax.jit, static_argnames="domain")
def solve_labels(domain: Domain, samples: Samples) -> Labels:
    """Body flow of every sample, one after another."""

    def one(sample):
        parameters, reynolds = sample
        case = steady.prepare(domain, family_markers(parameters, domain.nodes), reynolds)
        state, info = steady.body_flow(domain, case)
        products = info.products + steady.preparation_cost(domain)
        return Labels(state.amplitude, products, info.converged)

    return jax.lax.map(one, samples)


def require_converged(labels: Labels) -> Labels:
    """Raise NotConverged where a label is missing."""
    missing = int(np.sum(~np.asarray(labels.converged)))
    if missing:
        raise NotConverged(f"{missing} of {len(labels.converged)} reference flows did not converge")
    return labels
