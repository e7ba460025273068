"""Programs as lowered by an earlier process, from files beside JAX's cache of compiled code.

Lowering turns the traced Python function into StableHLO, the text that XLA compiles. JAX finds
compiled code by this text, so a process traces and lowers every program anew, which takes longer
than loading the code. Here the StableHLO is found by all that it depends on: the function, the
types of its arguments, settings of JAX, the source code of this project and the versions of others.
Values that a process replaces in modules of this project, as tests do, are not seen.
"""

import contextlib
import functools
import hashlib
import inspect
import io
import os
import pickle
import sys
import time
import types
from collections.abc import Callable, Mapping, Sequence
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple

import jax
from jax import export
from jaxtyping import PyTree

from surrogate.files import whole_file

LARGEST = 512 * 1024**2  # bytes of all files; those that were not used for longest are removed
LOADED = time.time()
HERE = Path(__file__).parent
SOURCES = HERE, HERE.parent / "shapeopt"
OWN = {"surrogate", "shapeopt"}
PACKAGES = (
    *("jax", "jaxlib", "jax-cfd", "equinox", "optax", "numpy", "scipy"),
    *("jaxtyping", "opt-einsum", "tree-math"),
)
OTHERS = {name.replace("-", "_") for name in PACKAGES} | sys.stdlib_module_names
SETTINGS = (
    *("jax_enable_x64", "jax_default_matmul_precision", "jax_default_prng_impl"),
    *("jax_numpy_dtype_promotion", "jax_numpy_rank_promotion"),
)
DIGEST = hashlib.sha256
SIZE = DIGEST().digest_size


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
    path = _path(function, static, arguments)
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


def folder() -> Path | None:
    """Return the folder of the files, None where JAX's cache of compiled code is off or remote."""
    cache = jax.config.jax_compilation_cache_dir
    local = cache and "://" not in cache and jax.config.jax_enable_compilation_cache
    return Path(cache) / "lowered" if local else None


def _lower(function, static, arguments):
    leaves, structure = jax.tree.flatten(dict(arguments))
    types = [jax.ShapeDtypeStruct(*_type(leaf)) for leaf in leaves]
    signature, results = inspect.signature(function), []

    def program(*leaves):
        bound = signature.bind(**static, **jax.tree.unflatten(structure, leaves))
        result = function(*bound.args, **bound.kwargs)
        values, outputs = jax.tree.flatten(result)
        results.append(jax.tree.unflatten(outputs, range(len(values))))
        return [_strong(value) for value in values]

    return Lowered(export.export(jax.jit(program))(*types), results[-1])


def _strong(value):
    """The value with a type that does not give way to others, as all have when read from a file."""
    return jax.lax.convert_element_type(value, jax.typeof(value).dtype)


def _type(leaf):
    return jax.typeof(leaf).shape, jax.typeof(leaf).dtype


def _path(function, static, arguments):
    """The file of a program; None where there is no folder or no unique name."""
    where = folder()
    code = None if where is None else _code()
    if code is None:
        return None
    leaves, structure = jax.tree.flatten(dict(arguments))
    settings = [getattr(jax.config, name) for name in SETTINGS]
    asked = io.BytesIO()
    pickler = _Pickler(asked)
    pickler.fast = True  # the same bytes whether or not equal parts are the same object
    name = function.__module__, function.__qualname__
    try:
        _check_known(function)
        pickler.dump((name, dict(static), structure, [*map(_type, leaves)], settings, code))
    except (pickle.PicklingError, AttributeError, TypeError, ValueError, RecursionError):
        return None
    return where / DIGEST(asked.getvalue()).hexdigest()


class _Pickler(pickle.Pickler):
    def reducer_override(self, value):
        if isinstance(value, type | types.FunctionType):
            _check_known(value)
        return NotImplemented


def _check_known(value):
    """Raise PicklingError for what is stored by its name, where its code is no part of the key."""
    package = value.__module__.partition(".")[0]
    if package not in OWN | OTHERS or "<" in value.__qualname__:
        raise pickle.PicklingError(f"{value!r} is unknown")


def _code():
    """The source code and what it uses, as a digest; None if it was edited since it was loaded."""
    try:
        files, digest = _sources()
        states = [file.stat() for file in files]
    except (OSError, metadata.PackageNotFoundError):
        return None
    edited = any(max(state.st_mtime, state.st_ctime) > LOADED for state in states)
    return None if edited else digest


@functools.cache
def _sources():
    """The files of the source code, and the digest of them and the versions of other packages."""
    files = sorted(path for source in SOURCES for path in source.rglob("*.py"))
    versions = [metadata.version(package).encode() for package in PACKAGES]
    return files, DIGEST(b"\n".join([*versions, *(path.read_bytes() for path in files)])).digest()


def _read(path):
    """What a file holds; None if there is none, or a damaged one."""
    try:
        content = path.read_bytes()
    except OSError:
        return None
    if DIGEST(content[SIZE:]).digest() != content[:SIZE]:
        return None
    with contextlib.suppress(OSError):
        os.utime(path)  # the time of its last use
    with contextlib.suppress(Exception):  # as of another Python, or without flatbuffers
        program, result = pickle.loads(content[SIZE:])
        return Lowered(export.deserialize(bytearray(program)), result)
    return None


def _write(path, found):
    """Write a file if that is possible, and remove others if all are too large."""
    with contextlib.suppress(Exception):  # it would only save time
        content = pickle.dumps((bytes(found.program.serialize()), found.result))
        with whole_file(path) as part:
            part.write_bytes(DIGEST(content).digest() + content)
        size = 0
        for file in sorted(path.parent.iterdir(), key=lambda file: -file.stat().st_mtime):
            size += file.stat().st_size
            if size > LARGEST:
                file.unlink(missing_ok=True)
