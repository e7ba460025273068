"""Programs as an earlier process lowered them, instead of being traced again.

Lowering turns the traced Python function into StableHLO, the text that XLA compiles. JAX finds
compiled code by this text, so a process traces and lowers every program anew, which takes longer
than loading the code. Here the text itself is kept in a file (``program_files``).
"""

import contextlib
import functools
import inspect
import pickle
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import jax
from jax import export
from jaxtyping import PyTree

from surrogate.program_files import program_path, read_content, type_of, write_content


class Lowered(NamedTuple):
    """A lowered program of the leaves of its arguments, and its result with numbered leaves."""

    program: export.Exported
    result: PyTree


def from_file(function: Callable[..., Any], static: Sequence[str]) -> Callable[..., Any]:
    """Return a function of the same results that is read from a file instead of being traced.

    ``jax.jit`` compiles it; it cannot be differentiated or vmapped. A function that has no file, or
    cannot be lowered to one, is traced.

    Args:
      function: defined at the top level of a module of this project.
      static: names of its static arguments.
    """
    signature = inspect.signature(function)

    @functools.wraps(function)
    def call(*args, **kwargs):
        arguments = signature.bind(*args, **kwargs).arguments
        fixed = {name: arguments.pop(name) for name in static if name in arguments}
        found = lowered(function, fixed, arguments)
        if found is None:
            return function(*args, **kwargs)
        values = found.program.call(*map(_strong, jax.tree.leaves(arguments)))
        return jax.tree.unflatten(jax.tree.structure(found.result), values)

    return call


def lowered(
    function: Callable[..., Any], static: Mapping[str, Any], arguments: Mapping[str, PyTree]
) -> Lowered | None:
    """Return the lowered program of a function, from its file if there is one.

    Args:
      function: to be lowered.
      static: values of its static arguments.
      arguments: the other ones, of which types and shapes matter.

    Returns:
      The program; None if it can be kept in no file.
    """
    path = program_path(function, static, arguments)
    if path is None:
        return None
    found = _read(path)
    if found is None:
        try:
            found = _lower(function, static, arguments)
        except (NotImplementedError, ValueError):  # callbacks and unknown custom calls
            return None
        _write(path, found)
    return found


def _lower(function, static, arguments):
    leaves, structure = jax.tree.flatten(dict(arguments))
    types = [jax.ShapeDtypeStruct(*type_of(leaf)) for leaf in leaves]
    signature, results = inspect.signature(function), []

    def program(*leaves):
        bound = signature.bind(**static, **jax.tree.unflatten(structure, leaves))
        result = function(*bound.args, **bound.kwargs)
        values, outputs = jax.tree.flatten(result)
        results.append(jax.tree.unflatten(outputs, range(len(values))))
        return [_strong(value) for value in values]

    return Lowered(export.export(jax.jit(program))(*types), results[-1])


def _strong(value):
    """Return the value without a weak type, as values have none when read from a file."""
    return jax.lax.convert_element_type(value, jax.typeof(value).dtype)


def _read(path: Path) -> Lowered | None:
    """Return what a file holds; None if there is none, or one that cannot be understood."""
    content = read_content(path)
    if content is not None:
        with contextlib.suppress(Exception):  # as of another Python, or without flatbuffers
            program, result = pickle.loads(content)
            return Lowered(export.deserialize(bytearray(program)), result)
    return None


def _write(path: Path, found: Lowered) -> None:
    """Write a program to its file if that is possible."""
    with contextlib.suppress(Exception):  # it would only save time
        write_content(path, pickle.dumps((bytes(found.program.serialize()), found.result)))
