"""Numbers as source text: exact in the precision of the export, in lines of bounded length."""

import dataclasses
import textwrap
from collections.abc import Iterable
from importlib import resources
from string import Template

import numpy as np
from jaxtyping import Float

from surrogate.exports.plain import PlainNetwork

WIDTH = 100  # letters of a line


@dataclasses.dataclass(frozen=True)
class Precision:
    """A floating-point type: its name in exports, and its name in NumPy."""

    name: str
    dtype: str

    def literal(self, value: float) -> str:
        """Return the shortest text, with a point or exponent, that is read back as this value."""
        limits = np.finfo(self.dtype)
        value = 0.0 if abs(value) < limits.tiny else np.clip(value, limits.min, limits.max)
        value = np.dtype(self.dtype).type(value)
        text = np.format_float_scientific(value, unique=True, trim="0")
        return text.replace("e+00", "").replace("e-00", "")

    def ends(self, plain: PlainNetwork) -> tuple[Float[np.ndarray, " _"], Float[np.ndarray, " _"]]:
        """Return the ends (low, high) of the trained ranges, widened by what rounding may add."""
        size = 1 + np.abs(plain.low) + np.abs(plain.high)
        slack = np.maximum(plain.slack, 4 * float(np.finfo(self.dtype).eps) * size)
        return plain.low - slack, plain.high + slack


PRECISIONS = {
    "double": Precision("double", "float64"),
    "single": Precision("single", "float32"),
}


def template(name: str, **values: object) -> str:
    """Return the text of a template of this package with its $names replaced by the values."""
    return Template(template_text(name)).substitute(values)


def template_text(name: str) -> str:
    """Return the text of a template of this package as it is."""
    return (resources.files(__package__) / "templates" / name).read_text(encoding="utf-8")


def sizes_and_names(plain: PlainNetwork) -> dict[str, int | str]:
    """Return the sizes and names of a network, by their names in the C and Fortran templates."""
    return {
        "inputs": ", ".join(plain.inputs),
        "loads": ", ".join(plain.loads),
        "count": len(plain.inputs),
        "features": len(plain.mirror),
        "incidence": plain.incidence,
        "descriptions": len(plain.signs),
        "outputs": len(plain.loads),
        "heads": len(plain.constant),
        "layers": len(plain.weights),
        "widest": max(plain.sizes),
        "nodes": sum(plain.sizes[:-1]),
    }


def flat(arrays: Iterable[Float[np.ndarray, "..."]]) -> Float[np.ndarray, " _"]:
    """Return all numbers of several arrays, by rows, as one vector."""
    return np.concatenate([array.ravel() for array in arrays])


def wrapped(texts: list[str], indent: str = "    ") -> str:
    """Return the texts joined by commas and wrapped to indented lines of at most ``WIDTH``."""
    lines = textwrap.wrap(", ".join(texts), WIDTH - len(indent), break_on_hyphens=False)
    return "\n".join(indent + line for line in lines)
