"""How results describe themselves in lines of text."""

from collections.abc import Mapping


def aligned(rows: Mapping[str, str]) -> str:
    """Return one line of text for each row, with all values in one column."""
    width = max(map(len, rows))
    return "\n".join(f"{name:{width}}  {value}" for name, value in rows.items())


def listed(named: Mapping[str, float]) -> str:
    """Return named numbers in one line, as "aspect 2, beta2 0.1"."""
    return ", ".join(f"{name} {value:.4g}" for name, value in named.items())


def steady_text(reynolds: float, onset: float) -> str:
    """Return up to which Re the steady flow is stable, and whether this one is beyond it."""
    only = "only " if reynolds > onset else ""
    return f"{only}to Re {onset:.3g}, by an estimate"
