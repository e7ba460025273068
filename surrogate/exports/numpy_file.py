"""A surrogate as one Python file that needs NumPy alone; see ``templates/network.py.txt``."""

import numpy as np

from surrogate.exports.literals import Precision, template
from surrogate.exports.plain import PlainNetwork


def numpy_file(plain: PlainNetwork, card: str, precision: Precision) -> str:
    """Return the source of a Python module with ``loads``, ``jacobian`` and ``status``.

    Args:
      plain: the numbers of the network.
      card: the model card, which becomes the docstring.
      precision: of all numbers in the module.
    """

    def nested(values):
        if np.ndim(values) == 0:
            return precision.literal(values)
        return f"[{', '.join(map(nested, values))}]"

    def arrays(values):
        return "\n".join(f"    _array({nested(value)})," for value in values)

    low, high = precision.ends(plain)
    numbers = {"scale": plain.scale, "shift": plain.shift, "mirror": plain.mirror}
    numbers |= {
        "inertial": plain.inertial,
        "angle": plain.angle,
        "parity": plain.parity,
        "low": low,
        "high": high,
        "signs": plain.signs,
        "offsets": plain.offsets,
    }
    numbers |= {"least": plain.least, "most": plain.most, "constant": plain.constant}
    numbers |= {"linear": plain.linear, "quadratic": plain.quadratic}
    return template(
        "network.py.txt",
        card=card,
        inputs=", ".join(plain.inputs),
        loads=", ".join(plain.loads),
        input_names=plain.inputs,
        load_names=plain.loads,
        dtype=precision.dtype,
        logs=plain.logs.tolist(),
        incidence=plain.incidence if plain.incidence >= 0 else None,
        sources=plain.sources.tolist(),
        waves=plain.waves.tolist(),
        stokes=plain.stokes.tolist(),
        weights=arrays(plain.weights),
        biases=arrays(plain.biases),
        **{name: nested(values) for name, values in numbers.items()},
    )
