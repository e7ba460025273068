"""A surrogate as one Fortran 2003 module; the algorithm is in ``templates/network.f90``."""

import re

import numpy as np

from surrogate.errors import InvalidInput
from surrogate.exports.literals import (
    Precision,
    flat,
    sizes_and_names,
    template,
    template_text,
    wrapped,
)
from surrogate.exports.plain import PlainNetwork

NAME = re.compile(r"[a-z]\w*")
NUMBERS = 100  # in one DATA statement: the standard allows 255 continuation lines


def fortran_file(plain: PlainNetwork, card: str, precision: Precision, prefix: str) -> str:
    """Return the text of a module PREFIX with the subroutines PREFIX_loads and PREFIX_loads_batch.

    Args:
      plain: the numbers of the network.
      card: the model card, which becomes a comment.
      precision: of all numbers in the module.
      prefix: names the module and begins the names of the subroutines.

    Raises:
      InvalidInput: the module itself uses a name like the prefix.
    """
    code = _data(plain, precision) + re.sub(r"!.*|\$\{?\w+", "", template_text("network.f90"))
    if prefix.lower() in NAME.findall(code):
        raise InvalidInput(
            f"prefix {prefix!r}: is a name that the Fortran code itself uses; {prefix}_net would do"
        )
    return template(
        "network.f90",
        card="\n".join(f"! {line}".rstrip() for line in card.splitlines()),
        prefix=prefix,
        one=_literal(precision)(1.0),
        **sizes_and_names(plain),
        data=_data(plain, precision),
    )


def _literal(precision):
    def text(value):
        plain = precision.literal(value)
        if precision.name == "single":
            return plain
        return plain.replace("e", "d") if "e" in plain else f"{plain}d0"

    return text


def _data(plain, precision):
    """Return the numbers as module variables that DATA statements set, arrays by columns."""
    literal, (low, high) = _literal(precision), precision.ends(plain)

    numbers = {
        **{
            "angle": np.array([plain.angle]),
            "inertial": np.array([plain.inertial]),
            "scale_": plain.scale,
            "shift_": plain.shift,
            "mirror": plain.mirror,
        },
        **{"parity": np.array(plain.parity), "low": low, "high": high},
        **{"least": plain.least, "most": plain.most},
        **{"signs": plain.signs.T, "offsets": plain.offsets.T},
        **{"constant": plain.constant, "linear": plain.linear.T},
        **{"quadratic": plain.quadratic.T},
        **{"weights": flat(plain.weights), "biases": flat(plain.biases)},
    }
    logs = [".true." if log else ".false." for log in plain.logs]
    whole = {"sizes": ("layers + 1", plain.sizes), "source": ("features_", plain.sources + 1)}
    whole |= {"wave": ("features_", plain.waves)}
    stokes = (plain.stokes + 1).tolist() or [1]  # an array of none has no literal
    whole |= {"stokes": (len(stokes), stokes)}
    lines = [
        *(
            _constants("integer", name, size, list(map(str, values)))
            for name, (size, values) in whole.items()
        ),
        _constants("logical", "logs", "inputs_", logs),
    ]
    for name, values in numbers.items():
        flat_name = name if values.ndim == 1 else f"{name}_values"
        lines.append(f"    real(rk), save :: {flat_name}({values.size})")
        lines.extend(_statements(flat_name, values.ravel(order="F"), literal))
        if values.ndim > 1:
            shape = ", ".join(map(str, values.shape))
            lines.append(f"    real(rk), save :: {name}({shape})")
            lines.append(f"    equivalence ({name}, {flat_name})")
    return "\n".join(lines)


def _constants(kind, name, size, values):
    body = " &\n".join(wrapped(values, indent="        ").splitlines())
    return f"    {kind}, parameter :: {name}({size}) = [ &\n{body}]"


def _statements(name, values, literal):
    for start in range(0, values.size, NUMBERS):
        part = values[start : start + NUMBERS]
        body = wrapped([literal(value) for value in part], indent="        ")
        ends = ",".join(map(str, (start + 1, start + part.size)))
        yield f"    data ({name}(i_), i_ = {ends}) / &\n" + " &\n".join(body.splitlines()) + " /"
