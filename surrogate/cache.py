"""JAX's persistent compilation cache, so that later processes start faster."""

import os
from pathlib import Path

import jax

from surrogate.errors import InvalidInput
from surrogate.files import make_folder


def use_compilation_cache() -> None:
    """Keep compiled code in the user's cache folder, if that is writable."""
    root = Path(os.environ.get("XDG_CACHE_HOME", ""))
    root = root if root.is_absolute() else Path.home() / ".cache"
    folder = root / "drag-surrogates" / "jax"
    try:
        make_folder(folder)
    except InvalidInput:
        return
    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.2)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", 0)
