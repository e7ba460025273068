"""Flow and adjoint flow of any body of a scene, guessed from solved ones.

The fields of solved bodies have few degrees of freedom (proper orthogonal decomposition, Sirovich
1987); their coefficients are interpolated over shape and Reynolds number by radial basis
functions. About half a per cent off: where a certificate starts, not an answer.
"""

import dataclasses
import functools
import json
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from scipy.interpolate import RBFInterpolator

from surrogate.arrays import AnyArray
from surrogate.body import family_markers
from surrogate.errors import InvalidInput, NotConverged
from surrogate.files import whole_file
from surrogate.flow import steady
from surrogate.flow.domain import Domain
from surrogate.flow.drag import ADJOINT
from surrogate.flow.far import far_response, refinement
from surrogate.flow.lattice import Lattice
from surrogate.flow.tangent import drag_adjoint
from surrogate.scene import Scene
from surrogate.store import BROKEN, PRETRAINED, read_scene, scene_record
from surrogate.training.physics import Samples, scene_domain

FORMAT = 1
SHIPPED = PRETRAINED / "flows.npz"
BETA_SCALE = 0.6  # distance of a range of a beta against one of the aspect or log Re
FEWEST = 32  # samples: the quadratic part alone takes 21
FAR_NODES = 16  # Reynolds numbers of the far field, which knows no shape


class Fields(NamedTuple):
    """On the stored faces: u', the adjoint velocity mu = G^T lambda_u, the far response."""

    velocity: Float[AnyArray, "*bodies 2 nx ny"]
    adjoint: Float[AnyArray, "*bodies 2 nx ny"]
    far: Float[AnyArray, "*bodies 2 nx ny"]


@dataclasses.dataclass(frozen=True)
class Basis:
    """One field: mean and modes on the stored faces, coefficients at known inputs."""

    inputs: Float[AnyArray, "samples inputs"]
    coefficients: Float[AnyArray, "samples rank"]
    mean: Float[AnyArray, "2 nx ny"]
    modes: Float[AnyArray, "rank 2 nx ny"]

    @functools.cached_property
    def _interpolant(self) -> RBFInterpolator:
        return RBFInterpolator(self.inputs, self.coefficients, kernel="quintic", degree=2)

    def guess(self, inputs: Float[AnyArray, "bodies inputs"]) -> Float[AnyArray, "bodies ..."]:
        """The field at other inputs."""
        return self.mean + np.tensordot(self._interpolant(inputs), self.modes, axes=1)


class Bases(NamedTuple):
    """One for each of ``Fields``."""

    velocity: Basis
    adjoint: Basis
    far: Basis


@dataclasses.dataclass(frozen=True)
class ReducedFlow:
    """What is known of the flows of a scene, and the record of how it came about."""

    scene: Scene
    bases: Bases
    record: dict[str, Any]

    def guess(self, samples: Samples) -> Fields:
        """Fields of bodies (leading axis: bodies) on the faces of the stored lattice."""
        shape = _inputs(self.scene, samples)
        velocity, adjoint, far = self.bases
        return Fields(velocity.guess(shape), adjoint.guess(shape), far.guess(shape[:, -1:]))


