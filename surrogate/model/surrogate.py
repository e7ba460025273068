"""A trained network as a drag model, with its scene and the record of its training."""

import dataclasses
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from surrogate.arrays import Body, Number
from surrogate.body.body_class import MIN_THICKNESS_RATIO
from surrogate.checks import finite_number, one_body, traced
from surrogate.errors import InvalidInput
from surrogate.model.network import DragNetwork
from surrogate.scene.limits import check_reynolds
from surrogate.scene.scene import Scene

SLACK = 1e-9  # by which a value may exceed its range, in range widths: rounding


@dataclasses.dataclass(frozen=True, eq=False)
class Surrogate:
    """A trained network, the scene it was trained on, and the record of its training.

    It predicts drags. ``record["trained_for"]`` says whether the network's traction modes were
    trained too ("traction") or not ("drag", also where the record does not say).
    """

    network: DragNetwork
    scene: Scene
    record: dict[str, Any]

    def drag(
        self,
        parameters: Body,
        reynolds: Number,
        extrapolate: bool = False,
    ) -> Float[Array, ""]:
        """Drag coefficient of a body: Cd = 2 Fx per unit span in 2-D, 8 Fx / pi in 3-D.

        Supports jit, vmap and grad in both arguments. Under a transformation the drag outside the
        trained ranges is NaN instead of an error, unless ``extrapolate``; that of a body that
        crosses itself always is.

        Args:
          parameters: of the body, in the order of ``scene.family.names``.
          reynolds: U D / nu, D the diameter of the circle (sphere) of equal area (volume).
          extrapolate: answer outside the trained ranges as well.

        Raises:
          InvalidInput: the body or the Reynolds number is invalid, or outside the trained ranges.
        """
        if not traced(parameters, reynolds):
            parameters = self.scene.family.check(parameters)
            reynolds = check_reynolds(reynolds, True, self.scene.dimension)
            if (outside := self.beyond(parameters, reynolds)) and not extrapolate:
                raise InvalidInput(f"{_message(outside)}; extrapolate=True would answer it")
        else:
            one_body(parameters, reynolds, len(self.scene.family.names))
        re = jnp.asarray(reynolds, float)
        cd = self.network.drag(jnp.asarray(parameters, float), re)
        if not traced(parameters, reynolds):
            if not 0 < float(cd) < np.inf:
                raise InvalidInput(f"surrogate: its weights give Cd {float(cd):g}; it is damaged")
            return cd
        low, high = self._bounds.T
        values = jnp.append(jnp.asarray(parameters, float), jnp.log(re))
        inside = jnp.maximum(low - values, values - high) <= SLACK * (high - low + 1)
        valid = jnp.all(inside) | bool(extrapolate)
        valid &= (
            self.scene.family.body_class.min_thickness_ratio(values[:-1]) >= MIN_THICKNESS_RATIO
        )
        return cd * jnp.where(valid, 1.0, jnp.nan)  # a factor, so that the gradient is NaN too

    def knows(self, parameters: Body, reynolds: Number) -> bool:
        """Whether body and Reynolds number lie within the trained ranges.

        Raises:
          InvalidInput: not numbers, or not as many as the family has parameters.
        """
        return not self.beyond(parameters, reynolds)

    def beyond(self, parameters: Body, reynolds: Number) -> dict[str, float]:
        """Distance of each parameter and log Re outside its trained range, in range widths.

        Those inside are left out.

        Raises:
          InvalidInput: not numbers, or not as many as the family has parameters.
        """
        values = self.scene.family.numbers(parameters)
        reynolds = finite_number("Reynolds number", reynolds)
        if reynolds <= 0:
            raise InvalidInput(f"Reynolds number {reynolds:g}: must be a finite number above 0")
        values = np.append(values, np.log(reynolds))
        low, high = self._bounds.T
        distance = np.maximum(low - values, values - high) / np.maximum(high - low, SLACK)
        names = (*self.scene.family.names, "log Re")
        pairs = zip(names, distance, strict=True)
        return {name: float(d) for name, d in pairs if not d <= SLACK}

    def recorded(self, key: str) -> Any:
        """A value of the record.

        Raises:
          InvalidInput: the record lacks it.
        """
        if key not in self.record:
            raise InvalidInput(f"surrogate: its record lacks {key}, which a training writes")
        return self.record[key]

    @property
    def _bounds(self):
        return np.concatenate([self.scene.family.bounds, np.log([self.scene.reynolds])])


def _message(outside):
    worst = max(outside, key=lambda name: outside[name])
    return f"outside the trained ranges: {worst} by {outside[worst]:.2g} of its range"
