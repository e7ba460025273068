"""Files of lowered programs, found by all that these depend on, beside JAX's compilation cache.

These are the function, the types of its arguments, settings of JAX, the source code of this project
and the versions of others. Values that a process replaces in modules of this project, as tests do,
are not seen.
"""

import contextlib
import functools
import hashlib
import io
import os
import pickle
import sys
import time
import types
from collections.abc import Callable, Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

import jax
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


def folder() -> Path | None:
    """Return the folder of the files, None where JAX's cache of compiled code is off or remote."""
    cache = jax.config.jax_compilation_cache_dir
    local = cache and "://" not in cache and jax.config.jax_enable_compilation_cache
    return Path(cache) / "lowered" if local else None


def type_of(leaf: Any) -> tuple[tuple[int, ...], Any]:
    """Return shape and dtype of an array or a number."""
    return jax.typeof(leaf).shape, jax.typeof(leaf).dtype


def program_path(
    function: Callable[..., Any], static: Mapping[str, Any], arguments: Mapping[str, PyTree]
) -> Path | None:
    """Return the file of a program; None where there is no folder or no unique name.

    Args:
      function: that the program evaluates.
      static: values of its static arguments.
      arguments: the other ones, of which types and shapes matter.
    """
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
        pickler.dump((name, dict(static), structure, [*map(type_of, leaves)], settings, code))
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
    """Return a digest of the source code and what it uses; None if it was edited since loaded."""
    try:
        files, digest = _sources()
        states = [file.stat() for file in files]
    except (OSError, metadata.PackageNotFoundError):
        return None
    edited = any(max(state.st_mtime, state.st_ctime) > LOADED for state in states)
    return None if edited else digest


@functools.cache
def _sources():
    """Return the files of the source code, and a digest of them and of other packages' versions."""
    files = sorted(path for source in SOURCES for path in source.rglob("*.py"))
    versions = [metadata.version(package).encode() for package in PACKAGES]
    return files, DIGEST(b"\n".join([*versions, *(path.read_bytes() for path in files)])).digest()


def read_content(path: Path) -> bytes | None:
    """Return what was written to a file; None if there is none, or a damaged one."""
    try:
        content = path.read_bytes()
    except OSError:
        return None
    if DIGEST(content[SIZE:]).digest() != content[:SIZE]:
        return None
    with contextlib.suppress(OSError):
        os.utime(path)  # the time of its last use
    return content[SIZE:]


def write_content(path: Path, content: bytes) -> None:
    """Write a file, and remove others if all are too large.

    Raises:
      OSError: It could not be written.
    """
    with whole_file(path) as part:
        part.write_bytes(DIGEST(content).digest() + content)
    size = 0
    files = (file for file in path.parent.iterdir() if file.is_file())
    for file in sorted(files, key=lambda file: -file.stat().st_mtime):
        size += file.stat().st_size
        if size > LARGEST:
            file.unlink(missing_ok=True)
