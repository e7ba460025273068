"""Laminar drag surrogates: a flow solver on jax-cfd, and networks trained through it."""

import os
from pathlib import Path

import jax

jax.config.update("jax_enable_x64", True)


def use_compilation_cache() -> None:
    """Keep compiled code between processes, so that a second start is quick."""
    root = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache"))
    jax.config.update("jax_compilation_cache_dir", str(root / "drag-surrogates" / "jax"))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.2)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", 0)
