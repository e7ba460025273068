"""The drag network: (shape parameters, log Re) to log Cd and traction modes."""

import itertools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float

from surrogate.arrays import AnyArray
from surrogate.flow.grid.discretise import traction_modes
from surrogate.flow.loads import drag_amplitude, drag_coefficient
from surrogate.model.inputs import Inputs, quadratic, scene_inputs
from surrogate.scene.scene import Scene

CORRECTION_SCALE = 0.3  # of log Cd about its trend, per unit of the MLP's output
WIDTH = 20  # of both hidden layers
LAST_LAYER_SCALE = 0.1  # initial weights of the last layer over equinox's: starts near the trend
MIN_MODE_SCALE = 0.02  # keeps modes that hardly vary between Oseen flows from a scale of zero


class DragNetwork(eqx.Module):
    """A quadratic trend of log Cd plus a small MLP with tanh.

    With z the scaled inputs and q(z) all their monomials up to degree 2:

        log Cd = trend . q(z) + 0.3 MLP_0(z)
        a_0 = -Cd / 2,   a_k = (mode_mean_k + mode_scale_k MLP_k(z)) Cd / 2

    ``mode_mean`` and ``mode_scale`` are the mean and standard deviation of the Oseen flows' modes
    over half their drag. ``drag`` is what every method trains. The other traction modes are trained
    by methods with ``trains_traction`` only; else their heads keep their random initial weights.
    """

    layers: tuple[eqx.nn.Linear, ...]
    trend: Float[AnyArray, " features"]
    inputs: Inputs
    mode_mean: Float[AnyArray, " modes"]
    mode_scale: Float[AnyArray, " modes"]

    def drag(
        self, parameters: Float[AnyArray, " parameters"], reynolds: Float[AnyArray, ""]
    ) -> Float[AnyArray, ""]:
        """Cd of a body."""
        return jnp.exp(self.log_drag(self.inputs(parameters, reynolds)))

    def log_drag(self, z: Float[AnyArray, " inputs"]) -> Float[Array, ""]:
        """log Cd at scaled inputs."""
        return self._log_drag(z, self._mlp(z))

    def traction(
        self, parameters: Float[AnyArray, " parameters"], reynolds: Float[AnyArray, ""]
    ) -> Float[AnyArray, " modes"]:
        """Traction modes a of a body (its force on the fluid, U = D = rho = 1).

        Meaningless except for the drag's mode a_0, unless the traction was trained: a surrogate's
        record says so in ``trained_for``, and ``Surrogate`` answers drags only.
        """
        z = self.inputs(parameters, reynolds)
        out = self._mlp(z)
        mean, scale = jax.lax.stop_gradient((self.mode_mean, self.mode_scale))
        relative = (mean + scale * out).at[0].set(-1.0)
        return -drag_amplitude(jnp.exp(self._log_drag(z, out))) * relative

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
        """The weights on which the drag depends: all but the heads of the other modes."""
        return ravel_pytree(self._of_drag)[0]

    def with_drag_weights(self, weights: Float[AnyArray, " drag_weights"]) -> "DragNetwork":
        """The same network with other ``drag_weights``."""
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
        return quadratic(z) @ self.trend + CORRECTION_SCALE * out[0]

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
    """Initial network of a scene: its trend is fitted to the Oseen drags of the samples.

    Args:
      scene: whose ranges scale the inputs.
      key: of the random weights.
      parameters: of the training samples.
      reynolds: of the training samples.
      oseen: traction modes of their Oseen flows.
      width: of both hidden layers.
    """
    inputs = scene_inputs(scene)
    features = jax.vmap(lambda p, re: quadratic(inputs(p, re)))(parameters, reynolds)
    trend = np.linalg.lstsq(features, np.log(drag_coefficient(oseen)))[0]
    relative = -oseen / oseen[:, :1]
    blank = blank_network(scene, (width, width), key)
    last = jax.tree.map(lambda leaf: LAST_LAYER_SCALE * leaf, blank.layers[-1])
    mean, scale = relative.mean(axis=0), relative.std(axis=0) + MIN_MODE_SCALE
    scales = jnp.asarray(mean), jnp.asarray(scale)
    return DragNetwork((*blank.layers[:-1], last), jnp.asarray(trend), inputs, *scales)


def blank_network(scene: Scene, hidden: tuple[int, ...], key: jax.Array) -> DragNetwork:
    """Random layers from a scene's inputs to its traction modes; trend and scales are zero."""
    body_class = scene.family.body_class
    outputs = traction_modes(scene.family, scene.fidelity).count
    sizes = (len(body_class.names) + 1, *hidden, outputs)
    layers = tuple(
        eqx.nn.Linear(fan_in, fan_out, key=jax.random.fold_in(key, k), dtype=float)
        for k, (fan_in, fan_out) in enumerate(itertools.pairwise(sizes))
    )
    count, modes = sizes[0], jnp.zeros(sizes[-1])
    inputs = Inputs(jnp.zeros(count), jnp.zeros(count), body_class)
    return DragNetwork(layers, jnp.zeros((count + 1) * (count + 2) // 2), inputs, modes, modes)
