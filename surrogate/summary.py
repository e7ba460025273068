"""How results describe themselves in lines of text."""

from collections.abc import Mapping


def aligned(rows: Mapping[str, str]) -> str:
    """Return one line of text for each row, with all values in one column."""
    width = max(map(len, rows))
    return "\n".join(f"{name:{width}}  {value}" for name, value in rows.items())


def listed(named: Mapping[str, float]) -> str:
    """Return named numbers in one line, as "aspect 2, beta2 0.1"."""
    return ", ".join(f"{name} {value:.4g}" for name, value in named.items())
