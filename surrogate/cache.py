"""JAX's persistent compilation cache, which later processes start from; on by default.

JAX's own settings rule: ``JAX_COMPILATION_CACHE_DIR=/folder`` moves it (and leaves its size to
JAX), ``JAX_ENABLE_COMPILATION_CACHE=false`` turns it off. The same by ``jax.config.update``. The
files of ``program_files`` lie in the same folder.
"""

import os
import time
from pathlib import Path

import jax

from surrogate.errors import InvalidInput
from surrogate.files import make_folder

LARGEST = 2 * 1024**3  # bytes; JAX then removes what was not used for longest
LEAST_SECONDS, JAX_SECONDS = 0.1, 1.0  # of compilation that are worth a file, here and by default


def use_compilation_cache() -> None:
    """Keep compiled code in the user's cache folder, if it is writable and no other is set.

    In any folder, code is worth a file that took a tenth of a second, unless the user has set a
    least time other than JAX's default.
    """
    if jax.config.jax_persistent_cache_min_compile_time_secs == JAX_SECONDS:
        jax.config.update("jax_persistent_cache_min_compile_time_secs", LEAST_SECONDS)
    if jax.config.jax_compilation_cache_dir is not None:
        return
    root = Path(os.environ.get("XDG_CACHE_HOME", ""))
    try:
        root = root if root.is_absolute() else Path.home() / ".cache"
        folder = root / "drag-surrogates" / "compiled"  # "jax" is that of versions without a bound
        make_folder(folder)
        _complete(folder)
    except (InvalidInput, OSError, RuntimeError):  # the last where the user has no home
        return
    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_compilation_cache_max_size", LARGEST)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", 0)


def _complete(folder):
    """Add the time stamps that entries lack.

    JAX writes an entry before its time stamp. Where a process was killed between the two, or the
    folder had no bound before, it could remove nothing from the cache and add nothing to it.
    """
    for entry in folder.glob("*-cache"):
        stamp = entry.with_name(f"{entry.name.removesuffix('-cache')}-atime")
        if not stamp.exists():
            stamp.write_bytes(time.time_ns().to_bytes(8, "little"))
