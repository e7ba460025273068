"""A trained network as a drag model: what it knows, and how it came about."""

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

SLACK = 1e-9  # of a range's width, for rounding


@dataclasses.dataclass(frozen=True, eq=False)
class Surrogate:
    """A trained network with the scene it knows and the record of how it came about."""

    network: DragNetwork
    scene: Scene
    record: dict[str, Any]

    def drag(
        self,
        parameters: Body,
        reynolds: Number,
        extrapolate: bool = False,
    ) -> Float[Array, ""]:
        """Cd = 2 Fx per unit span, in space 8 Fx / pi, of a family body.

        For jit, vmap and jax.grad in both arguments. Under a transformation, what lies outside
        the trained ranges is NaN unless ``extrapolate``, and a body that crosses itself always.

        Raises:
          InvalidInput: no such body or Reynolds number, or outside the trained ranges.
        """
        if not traced(parameters, reynolds):
            parameters = self.scene.family.check(parameters)
            reynolds = check_reynolds(reynolds, True, self.scene.dimension)
            if (beyond := self.beyond(parameters, reynolds)) and not extrapolate:
                raise InvalidInput(f"{_words(beyond)}; extrapolate=True asks for it all the same")
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
        known = jnp.all(inside) | bool(extrapolate)
        thickness_ratio = self.scene.family.body_class.min_thickness_ratio(values[:-1])
        known &= thickness_ratio >= MIN_THICKNESS_RATIO
        return cd * jnp.where(known, 1.0, jnp.nan)  # so is its gradient

    def knows(self, parameters: Body, reynolds: Number) -> bool:
        """Whether body and Reynolds number lie within the trained ranges.

        Raises:
          InvalidInput: they are no numbers, or not as many as the family has.
        """
        return not self.beyond(parameters, reynolds)

    def beyond(self, parameters: Body, reynolds: Number) -> dict[str, float]:
        """How far each parameter, or log Re, lies outside its trained range, in ranges.

        Raises:
          InvalidInput: they are no numbers, or not as many as the family has.
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
        """A value of the record, as trainings leave it.

        Raises:
          InvalidInput: the record lacks it.
        """
        if key not in self.record:
            raise InvalidInput(f"surrogate: its record lacks {key}, which a training writes")
        return self.record[key]

    @property
    def _bounds(self):
        return np.concatenate([self.scene.family.bounds, np.log([self.scene.reynolds])])


def _words(beyond):
    worst = max(beyond, key=lambda name: beyond[name])
    return f"outside the trained ranges: {worst} by {beyond[worst]:.2g} of its range"
