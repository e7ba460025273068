"""Arrays of a pytree in one file by equinox: nothing but numbers is ever unpacked."""

import io
import json
import math
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import numpy as np
from jaxtyping import PyTree

from surrogate.errors import InvalidInput
from surrogate.files import whole_file

LONGEST_HEADER = 1 << 20


def write_leaves(path: str | Path, tree: PyTree, header: Any = None) -> None:
    """Write a line of JSON and the arrays behind it, whole or not at all."""
    with whole_file(path) as part, part.open("wb") as file:
        file.write(json.dumps(header, sort_keys=True).encode() + b"\n")
        eqx.tree_serialise_leaves(file, tree)


def read_header(path: Path, what: str) -> Any:
    """The line of JSON.

    Raises:
      InvalidInput: there is none; the message begins with ``what``.
    """
    try:
        with path.open("rb") as file:
            return json.loads(file.readline(LONGEST_HEADER))
    except (OSError, ValueError, RecursionError):
        raise InvalidInput(f"{what} {path}: damaged") from None


def read_leaves(path: Path, like: PyTree, what: str) -> PyTree:
    """The arrays, in shapes and types as those of ``like``; the file's size is looked at first.

    ``like`` may hold shapes alone, in place of arrays.

    Raises:
      InvalidInput: the file is damaged, or its arrays are others; it begins with ``what``.
    """
    try:
        with path.open("rb") as file:
            header = len(file.readline(LONGEST_HEADER))
            fits = path.stat().st_size == header + _size(like)
            tree = eqx.tree_deserialise_leaves(file, like) if fits else None
    except (OSError, ValueError, RuntimeError, EOFError):
        raise InvalidInput(f"{what} {path}: damaged") from None
    if tree is None:
        raise InvalidInput(f"{what} {path}: damaged, or its arrays are of other shapes")
    return tree


def _size(tree):
    """Bytes that the arrays take in a file."""
    total = 0
    for leaf in jax.tree.leaves(tree):
        dtype, header = np.dtype(leaf.dtype), io.BytesIO()
        words = {"descr": dtype.str, "fortran_order": False, "shape": leaf.shape}
        np.lib.format.write_array_header_1_0(header, words)
        total += header.tell() + math.prod(leaf.shape) * dtype.itemsize
    return total
