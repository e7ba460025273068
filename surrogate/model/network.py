"""The load network: (shape parameters, log Re) to log Cd, Cl / Cd, Cm / Cd and traction modes."""

import itertools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float

from surrogate.arrays import AnyArray
from surrogate.body.body_class import BodyClass
from surrogate.flow.grid.discretise import traction_modes
from surrogate.flow.loads import AnyModes, drag_amplitude
from surrogate.model.features import features_of, incidence_index, stokes_moment_features
from surrogate.model.inputs import Inputs, quadratic, scene_inputs
from surrogate.model.outputs import PARITY, OutputModel
from surrogate.scene.scene import Scene

CORRECTION_SCALE = 0.3  # of the outputs about their trend, per unit of the MLP's output
WIDTH, LIFTING_WIDTH = 20, 32  # of both hidden layers, for drag alone and for three loads
LAST_LAYER_SCALE = 0.1  # initial weights of the last layer over equinox's: starts near the trend
MIN_MODE_SCALE = 0.02  # keeps modes that hardly vary between Oseen flows from a scale of zero
INERTIAL_RE = 5.0  # a choice: below it Cm / Cd of spheroids grows about as Re, above it slowly
LEAST_SINGULAR = 1e-3  # value over the largest that the first fit of the moment's trends keeps


class LoadNetwork(OutputModel):
    """A network of the loads: a quadratic trend plus a small tanh MLP, with the mirror symmetry.

    With z the features of the scaled inputs (see ``surrogate.model.features``), z' those of the
    body's mirror image, and q(z) all monomials of z up to degree 2, the outputs
    y = (log Cd, Cl / Cd, Cm / Cd), or log Cd alone without lift, are

        f(z) = trend . q(z) + 0.3 MLP(z),   y_0 = (f(z) + f(z')) / 2,   y_1,2 = (f(z) - f(z')) / 2

    Of 3-D bodies at incidence f_2 is replaced by

        Re / (Re + 5) f_2(z) + sum_j b_j f_{2 + j}(z),    j = 1, 2, ...,

    with the features b_j = beta_k sin a of the even sine modes, see ``surrogate.model.features``.
    The first term is the moment by inertia: at low Re its Cm is constant while Cd grows as 1 / Re.
    The others are, to first order in the modes, the moment in Stokes flow, which bodies that are
    symmetric fore and aft do not have. So the moment has the right sign also where it is a small
    part of the drag. The traction modes a, each made even or odd in the same way, are

        a_0 = -Cd / 2,   a_lift = -Cl / 2,   a_k = (mode_mean_k + mode_scale_k MLP_k) Cd / 2

    ``mode_mean`` and ``mode_scale`` are the mean and standard deviation of the Oseen flows' modes
    over half their drag. The loads are what every method trains. The other traction modes are
    trained by methods with ``trains_traction`` only; else their heads keep their random initial
    weights.
    """

    layers: tuple[eqx.nn.Linear, ...]
    trends: tuple[Float[AnyArray, " features"], ...]
    inputs: Inputs
    mode_mean: Float[AnyArray, " modes"]
    mode_scale: Float[AnyArray, " modes"]
    modes: AnyModes = eqx.field(static=True)

    def outputs(self, z: Float[AnyArray, " inputs"]) -> Float[Array, " loads"]:
        """Return log Cd, and where there is lift Cl / Cd and Cm / Cd, at scaled inputs."""
        return self._outputs_and_heads(z)[0]

    def traction(
        self, parameters: Float[AnyArray, " parameters"], reynolds: Float[AnyArray, ""]
    ) -> Float[AnyArray, " modes"]:
        """Return the traction modes a of a body (its force on the fluid, U = D = rho = 1).

        Meaningless except for the modes of drag and lift, unless the traction was trained: a
        surrogate's record says so in ``trained_for``, and ``Surrogate`` answers loads only.
        """
        outputs, heads = self._outputs_and_heads(self.inputs(parameters, reynolds))
        mean, scale = jax.lax.stop_gradient((self.mode_mean, self.mode_scale))
        relative = (mean + scale * heads).at[0].set(-1.0)
        if self.modes.lift_index is not None:
            relative = relative.at[self.modes.lift_index].set(-outputs[1])
        return -drag_amplitude(jnp.exp(outputs[0])) * relative

    @property
    def weights(self) -> Float[AnyArray, " weights"]:
        """All trained numbers, as one vector."""
        return ravel_pytree((self.layers, self.trends))[0]

    def with_weights(self, weights: Float[AnyArray, " weights"]) -> "LoadNetwork":
        """Return the same network with other trained numbers."""
        trained = ravel_pytree((self.layers, self.trends))[1](weights)
        return eqx.tree_at(lambda net: (net.layers, net.trends), self, trained)

    @property
    def load_weights(self) -> Float[AnyArray, " load_weights"]:
        """Weights on which the loads depend: all but the heads of the other traction modes."""
        return ravel_pytree(self._of_loads)[0]

    def with_load_weights(self, weights: Float[AnyArray, " load_weights"]) -> "LoadNetwork":
        """Return the same network with other ``load_weights``."""
        hidden, rows, biases, trends = ravel_pytree(self._of_loads)[1](weights)
        last, own = self.layers[-1], np.array(self.load_heads)
        heads = last.weight.at[own].set(rows), last.bias.at[own].set(biases)
        last = eqx.tree_at(lambda layer: (layer.weight, layer.bias), last, heads)
        return eqx.tree_at(lambda net: (net.layers, net.trends), self, ((*hidden, last), trends))

    @property
    def load_heads(self) -> tuple[int, ...]:
        """Indices of the MLP's outputs that correct the trends, see the function ``load_heads``."""
        return load_heads(self.modes, self.inputs.body_class)

    @property
    def _of_loads(self):
        last, own = self.layers[-1], np.array(self.load_heads)
        return self.layers[:-1], last.weight[own], last.bias[own], self.trends

    def _outputs_and_heads(self, z):
        """Return the outputs and the MLP's outputs of tractions, each even or odd."""
        features = self.inputs.features(z)
        values, heads = self._unsymmetric(features)
        if self.modes.lift_index is None:
            return values, heads
        mirrored = self._unsymmetric(self.inputs.feature_mirror * features)
        tractions, images = (each[: self.modes.count] for each in (heads, mirrored[1]))
        return (values + PARITY * mirrored[0]) / 2, (tractions + self.modes.mirror * images) / 2

    def _unsymmetric(self, features):
        heads = self._mlp(features)
        trend = jnp.stack(self.trends) @ quadratic(features)
        values = trend + CORRECTION_SCALE * heads[np.array(self.load_heads)]
        if incidence_index(self.inputs.body_class) is None:
            return values, heads
        factors = moment_factors(self.inputs, features)
        return jnp.append(values[:2], factors @ values[2:]), heads

    def _mlp(self, values):
        for layer in self.layers[:-1]:
            values = jnp.tanh(layer(values))
        return self.layers[-1](values)


