"""Files of a JSON header and the arrays of a pytree, written by equinox without pickling."""

import hashlib
import json
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import numpy as np
from jaxtyping import PyTree

from surrogate.errors import InvalidInput
from surrogate.files import whole_file

LONGEST_HEADER = 1 << 20  # bytes


def write_leaves(path: str | Path, tree: PyTree, header: object = None) -> None:
    """Write a file atomically: one line of JSON, then the arrays of a pytree."""
    with whole_file(path) as part, part.open("wb") as file:
        file.write(json.dumps(header, sort_keys=True).encode() + b"\n")
        eqx.tree_serialise_leaves(file, tree)


def read_header(path: Path) -> Any:
    """Return the JSON value in the first line of a checkpoint.

    Raises:
      InvalidInput: there is none.
    """
    try:
        with path.open("rb") as file:
            return json.loads(file.readline(LONGEST_HEADER))
    except (OSError, ValueError, RecursionError):
        raise InvalidInput(f"checkpoint {path}: damaged; remove it") from None


def read_leaves(path: Path, like: PyTree, what: str, remedy: str = "") -> PyTree:
    """Return the arrays of a file as a pytree with the structure of ``like``.

    Args:
      path: of a file by ``write_leaves``.
      like: pytree whose leaves are arrays of the same shapes and types, or their
        ShapeDtypeStructs.
      what: begins the message of an exception.
      remedy: ends it.

    Raises:
      InvalidInput: the file is damaged, or its arrays have other shapes or types.
    """
    try:
        with path.open("rb") as file:
            file.readline(LONGEST_HEADER)
            tree = eqx.tree_deserialise_leaves(file, like, filter_spec=_read_array)
            if file.read(1):
                raise ValueError("more than the arrays")
    except Exception:  # NumPy's, equinox's, zipfile's or tokenize's, by which bytes are damaged
        raise InvalidInput(
            f"{what} {path}: damaged, or its arrays are of other shapes{remedy}"
        ) from None
    return tree


def leaves_digest(tree: PyTree) -> str:
    """Return the SHA-256 digest of all numbers of a pytree's arrays, in hexadecimal digits."""
    digest = hashlib.sha256()
    for leaf in jax.tree.leaves(tree):
        digest.update(np.ascontiguousarray(leaf))
    return digest.hexdigest()


def _read_array(file, like):
    """Return the next array of a file; by ``jnp.load`` each shape would take a program."""
    return jax.device_put(np.load(file))
