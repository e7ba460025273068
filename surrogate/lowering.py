"""Programs as lowered by an earlier process, from files beside JAX's cache of compiled code.

JAX finds compiled code by a program's StableHLO, so a process traces and lowers every program anew,
which takes longer than loading the code. Here the StableHLO is found by the function, the types of
its arguments and the source code of this project, all of which it depends on. Values that a process
replaces in modules of this project, as tests do, are not seen.
"""

import functools
import hashlib
import inspect
import io
import pickle
import time
from collections.abc import Callable, Mapping, Sequence
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple

import jax
from jax import export
from jaxtyping import PyTree

from surrogate.errors import InvalidInput
from surrogate.files import whole_file

LARGEST = 512 * 1024**2  # bytes of all files; those that were not used for longest are removed
PACKAGES = ("jax", "jaxlib", "equinox", "jax-cfd", "numpy", "optax")
LOADED = time.time()
HERE = Path(__file__).parent
SOURCES = HERE, HERE.parent / "shapeopt"
DIGEST = hashlib.sha256
SIZE = DIGEST().digest_size


class Lowered(NamedTuple):
    """A lowered program of the leaves of its arguments, and its result with numbered leaves."""

    program: export.Exported
    result: PyTree


def from_file(function: Callable[..., Any], static: Sequence[str]) -> Callable[..., Any]:
    """Return a function of the same results that is read from a file instead of being traced.

    Args:
      function: of a module, else no file is kept; to be called inside ``jax.jit`` alone.
      static: names of its static arguments.
    """
    signature = inspect.signature(function)

    @functools.wraps(function)
    def call(*args, **kwargs):
        bound = signature.bind(*args, **kwargs)
        bound.apply_defaults()
        arguments = bound.arguments
        fixed = {name: arguments.pop(name) for name in static}
        program, result = lowered(function, fixed, arguments)
        values = program.call(*jax.tree.leaves(arguments))
        return jax.tree.unflatten(jax.tree.structure(result), values)

    return call


def lowered(
    function: Callable[..., Any], static: Mapping[str, Any], arguments: Mapping[str, PyTree]
) -> Lowered:
    """Return the lowered program of a function, from its file if there is one.

    Args:
      function: to be lowered.
      static: values of its static arguments.
      arguments: the other ones, of which types and shapes matter.
    """
    path = _path(function, static, arguments)
    found = path and _read(path)
    if not found:
        found = _lower(function, static, arguments)
        if path:
            _write(path, found)
    return found


def folder() -> Path | None:
    """Return the folder of the files, None where JAX's cache of compiled code is off."""
    cache = jax.config.jax_compilation_cache_dir
    return Path(cache) / "lowered" if cache and jax.config.jax_enable_compilation_cache else None


def _lower(function, static, arguments):
    leaves, structure = jax.tree.flatten(dict(arguments))
    types = [jax.ShapeDtypeStruct(*_type(leaf)) for leaf in leaves]
    signature, results = inspect.signature(function), []

    def program(*leaves):
        bound = signature.bind(**static, **jax.tree.unflatten(structure, leaves))
        result = function(*bound.args, **bound.kwargs)
        values, outputs = jax.tree.flatten(result)
        results.append(jax.tree.unflatten(outputs, range(len(values))))
        return values

    return Lowered(export.export(jax.jit(program))(*types), results[-1])


def _type(leaf):
    return jax.typeof(leaf).shape, jax.typeof(leaf).dtype


def _path(function, static, arguments):
    """The file of a program; None where there is no folder or it cannot be told from others."""
    where, name = folder(), f"{function.__module__}.{function.__qualname__}"
    code = _code()
    if where is None or code is None or "<locals>" in name:
        return None
    leaves, structure = jax.tree.flatten(dict(arguments))
    types = [_type(leaf) for leaf in leaves]
    settings = jax.config.jax_enable_x64, jax.config.jax_default_matmul_precision
    asked = io.BytesIO()
    pickler = pickle.Pickler(asked)
    pickler.fast = True  # the same bytes whether or not equal parts are the same object
    try:
        pickler.dump((name, dict(static), structure, types, settings, code))
    except (pickle.PicklingError, AttributeError, TypeError):
        return None
    return where / DIGEST(asked.getvalue()).hexdigest()


def _code():
    """The source code and what it uses, as a digest; None if it was edited since it was loaded."""
    files, digest = _sources()
    return None if any(file.stat().st_mtime > LOADED for file in files) else digest


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
        path.touch()  # the time of its last use
    except OSError:
        return None
    if DIGEST(content[SIZE:]).digest() != content[:SIZE]:
        return None
    program, result = pickle.loads(content[SIZE:])
    return Lowered(export.deserialize(bytearray(program)), result)


def _write(path, found):
    """Write a file if the folder is writable, and remove others if all are too large."""
    content = pickle.dumps((bytes(found.program.serialize()), found.result))
    try:
        with whole_file(path) as part:
            part.write_bytes(DIGEST(content).digest() + content)
        files = sorted(path.parent.iterdir(), key=lambda file: -file.stat().st_mtime)
        size = 0
        for file in files:
            size += file.stat().st_size
            if size > LARGEST:
                file.unlink(missing_ok=True)
    except (OSError, InvalidInput):
        return
