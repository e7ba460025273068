"""The network: (shape parameters, log Re) to traction modes; the drag is twice the zeroth one."""

import itertools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Float

from surrogate.arrays import AnyArray
from surrogate.flow.loads.forces import drag_coefficient
from surrogate.scene.scene import Scene


class DragNetwork(eqx.Module):
    """Small MLP inside fixed scales: inputs to [-1, 1], outputs by the Oseen flows' spread.

    a = s(Re) (mean + spread * MLP(input)), the MLP with tanh; log s is a quadratic in log Re.
    """

    layers: tuple[eqx.nn.Linear, ...]
    low: Float[AnyArray, " inputs"]
    high: Float[AnyArray, " inputs"]
    size: Float[AnyArray, " 3"]
    mean: Float[AnyArray, " modes"]
    spread: Float[AnyArray, " modes"]

    def __call__(
        self, parameters: Float[AnyArray, " parameters"], reynolds: Float[AnyArray, ""]
    ) -> Float[AnyArray, " modes"]:
        """Traction modes (force of the body on the fluid, U = D = rho = 1)."""
        low, high, size, mean, spread = jax.lax.stop_gradient(
            (self.low, self.high, self.size, self.mean, self.spread)
        )
        log_re = jnp.log(reynolds)
        inputs = jnp.concatenate([parameters, log_re[None]])
        width = jnp.where(high > low, high - low, 1.0)  # a scene of one Re has none
        scaled = 2 * (inputs - low) / width - 1
        return jnp.exp(jnp.polyval(size, log_re)) * (mean + spread * self._mlp(scaled))

    def drag(
        self, parameters: Float[AnyArray, " parameters"], reynolds: Float[AnyArray, ""]
    ) -> Float[AnyArray, ""]:
        """Cd of a body."""
        return drag_coefficient(self(parameters, reynolds))

    def scale(self, reynolds: Float[AnyArray, ""]) -> Float[AnyArray, " modes"]:
        """Typical variation of every mode at this Re."""
        return jnp.exp(jnp.polyval(self.size, jnp.log(reynolds))) * self.spread

    @property
    def weights(self) -> Float[AnyArray, " weights"]:
        """All trained numbers as one vector."""
        return ravel_pytree(self.layers)[0]

    def with_weights(self, weights: Float[AnyArray, " weights"]) -> "DragNetwork":
        """The same network with other trained numbers."""
        layers = ravel_pytree(self.layers)[1](weights)
        return eqx.tree_at(lambda net: net.layers, self, layers)

    def _mlp(self, inputs):
        for layer in self.layers[:-1]:
            inputs = jnp.tanh(layer(inputs))
        return self.layers[-1](inputs)


def make_network(
    scene: Scene,
    key: jax.Array,
    reynolds: Float[AnyArray, " samples"],
    oseen: Float[AnyArray, "samples modes"],
    width: int = 32,
) -> DragNetwork:
    """Initial network of a scene; ``oseen`` tractions of sample bodies set the output's scales."""
    bounds = np.concatenate([scene.family.bounds, np.log([scene.reynolds])])
    log_re = np.log(reynolds)
    degree = 2 if np.ptp(log_re) > 0 else 0
    size = np.pad(np.polyfit(log_re, np.log(-oseen[:, 0]), degree), (2 - degree, 0))
    relative = oseen / np.exp(np.polyval(size, log_re))[:, None]
    blank = blank_network((len(bounds), width, width, oseen.shape[1]), key)
    layers = (*blank.layers[:-1], jax.tree.map(lambda leaf: 0.1 * leaf, blank.layers[-1]))
    low, high = bounds.T
    arrays = (low, high, size, relative.mean(axis=0), relative.std(axis=0) + 0.02)
    return DragNetwork(layers, *map(jnp.asarray, arrays))


def blank_network(sizes: tuple[int, ...], key: jax.Array) -> DragNetwork:
    """Random layers from inputs to modes, scales of nought."""
    layers = tuple(
        eqx.nn.Linear(fan_in, fan_out, key=jax.random.fold_in(key, k), dtype=float)
        for k, (fan_in, fan_out) in enumerate(itertools.pairwise(sizes))
    )
    return DragNetwork(layers, *map(jnp.zeros, (sizes[0], sizes[0], 3, sizes[-1], sizes[-1])))
