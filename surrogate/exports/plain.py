"""A surrogate's network as plain numbers: the one description that every export is written from.

With u_k = log x_k for ratios of lengths and Re, else u_k = x_k, and s = scale * u + shift, the
features z are s itself. Of 3-D bodies at the incidence a = angle s_incidence they are

    z_j = s_source(j) * (1, cos a, sin a, cos 2a, sin 2a)_wave(j),   where s_incidence counts as 1.

The loads follow from

    f(z) = constant + linear . z + z^T quadratic z + (W_3 tanh(W_2 tanh(W_1 z + b_1) + b_2) + b_3)

for any number of hidden layers. Of 3-D bodies at incidence the third of these is replaced by

    Re / (Re + inertial) f_2 + sum_j z_stokes(j) f_(2 + j),   j = 1, 2, ...

The outputs y = (log Cd, Cl / Cd, Cm / Cd) are f itself, or with lift (f(z) + parity * f(z')) / 2
with the features z' = mirror * z of the mirror image, in all places.
"""

import dataclasses
import math

import numpy as np
from jaxtyping import Bool, Float, Int

from surrogate.body.parameters import PARAMETERS, Kind
from surrogate.files import JsonObject
from surrogate.flow.loads import LOADS
from surrogate.model.features import features_of, incidence_index, stokes_moment_features
from surrogate.model.network import CORRECTION_SCALE, INERTIAL_RE
from surrogate.model.outputs import PARITY
from surrogate.model.surrogate import Surrogate
from surrogate.scene.limits import REYNOLDS


@dataclasses.dataclass(frozen=True)
class PlainNetwork:
    """The numbers of a network, and the ranges that its inputs are checked against.

    Args:
      inputs: names, the Reynolds number last.
      loads: names, "cd" or "cd", "cl", "cm".
      logs: which inputs enter by their logarithm.
      scale: of the inputs.
      shift: of the inputs.
      incidence: index of the incidence if it enters by cosines and sines, else -1.
      angle: incidence in radians at which its scaled input is 1.
      sources: index of the scaled input of each feature.
      waves: index of the factor of each feature: 1, cos a, sin a, cos 2a or sin 2a.
      mirror: factors from the features of a body to those of its mirror image.
      inertial: the Reynolds number in the factor of the moment by inertia, 0 for no such factor.
      stokes: features by which the parts of the moment of Stokes flow are multiplied.
      constant: of the trends.
      linear: of the trends.
      quadratic: of the trends, symmetric.
      weights: of the layers; the last gives one correction a load, and one each of ``stokes``.
      biases: of the layers.
      low: lower ends of the trained ranges, by the logarithm for Re alone.
      high: upper ends, likewise.
      slack: by how much an input may exceed them by rounding.
      signs: factors of the inputs in all descriptions of a body and of its mirror image, its own
        first; it is inside the trained ranges where one of them is.
      offsets: what is added to them.
      least: least valid inputs.
      most: greatest valid inputs.
    """

    inputs: tuple[str, ...]
    loads: tuple[str, ...]
    logs: Bool[np.ndarray, " inputs"]
    scale: Float[np.ndarray, " inputs"]
    shift: Float[np.ndarray, " inputs"]
    incidence: int
    angle: float
    sources: Int[np.ndarray, " features"]
    waves: Int[np.ndarray, " features"]
    mirror: Float[np.ndarray, " features"]
    inertial: float
    stokes: Int[np.ndarray, " parts"]
    constant: Float[np.ndarray, " heads"]
    linear: Float[np.ndarray, "heads features"]
    quadratic: Float[np.ndarray, "heads features features"]
    weights: tuple[Float[np.ndarray, "_ _"], ...]
    biases: tuple[Float[np.ndarray, " _"], ...]
    low: Float[np.ndarray, " inputs"]
    high: Float[np.ndarray, " inputs"]
    slack: Float[np.ndarray, " inputs"]
    signs: Float[np.ndarray, "descriptions inputs"]
    offsets: Float[np.ndarray, "descriptions inputs"]
    least: Float[np.ndarray, " inputs"]
    most: Float[np.ndarray, " inputs"]

    @property
    def sizes(self) -> tuple[int, ...]:
        """Widths of all layers: of the features, the hidden layers and the corrections."""
        return (len(self.mirror), *(len(bias) for bias in self.biases))

    @property
    def parity(self) -> tuple[float, ...]:
        """Factors from the outputs of a body to those of its mirror image."""
        return tuple(PARITY[: len(self.loads)].tolist())

    def record(self) -> JsonObject:
        """Return all numbers as a JSON object, under their names."""
        return {
            name: [part.tolist() for part in value]
            if name in ("weights", "biases")
            else np.asarray(value).tolist()
            for name, value in vars(self).items()
        }


def plain_network(surrogate: Surrogate) -> PlainNetwork:
    """Return the numbers of a surrogate's network on which its loads depend."""
    network, family = surrogate.network, surrogate.scene.family
    inputs, heads = network.inputs, np.array(network.load_heads)
    low, width = np.asarray(inputs.low, float), np.asarray(inputs.width, float)
    index, seen = incidence_index(inputs.body_class), features_of(inputs.body_class)
    count = len(seen)
    rows, columns = np.triu_indices(count)
    trends = np.array([np.asarray(trend, float) for trend in network.trends])
    quadratic = np.zeros((len(heads), count, count))
    quadratic[:, rows, columns] = trends[:, count + 1 :]
    weights = [np.asarray(layer.weight, float) for layer in network.layers]
    biases = [np.asarray(layer.bias, float) for layer in network.layers]
    weights[-1] = CORRECTION_SCALE * weights[-1][heads]
    biases[-1] = CORRECTION_SCALE * biases[-1][heads]
    parameters = [PARAMETERS[name] for name in family.names]
    bounds, reynolds = surrogate.ranges.bounds, REYNOLDS[surrogate.scene.dimension]
    signs, offsets = surrogate.ranges.descriptions
    least, most = np.array([*(p.limits for p in parameters), reynolds]).T
    return PlainNetwork(
        inputs=(*family.names, "reynolds"),
        loads=tuple(LOADS)[: 1 if network.modes.lift_index is None else None],
        logs=np.array([*(p.kind is Kind.RATIO for p in parameters), True]),
        scale=2 / width,
        shift=-2 * low / width - 1,
        incidence=-1 if index is None else index,
        angle=math.radians(float(inputs.largest_incidence)),
        sources=np.array([feature.source for feature in seen]),
        waves=np.array([int(feature.wave) for feature in seen]),
        mirror=np.asarray(inputs.feature_mirror, float),
        inertial=0.0 if index is None else INERTIAL_RE,
        stokes=np.array(stokes_moment_features(inputs.body_class), int),
        constant=trends[:, 0],
        linear=trends[:, 1 : count + 1],
        quadratic=(quadratic + quadratic.swapaxes(1, 2)) / 2,
        weights=tuple(weights),
        biases=tuple(biases),
        low=bounds[:, 0],
        high=bounds[:, 1],
        slack=surrogate.ranges.slack,
        signs=np.pad(signs, ((0, 0), (0, 1)), constant_values=1.0),
        offsets=np.pad(offsets, ((0, 0), (0, 1))),
        least=least,
        most=most,
    )