def moment_factors(
    inputs: Inputs, features: Float[AnyArray, " features"]
) -> Float[Array, " heads"]:
    """Return the factors c_j of the heads h_j of a 3-D body's Cm / Cd = sum_j c_j h_j.

    They are Re / (Re + 5) and the features b_j, see ``LoadNetwork``.

    Args:
      inputs: scaling of the network's inputs.
      features: of one body.
    """
    width, low = jax.lax.stop_gradient((inputs.width[-1], inputs.low[-1]))
    log_re = low + width * (features[-1] + 1) / 2
    inertia = jax.nn.sigmoid(log_re - np.log(INERTIAL_RE))
    even = np.array(stokes_moment_features(inputs.body_class), int)
    return jnp.append(inertia, features[even])


def load_heads(modes: AnyModes, body_class: BodyClass) -> tuple[int, ...]:
    """Return the indices of the heads of log Cd, and where there is lift of Cl / Cd and Cm / Cd.

    A head is an output of the network's MLP. The moment of 3-D bodies at incidence has one for
    inertia and one for each even sine mode.
    """
    if modes.lift_index is None:
        return (0,)
    return 0, modes.lift_index, *range(modes.count, head_count(modes, body_class))


def head_count(modes: AnyModes, body_class: BodyClass) -> int:
    """Return the number of a network's heads, the outputs of its MLP.

    There is one for each traction mode, and where there is lift those of the moment.
    """
    lifting = modes.lift_index is not None
    return modes.count + lifting * (1 + len(stokes_moment_features(body_class)))


