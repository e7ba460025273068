"""Write a surrogate to one file that other programs evaluate without JAX."""

import re
from pathlib import Path
from typing import Literal, get_args

from surrogate.checks import expect
from surrogate.errors import InvalidInput
from surrogate.exports.c import c_file
from surrogate.exports.fortran import fortran_file
from surrogate.exports.literals import PRECISIONS
from surrogate.exports.numpy_file import numpy_file
from surrogate.exports.onnx_file import onnx_model
from surrogate.exports.plain import plain_network
from surrogate.files import check_file, whole_file
from surrogate.model.surrogate import Surrogate

Target = Literal["c", "fortran", "numpy", "onnx"]
TARGETS: tuple[Target, ...] = get_args(Target)
SUFFIXES: dict[Target, str] = {"c": ".c", "fortran": ".f90", "numpy": ".py", "onnx": ".onnx"}
PREFIX = "surrogate"
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,30}")  # a name in C and, by its length, in Fortran


def export(
    surrogate: Surrogate,
    path: str | Path,
    to: str = "c",
    *,
    precision: str = "double",
    prefix: str | None = None,
) -> Path:
    """Write a surrogate to one file in another language, with weights, derivatives and ranges.

    All files evaluate the loads and their exact derivatives in the inputs (parameters, then Re),
    and say whether the inputs are within the trained ranges (0), outside (1) or invalid (2). The
    loads of invalid inputs are NaN; C leaves what was there. As in ``Surrogate``, a body is
    within the ranges if any of its descriptions is, that of its mirror image for instance.
    Contours that cross themselves are not found out.

    Args:
      surrogate: what is written.
      path: the file, .c, .f90, .py or .onnx.
      to: "c" (C99), "fortran" (2003), "numpy" or "onnx".
      precision: "double" or "single".
      prefix: begins the names of functions in C and names the module in Fortran and the graph in
        ONNX, "surrogate" by default; NumPy files have none.

    Returns:
      The path.

    Raises:
      InvalidInput: an argument is invalid, the file cannot be written, or onnx is not installed.
    """
    expect("export", surrogate, Surrogate, "Surrogate, as load() returns")
    if to == "numpy" and prefix is not None:
        raise InvalidInput("prefix: goes with C, Fortran and ONNX; leave it out")
    prefix = PREFIX if prefix is None else prefix
    for name, text in {"to": to, "precision": precision, "prefix": prefix}.items():
        expect(name, text, str, "string")
    if to not in TARGETS:
        raise InvalidInput(f"export to {to!r}: one of {', '.join(TARGETS)}")
    if precision not in PRECISIONS:
        raise InvalidInput(f"precision {precision!r}: one of {', '.join(PRECISIONS)}")
    if not NAME.fullmatch(prefix):
        raise InvalidInput(
            f"prefix {prefix!r}: a letter, then letters, digits and _, 31 characters at most"
        )
    path = check_file(path, SUFFIXES[to])
    plain, text, number = plain_network(surrogate), surrogate.card, PRECISIONS[precision]
    if to == "onnx":
        content = onnx_model(plain, text, number, prefix).SerializeToString(deterministic=True)
    elif to == "numpy":
        content = numpy_file(plain, text, number).encode()
    else:
        write = c_file if to == "c" else fortran_file
        content = write(plain, text, number, prefix).encode()
    with whole_file(path) as part:
        part.write_bytes(content)
    return path