def stored_lattice(lattice: Lattice) -> Lattice:
    """Every second face of a window where that divides it, else every face: what is kept."""
    (nx, ny), (dx, dy) = lattice.shape, lattice.step
    if nx % 2 or ny % 2 or lattice.inlet % 2:
        return lattice
    return dataclasses.replace(
        lattice, shape=(nx // 2, ny // 2), step=(2 * dx, 2 * dy), inlet=lattice.inlet // 2
    )


def reduce_flow(
    scene: Scene,
    samples: Samples,
    rank: int = 32,
    report: Callable[[float], None] = lambda done: None,
) -> tuple[ReducedFlow, int]:
    """Solve flow and adjoint of every sample, keep ``rank`` modes; returns applications of G too.

    Raises:
      InvalidInput: too few samples, or a range of the scene is a single point.
      NotConverged: a flow or an adjoint was not found.
    """
    domain, count = scene_domain(scene), len(samples.reynolds)
    if count < FEWEST:
        raise InvalidInput(f"{count} samples: reduced flows need {FEWEST} or more")
    if np.any(np.ptp(np.array([*scene.family.bounds, scene.reynolds]), axis=1) <= 0):
        raise InvalidInput("scene: every range must be wider than a point for reduced flows")
    fields: tuple[list, list] = ([], [])
    work = 0
    for k, sample in enumerate(zip(*samples, strict=True)):
        velocity, adjoint, products, converged = _solve(domain, *sample)
        if not bool(converged):
            raise NotConverged(f"body {k} at Re {float(sample[1]):g}: flow or adjoint not found")
        fields[0].append(np.asarray(velocity))
        fields[1].append(np.asarray(adjoint))
        work += int(products)
        report((k + 1) / count)
    inputs = _inputs(scene, samples)
    waves = -np.cos(np.pi * (np.arange(FAR_NODES) + 0.5) / FAR_NODES)
    reynolds = np.exp(np.interp(waves, (-1, 1), np.log(scene.reynolds)))
    far = np.array([_far(domain, jnp.asarray(re)) for re in reynolds])
    work += 2 * FAR_NODES * len(domain.far)
    bases = Bases(
        _decompose(inputs, np.array(fields[0]), rank),
        _decompose(inputs, np.array(fields[1]), rank),
        _decompose(waves[:, None], far, 8),
    )
    return ReducedFlow(scene, bases, {"samples": count}), work


@functools.partial(jax.jit, static_argnames="domain")
def _solve(domain: Domain, parameters, reynolds):
    case = steady.prepare(domain, family_markers(parameters, domain.nodes), reynolds)
    state, info = steady.body_flow(domain, case)
    dual, cost = drag_adjoint(domain, case, state, ADJOINT)
    (adjoint,) = jax.linear_transpose(case.kernel, state.velocity)(dual.velocity.astype(float))
    keep = refinement(stored_lattice(domain.lattice), domain.lattice)
    products = steady.preparation_cost(domain) + info.products + cost.products + 1
    return keep(state.velocity), keep(adjoint), products, info.converged & cost.converged


@functools.partial(jax.jit, static_argnames="domain")
def _far(domain, reynolds):
    far = far_response(domain.lattice, domain.far, reynolds, domain.height, lift=False)
    return refinement(stored_lattice(domain.lattice), domain.lattice)(far[0])


def _decompose(inputs, fields, rank):
    """Leading modes of fields about their mean, by the method of snapshots."""
    mean = fields.mean(axis=0)
    flat = (fields - mean).reshape(len(fields), -1)
    energy, vectors = np.linalg.eigh(flat @ flat.T)
    energy, vectors = energy[::-1][:rank], vectors[:, ::-1][:, :rank]
    kept = energy > 1e-12 * energy[0]
    modes = (vectors[:, kept] / np.sqrt(energy[kept])).T @ flat
    modes = modes.astype(np.float16).astype(float)  # as stored
    return Basis(inputs, flat @ modes.T, mean, modes.reshape(-1, *mean.shape))


def _inputs(scene, samples):
    """Shape and log Re in [-1, 1], the betas nearer together: they bend the flow less."""
    bounds = np.concatenate([scene.family.bounds, np.log([scene.reynolds])])
    low, high = bounds.T
    raw = np.column_stack([np.asarray(samples.parameters), np.log(np.asarray(samples.reynolds))])
    weights = np.array([1.0, BETA_SCALE, BETA_SCALE, BETA_SCALE, 1.0])
    return weights * (2 * (raw - low) / (high - low) - 1)


def save_reduced(path: str | Path, reduced: ReducedFlow) -> None:
    """Write one file, whole or not at all; modes in half precision."""
    arrays = {
        f"{name}_{part}": array.astype(kind)
        for name, basis in zip(Bases._fields, reduced.bases, strict=True)
        for part, array, kind in (
            ("inputs", basis.inputs, float),
            ("coefficients", basis.coefficients, float),
            ("mean", basis.mean, np.float32),
            ("modes", basis.modes, np.float16),
        )
    }
    record = {**reduced.record, "format": FORMAT, "scene": scene_record(reduced.scene)}
    with whole_file(path) as part, part.open("wb") as file:
        np.savez_compressed(file, record=np.array(json.dumps(record)), **arrays)


def load_reduced(path: str | Path = SHIPPED) -> ReducedFlow:
    """Read what ``save_reduced`` wrote.

    Raises:
      InvalidInput: missing, damaged or something else.
    """
    try:
        with np.load(path, allow_pickle=False) as saved:
            record = json.loads(str(saved["record"]))
            if record.pop("format") != FORMAT:
                raise InvalidInput(f"flows {path}: of another format than {FORMAT}")
            scene = read_scene(record.pop("scene"))
            parts = ("inputs", "coefficients", "mean", "modes")
            bases = [
                Basis(*(saved[f"{name}_{part}"].astype(float) for part in parts))
                for name in Bases._fields
            ]
        _check(scene, bases)
    except FileNotFoundError:
        raise InvalidInput(f"flows {path}: no such file; reduce_flow.py makes one") from None
    except (*BROKEN, zipfile.BadZipFile, zlib.error) as problem:
        if isinstance(problem, InvalidInput):
            raise
        raise InvalidInput(f"flows {path}: damaged, or not reduced flows") from None
    return ReducedFlow(scene, Bases(*bases), record)


def _check(scene, bases):
    """Raise ValueError unless arrays fit each other and the scene's window."""
    shape = (2, *stored_lattice(scene_domain(scene).lattice).shape)
    for basis in bases:
        pair = len(basis.inputs), len(basis.modes)
        fits = basis.mean.shape == shape == basis.modes.shape[1:]
        finite = all(np.all(np.isfinite(array)) for array in dataclasses.astuple(basis))
        if not (fits and finite and basis.coefficients.shape == pair):
            raise ValueError
