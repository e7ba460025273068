"""A trained network as a drag model, with its scene and the record of its training."""

import dataclasses
import functools
import math
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from surrogate.arrays import Bodies, Body, Number, Numbers
from surrogate.checks import check_batch, finite_number, flag, real_numbers, shown, transformed
from surrogate.errors import InvalidInput
from surrogate.flow.forces import Conditions, Forces, forces_of
from surrogate.model.card import KINDS, inaccuracy_of, model_card, recorded_errors, unseen_bodies
from surrogate.model.confidence import Novelty, coverage
from surrogate.model.evaluation import loads_or_nan, network_loads, novelty_of_loads
from surrogate.model.network import LoadNetwork
from surrogate.model.outputs import LOAD_NAMES, SYMBOLS
from surrogate.model.ranges import TrainedRanges
from surrogate.scene.limits import check_reynolds
from surrogate.scene.samples import Samples, training_samples
from surrogate.scene.scene import Scene
from surrogate.summary import aligned


@dataclasses.dataclass(frozen=True, eq=False)
class Surrogate:
    """A trained network, the scene it was trained on, and the record of its training.

    It predicts loads. ``record["trained_for"]`` says whether the network's traction modes were
    trained too ("traction") or not ("drag", also where the record does not say).
    """

    network: LoadNetwork
    scene: Scene
    record: dict[str, Any]

    def __repr__(self) -> str:
        low, high = self.scene.reynolds
        method, error = self.record.get("method", "unknown"), self.record.get("drag_error_mean")
        known = "" if error is None else f", mean error of Cd {error:.3%}"
        names = ", ".join(self.scene.family.names)
        return f"Surrogate({method}; {names}; Re {low:g} to {high:g}{known})"

    def summary(self) -> str:
        """Return what the surrogate was trained on, and its errors, as lines of text."""
        low, high = self.scene.reynolds
        family = self.scene.family
        rows = {
            name: f"{a:g} to {b:g}"
            for name, (a, b) in zip(family.names, family.bounds, strict=True)
        }
        rows["Re"] = f"{low:g} to {high:g}"
        rows["method"] = str(self.record.get("method", "unknown"))
        for load, errors in recorded_errors(self.record).items():
            of = "on held-out bodies" if load == "drag" else "of Cd on held-out bodies"
            for kind, error in errors.items():
                rows[f"error of {SYMBOLS[load]}, {KINDS[kind]}"] = f"{error:.3%} {of}"
        return aligned(rows)

    @property
    def card(self) -> str:
        """Model card: ranges, errors, method, flow, and what the surrogate must not be used for."""
        return model_card(self.scene, self.record)

    def drag(
        self, parameters: Bodies, reynolds: Numbers, *, extrapolate: bool = False
    ) -> Float[Array, "*batch"]:
        """Return the drag coefficients Cd of bodies, one for each body and Reynolds number.

        Cd is 2 Fx per unit span in 2-D and 8 Fx / pi in 3-D, with U = D = rho = 1. Leading axes of
        the two arguments broadcast as in NumPy. Supports jit, vmap and grad in both arguments;
        under a transformation the drag is NaN where the eager call would raise.

        Args:
          parameters: of one body, shape (parameters,), in the order of ``scene.family.names``; of
            many, shape (..., parameters); or numbers, or arrays that broadcast, by name.
          reynolds: U D / nu, D the diameter of the circle (sphere) of equal area (volume).
          extrapolate: answer outside the trained ranges as well.

        Raises:
          InvalidInput: a body or a Reynolds number is invalid, or outside the trained ranges.
        """
        return self.loads(parameters, reynolds, extrapolate=extrapolate)[..., 0]

    def loads(
        self, parameters: Bodies, reynolds: Numbers, *, extrapolate: bool = False
    ) -> Float[Array, "*batch 3"]:
        """Return Cd, Cl and Cm of bodies, along a last axis.

        As ``drag``: Cl = 2 Fy, Cm = 2 M per unit span in 2-D; Cl = 8 Fz / pi, Cm = 8 M / pi in
        3-D; U = D = rho = 1, M about the centroid, nose up. Cl and Cm are 0 where all bodies of the
        scene are symmetric.

        Args:
          parameters: as for ``drag``.
          reynolds: as for ``drag``.
          extrapolate: answer outside the trained ranges as well.

        Raises:
          InvalidInput: as ``drag``.
        """
        parameters = self.scene.family.array(parameters)
        extrapolate = flag("extrapolate", extrapolate)
        by_jax = transformed(parameters, reynolds)
        if not by_jax:
            parameters, reynolds = self._checked(parameters, reynolds, extrapolate)
        check_batch(parameters, reynolds, len(self.scene.family.names))
        at = jnp.asarray(parameters, float), jnp.asarray(reynolds, float)
        if by_jax:
            return loads_or_nan(self.network, self.ranges, *at, extrapolate)
        loads = network_loads(self.network, *at)
        known = np.asarray(loads)
        if not np.all((known[..., 0] > 0) & np.isfinite(known).all(axis=-1)):
            raise InvalidInput("surrogate: its weights give drags that are no numbers above 0")
        return loads

    def forces(
        self,
        parameters: Body,
        reynolds: Number,
        *,
        speed: float,
        diameter: float,
        density: float,
        viscosity: float | None = None,
        extrapolate: bool = False,
    ) -> Forces:
        """Return the forces on a body in N and the moment in N m, in 2-D per metre of span.

        Args:
          parameters: as for ``drag``, of one body.
          reynolds: U D / nu.
          speed: of the stream, m/s.
          diameter: equivalent diameter D of the body, m.
          density: of the fluid, kg/m^3.
          viscosity: kinematic viscosity, m^2/s, to check that Re = U D / nu.
          extrapolate: answer outside the trained ranges as well.

        Raises:
          InvalidInput: as ``drag``; or a number is not positive, or U D / nu is not this Re.
        """
        conditions = Conditions(speed, diameter, density, viscosity)
        conditions.check(finite_number("Reynolds number", reynolds))
        body = self.scene.family.numbers(parameters)
        loads = self.loads(body, reynolds, extrapolate=extrapolate).tolist()
        coefficients = dict(zip(LOAD_NAMES, loads, strict=True))
        return forces_of(coefficients, conditions, self.scene.dimension)

    def error_bounds(self, parameters: Bodies, reynolds: Numbers) -> Float[np.ndarray, "*batch 3"]:
        """Return bounds for the errors of Cd, Cl and Cm, over Cd, against the flow solver.

        Each load's bound holds for 95 % of the bodies that ``Family.sample`` draws, with fewer
        than 19 held-out bodies for fewer (``bound_coverage``). It is wider where the training
        samples say less of the answer (``Novelty``), and scaled on the held-out bodies. The 95 %
        are of all these bodies together: of one kind of bodies, or near one end of a range, fewer
        errors may lie within their bounds (study ``confidence``). Outside the trained ranges
        nothing is known: bodies there are refused.

        Args:
          parameters: as for ``drag``.
          reynolds: as for ``drag``.

        Raises:
          InvalidInput: as ``drag``; an argument is traced by JAX; or the record lacks the scales,
            which older trainings did not write.
        """
        parameters = self.scene.family.array(parameters)
        if transformed(parameters, reynolds):
            raise InvalidInput(
                "error_bounds: is not for jit, vmap or grad; call it outside of them"
            )
        parameters, reynolds = self._checked(parameters, reynolds, extrapolate=False)
        scales = self.error_scales
        novelty = novelty_of_loads(self.novelty, parameters, reynolds)
        return np.pad(scales, (0, len(LOAD_NAMES) - len(scales))) * novelty

    def outside(self, parameters: Body, reynolds: Number) -> dict[str, float]:
        """Return how far each parameter and log Re lies outside its trained range, in range widths.

        Those inside are left out.

        Raises:
          InvalidInput: not finite numbers, not as many as the family has parameters, or a Reynolds
            number that is not above 0.
        """
        values = self.scene.family.numbers(parameters)
        if not np.isfinite(values).all():
            raise InvalidInput(f"body {shown(values.tolist())}: must be finite numbers")
        reynolds = finite_number("Reynolds number", reynolds)
        if reynolds <= 0:
            raise InvalidInput(f"Reynolds number {reynolds:g}: must be a finite number above 0")
        low, high = self.ranges.bounds.T
        excess = np.asarray(self.ranges.excess(values, np.asarray(reynolds)))
        distance = excess / np.where(high > low, high - low, 1.0)
        pairs = zip(self.ranges.names, distance.tolist(), strict=True)
        return {name: d for name, d in pairs if d > 0}

    @property
    def unseen(self) -> int:
        """Number of held-out bodies on which the recorded errors were measured.

        These are the bodies whose flows converged.

        Raises:
          InvalidInput: the record lacks the number of held-out bodies.
        """
        self.recorded("held_out")
        return unseen_bodies(self.record)

    @property
    def bound_coverage(self) -> float:
        """Share of bodies for which ``error_bounds`` hold: 0.95, less with few held-out bodies.

        Raises:
          InvalidInput: as ``unseen``.
        """
        return coverage(self.unseen)

    @property
    def ranges(self) -> TrainedRanges:
        """Ranges of the shape parameters and of log Re in which it was trained."""
        return TrainedRanges(self.scene)

    @property
    def inaccuracy(self) -> str | None:
        """Text of a warning about a large error; None if its error is not large.

        The error on held-out bodies is large where its mean exceeds the error tolerance of the
        flow, ``scene.fidelity.tolerance``, so that the network errs more than the flow that it
        stands for; or where its maximum exceeds 10 times that.
        """
        return inaccuracy_of(self.scene, self.record)

    def recorded(self, key: str) -> Any:
        """Return the value of ``key`` in the record.

        Raises:
          InvalidInput: the record lacks it.
        """
        if key not in self.record:
            raise InvalidInput(f"surrogate: its record lacks {key}, which a training writes")
        return self.record[key]

    @property
    def training_samples(self) -> Samples:
        """Bodies and Reynolds numbers on which it was trained, by its record.

        Raises:
          InvalidInput: the record lacks their seed or number.
        """
        drawn = self.recorded("seed"), self.recorded("samples"), self.record.get("infill", ())
        return training_samples(self.scene, *drawn, self.record.get("symmetric_share", 0.0))

    @property
    def error_scales(self) -> Float[np.ndarray, " loads"]:
        """Factors by which the novelty of each load is multiplied to bound its error.

        Raises:
          InvalidInput: the record lacks them, which older trainings did not write.
        """
        known = LOAD_NAMES if self.scene.family.has_lift else LOAD_NAMES[:1]
        return np.array([self.recorded(f"{name}_error_scale") for name in known])

    @functools.cached_property
    def novelty(self) -> Novelty:
        """Measure of how little the training samples say about the loads of other bodies."""
        return Novelty.of_answers(self.network, self.training_samples)

    def _checked(self, parameters, reynolds, extrapolate):
        """Return bodies and Reynolds numbers as arrays, refusing what cannot be answered."""
        family, many = self.scene.family, real_numbers(parameters)
        if many is None or many.ndim < 2:
            parameters = family.check(parameters)
        else:
            rows = many.reshape(math.prod(many.shape[:-1]), many.shape[-1])
            parameters = family.check_all(rows).reshape(many.shape)
        many = real_numbers(reynolds)
        extremes = (many.min(), many.max()) if many is not None and many.size else (reynolds,)
        for value in extremes if np.size(many) else ():
            check_reynolds(value, self.scene.dimension)
        reynolds = np.asarray(reynolds, float)
        check_batch(parameters, reynolds, len(family.names))
        if not extrapolate and (outside := self.ranges.outside(parameters, reynolds)):
            raise InvalidInput(
                f"outside the trained ranges: {outside}; extrapolate=True (predict_drag.py "
                "--extrapolate) answers all the same"
            )
        return parameters, reynolds
