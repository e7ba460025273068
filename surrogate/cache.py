"""Compiled code kept between processes, so that a second start is quick."""

import os
from pathlib import Path

import jax


def use_compilation_cache() -> None:
    """Keep what JAX compiles in the user's cache folder."""
    root = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    jax.config.update("jax_compilation_cache_dir", str(root / "drag-surrogates" / "jax"))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.2)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", 0)