def make_network(
    scene: Scene,
    key: jax.Array,
    parameters: Float[AnyArray, "samples parameters"],
    reynolds: Float[AnyArray, " samples"],
    oseen: Float[AnyArray, "samples modes"],
    outputs: Float[AnyArray, "samples loads"],
    width: int | None = None,
) -> LoadNetwork:
    """Return the initial network of a scene, its trends fitted to the samples' Oseen loads.

    Args:
      scene: whose ranges scale the inputs.
      key: of the random weights.
      parameters: of the training samples.
      reynolds: of the training samples.
      oseen: traction modes of their Oseen flows.
      outputs: log Cd (, Cl / Cd, Cm / Cd) of their Oseen flows.
      width: of both hidden layers; by default 20, and 32 where there is lift.
    """
    width = width or default_width(scene)
    inputs, blank = scene_inputs(scene), blank_network(scene, (width, width), key)
    features = np.asarray(_features(inputs, parameters, reynolds))
    trends = _fitted_trends(inputs, features, np.asarray(outputs))
    relative = -oseen / oseen[:, :1]
    last = jax.tree.map(lambda leaf: LAST_LAYER_SCALE * leaf, blank.layers[-1])
    even = blank.modes.mirror > 0  # the mean of the others over bodies and mirror images is zero
    mean = np.where(even, relative.mean(axis=0), 0.0)
    scale = np.sqrt(np.mean((relative - mean) ** 2, axis=0)) + MIN_MODE_SCALE
    return LoadNetwork(
        (*blank.layers[:-1], last),
        trends,
        inputs,
        jnp.asarray(mean),
        jnp.asarray(scale),
        blank.modes,
    )


@jax.jit
def _features(inputs, parameters, reynolds):
    return jax.vmap(lambda *case: inputs.features(inputs(*case)))(parameters, reynolds)


@jax.jit
def _monomials(features):
    return jax.vmap(quadratic)(features)


@jax.jit
def _moment_factors(inputs, features):
    return jax.vmap(lambda one: moment_factors(inputs, one))(features)


def _fitted_trends(inputs, features, outputs):
    """Fit the trends by least squares, those of the heads of a 3-D moment together."""
    both = features, inputs.feature_mirror * features
    has_incidence = incidence_index(inputs.body_class) is not None
    plain, mirrored = (np.asarray(_monomials(x)) for x in both)
    trends = []
    for k, values in enumerate(outputs.T):
        columns, least = [(plain, mirrored)], None
        if k == 2 and has_incidence:
            least = LEAST_SINGULAR
            factors, image_factors = (np.asarray(_moment_factors(inputs, x)).T for x in both)
            columns = [
                (own[:, None] * plain, image[:, None] * mirrored)
                for own, image in zip(factors, image_factors, strict=True)
            ]
        matrix = np.hstack([own + PARITY[k] * image for own, image in columns])
        found = np.linalg.lstsq(matrix, 2 * values, least)[0]
        trends += map(jnp.asarray, np.split(found, len(columns)))
    return tuple(trends)


def default_width(scene: Scene) -> int:
    """Return the width of both hidden layers of a scene's network, unless another is asked for."""
    return LIFTING_WIDTH if scene.family.has_lift else WIDTH


def blank_network(scene: Scene, hidden: tuple[int, ...], key: jax.Array) -> LoadNetwork:
    """Return a network of a scene with random layers, whose trends and scales are zero.

    Args:
      scene: whose family and fidelity give the numbers of features and heads.
      hidden: widths of the hidden layers.
      key: of the random layers.
    """
    body_class, modes = scene.family.body_class, traction_modes(scene)
    seen = len(features_of(body_class))
    sizes = (seen, *hidden, head_count(modes, body_class))
    layers = tuple(
        eqx.nn.Linear(fan_in, fan_out, key=jax.random.fold_in(key, k), dtype=float)
        for k, (fan_in, fan_out) in enumerate(itertools.pairwise(sizes))
    )
    heads = load_heads(modes, body_class)
    count, scales = len(body_class.names) + 1, jnp.zeros(modes.count)
    inputs = Inputs(jnp.zeros(count), jnp.zeros(count), body_class)
    trends = (jnp.zeros((seen + 1) * (seen + 2) // 2),) * len(heads)
    return LoadNetwork(layers, trends, inputs, scales, scales, modes)
