"""The network: (shape parameters, log Re) to log Cd and traction modes over the drag."""

import itertools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float

from surrogate.arrays import AnyArray
from surrogate.flow.grid.discretise import traction_modes
from surrogate.model.inputs import Inputs, quadratic, scene_inputs
from surrogate.scene.scene import Scene

REACH = 0.3  # of log Cd about its trend
WIDTH = 20


class DragNetwork(eqx.Module):
    """A quadratic trend of log Cd and a small MLP with tanh about it.

    With z the scaled inputs: log Cd = trend . q(z) + 0.3 MLP_0(z), traction modes
    a_0 = -Cd / 2 and a_k = (mean_k + spread_k MLP_k(z)) Cd / 2, by the Oseen flows' spread.
    """

    layers: tuple[eqx.nn.Linear, ...]
    trend: Float[AnyArray, " features"]
    inputs: Inputs
    mean: Float[AnyArray, " modes"]
    spread: Float[AnyArray, " modes"]

    def __call__(
        self, parameters: Float[AnyArray, " parameters"], reynolds: Float[AnyArray, ""]
    ) -> Float[AnyArray, " modes"]:
        """Traction modes (force of the body on the fluid, U = D = rho = 1)."""
        z = self.inputs(parameters, reynolds)
        out = self._mlp(z)
        mean, spread = jax.lax.stop_gradient((self.mean, self.spread))
        relative = (mean + spread * out).at[0].set(-1.0)
        return jnp.exp(self._log_drag(z, out)) / 2 * relative

    def drag(
        self, parameters: Float[AnyArray, " parameters"], reynolds: Float[AnyArray, ""]
    ) -> Float[AnyArray, ""]:
        """Cd of a body."""
        return jnp.exp(self.log_drag(self.inputs(parameters, reynolds)))

    def log_drag(self, z: Float[AnyArray, " inputs"]) -> Float[Array, ""]:
        """log Cd at scaled inputs."""
        return self._log_drag(z, self._mlp(z))

    @property
    def weights(self) -> Float[AnyArray, " weights"]:
        """All trained numbers as one vector."""
        return ravel_pytree((self.layers, self.trend))[0]

    def with_weights(self, weights: Float[AnyArray, " weights"]) -> "DragNetwork":
        """The same network with other trained numbers."""
        trained = ravel_pytree((self.layers, self.trend))[1](weights)
        return eqx.tree_at(lambda net: (net.layers, net.trend), self, trained)

    @property
    def drag_weights(self) -> Float[AnyArray, " drag_weights"]:
        """Those that the drag depends on: all but the heads of the other modes."""
        return ravel_pytree(self._of_drag)[0]

    def with_drag_weights(self, weights: Float[AnyArray, " drag_weights"]) -> "DragNetwork":
        """The same network with other numbers for the drag."""
        hidden, row, bias, trend = ravel_pytree(self._of_drag)[1](weights)
        last = self.layers[-1]
        heads = last.weight.at[0].set(row), last.bias.at[0].set(bias)
        last = eqx.tree_at(lambda layer: (layer.weight, layer.bias), last, heads)
        return eqx.tree_at(lambda net: (net.layers, net.trend), self, ((*hidden, last), trend))

    @property
    def _of_drag(self):
        last = self.layers[-1]
        return self.layers[:-1], last.weight[0], last.bias[0], self.trend

    def _log_drag(self, z, out):
        return quadratic(z) @ self.trend + REACH * out[0]

    def _mlp(self, z):
        for layer in self.layers[:-1]:
            z = jnp.tanh(layer(z))
        return self.layers[-1](z)


def make_network(
    scene: Scene,
    key: jax.Array,
    parameters: Float[AnyArray, "samples parameters"],
    reynolds: Float[AnyArray, " samples"],
    oseen: Float[AnyArray, "samples modes"],
    width: int = WIDTH,
) -> DragNetwork:
    """Initial network of a scene: the trend of the Oseen drags of sample bodies, no more."""
    inputs = scene_inputs(scene)
    features = jax.vmap(lambda p, re: quadratic(inputs(p, re)))(parameters, reynolds)
    trend = np.linalg.lstsq(features, np.log(-2 * oseen[:, 0]))[0]
    relative = -oseen / oseen[:, :1]
    blank = blank_network(scene, (width, width), key)
    layers = (*blank.layers[:-1], jax.tree.map(lambda leaf: 0.1 * leaf, blank.layers[-1]))
    mean, spread = relative.mean(axis=0), relative.std(axis=0) + 0.02
    return DragNetwork(layers, jnp.asarray(trend), inputs, jnp.asarray(mean), jnp.asarray(spread))


def blank_network(scene: Scene, hidden: tuple[int, ...], key: jax.Array) -> DragNetwork:
    """Random layers from a scene's inputs to its traction modes, scales of nought."""
    body_class, outputs = (
        scene.family.body_class,
        traction_modes(scene.family, scene.fidelity).count,
    )
    sizes = (len(body_class.names) + 1, *hidden, outputs)
    layers = tuple(
        eqx.nn.Linear(fan_in, fan_out, key=jax.random.fold_in(key, k), dtype=float)
        for k, (fan_in, fan_out) in enumerate(itertools.pairwise(sizes))
    )
    count, modes = sizes[0], jnp.zeros(sizes[-1])
    inputs = Inputs(jnp.zeros(count), jnp.zeros(count), body_class)
    return DragNetwork(layers, jnp.zeros((count + 1) * (count + 2) // 2), inputs, modes, modes)
