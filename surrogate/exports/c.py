"""A surrogate as one C99 file; the algorithm is in ``templates/network.c`` and ``core.c``."""

import math

import numpy as np

from surrogate.exports.literals import Precision, flat, sizes_and_names, template, wrapped
from surrogate.exports.plain import PlainNetwork

# Cases that the batch function evaluates at once, without AVX-512 and with it: enough independent
# sums of vectors to hide the latency of a multiply-add. Of 16, 32, 64 and 128 about the fastest.
BLOCK = {"double": (32, 64), "single": (128, 128)}
TERMS = {"double": 13, "single": 7}  # degree of exp's polynomial, whose error is below rounding
LN2_HIGH = 0.693145751953125  # log 2 in few bits, so that products with powers are exact
TYPES = {
    "double": {
        "real": "double",
        "suffix": "",
        "bits": "uint64_t",
        "magic": 2.0**52 + 2.0**51,
        "mantissa": 52,
        "offset": 1023,
        "saturated": 20.0,
    },
    "single": {
        "real": "float",
        "suffix": "##f",
        "bits": "uint32_t",
        "magic": 2.0**23 + 2.0**22,
        "mantissa": 23,
        "offset": 127,
        "saturated": 10.0,
    },
}


def c_file(plain: PlainNetwork, card: str, precision: Precision, prefix: str) -> str:
    """Return the text of a C99 file with the functions PREFIX_loads and PREFIX_loads_batch.

    Args:
      plain: the numbers of the network.
      card: the model card, which becomes a comment.
      precision: of all numbers in the file.
      prefix: begins the names of the functions.
    """
    literal = _literal(precision)
    kind, (block, wide_block) = TYPES[precision.name], BLOCK[precision.name]
    terms = [1 / math.factorial(k) for k in range(TERMS[precision.name] + 1)]

    def core(cases):
        text = template("core.c").replace("_L(", f"_{cases.lower()}(").replace("[L]", f"[{cases}]")
        return (
            text.replace("< L;", f"< {cases};")
            .replace("P_", f"{prefix}_")
            .replace("Loads of L cases", f"Loads of {cases} cases")
        )

    return template(
        "network.c",
        **kind | {name: literal(kind[name]) for name in ("magic", "saturated")},
        ln2_high=literal(LN2_HIGH),
        ln2_low=literal(math.log(2) - LN2_HIGH),
        log2e=literal(1 / math.log(2)),
        last=literal(terms[-1]),
        horner="\n".join(f"    e = e * rest + {literal(term)};" for term in terms[-2::-1]),
        card="\n".join(f" * {line}".rstrip() for line in card.splitlines()),
        prefix=prefix,
        PREFIX=prefix.upper(),
        **sizes_and_names(plain),
        block=block,
        wide_block=wide_block,
        stack=math.ceil(
            _values_of_a_case(plain) * wide_block * np.dtype(precision.dtype).itemsize / 1024
        ),
        data=_data(plain, precision),
        single=core("1"),
        batch=core("BLOCK"),
    )


def _values_of_a_case(plain):
    """Return how many numbers the batch function holds for each case."""
    inputs, features, heads = len(plain.inputs), len(plain.mirror), len(plain.constant)
    widest, nodes = max(plain.sizes), sum(plain.sizes[:-1])
    return inputs + features + 2 * heads * (1 + features) + 2 * 5 + nodes + 2 * widest + 4


def _literal(precision):
    suffix = "f" if precision.name == "single" else ""
    return lambda value: precision.literal(value) + suffix


def _data(plain, precision):
    """Return the numbers as constant arrays."""
    literal, (low, high) = _literal(precision), precision.ends(plain)

    def array(name, values, kind="real"):
        values = np.asarray(values)
        sizes = "".join(f"[{size}]" for size in values.shape)
        return f"static const {kind} {name}{sizes} = {{\n{_nested(values, literal)}\n}};"

    numbers = {
        **{"SCALE": plain.scale, "SHIFT": plain.shift, "MIRROR": plain.mirror},
        **{"ANGLE": np.array([plain.angle]), "INERTIAL": np.array([plain.inertial])},
        **{"LOW": low, "HIGH": high, "LEAST": plain.least, "MOST": plain.most},
        **{"SIGN": plain.signs, "OFFSET": plain.offsets},
        **{"CONSTANT": plain.constant, "LINEAR": plain.linear, "QUADRATIC": plain.quadratic},
        **{"WEIGHTS": flat(plain.weights), "BIASES": flat(plain.biases)},
    }
    tables = {"SIZES": np.array(plain.sizes), "LOGS": plain.logs * 1}
    tables |= {"SOURCE": plain.sources, "WAVE": plain.waves}
    tables |= {"STOKES": plain.stokes if plain.stokes.size else np.zeros(1, int)}  # none in C
    whole = [array(name, values, "int") for name, values in tables.items()]
    return "\n".join([*whole, *(array(name, values) for name, values in numbers.items())])


def _nested(values, literal):
    if values.ndim == 1:
        write = str if values.dtype.kind == "i" else literal
        return wrapped([write(value) for value in values])
    return ",\n".join(f"    {{\n{_nested(row, literal)}\n    }}" for row in values)
