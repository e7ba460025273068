"""Versions of the packages that a result was made with."""

import importlib.metadata

PACKAGES = ("jax", "jaxlib", "jax-cfd", "numpy")


def versions() -> dict[str, str]:
    """Return the versions of this package and of those that its numbers depend on."""
    names = {"drag-surrogates": package_version()}
    return names | {name: importlib.metadata.version(name) for name in PACKAGES}


def package_version() -> str:
    """Return the version of this package."""
    return importlib.metadata.version("drag-surrogates")
