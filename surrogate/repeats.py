"""Repeated work: how the settings of a stored result differ from those that are asked for."""

from collections.abc import Iterator
from pathlib import Path

from surrogate.checks import shown
from surrogate.errors import InvalidInput
from surrogate.files import JsonObject, strict_json

MOST_NAMED = 3  # differences in a message


def differences(stored: JsonObject, asked: JsonObject) -> str:
    """Return in words in which settings a stored result differs from what is asked; "" if in none.

    Args:
      stored: settings of the result, plain values by name; tables may be nested.
      asked: the same of what is asked for.
    """
    theirs, ours = dict(_flat(stored)), dict(_flat(asked))
    names = [name for name in theirs | ours if theirs.get(name) != ours.get(name)]
    words = [f"{n} {_word(theirs.get(n))}, not {_word(ours.get(n))}" for n in names[:MOST_NAMED]]
    return "; ".join([*words, "and more"] if len(names) > MOST_NAMED else words)


def refusal(folder: object, what: str, found: str) -> str:
    """Return the message for a folder that holds a result of other settings than those asked for.

    Args:
      folder: that holds it.
      what: kind of result, as "training".
      found: how it differs, by ``differences``.
    """
    return (
        f"{folder}: holds another {what} ({found}); overwrite (--overwrite) replaces it, or choose "
        "another folder"
    )


def check_settings(folder: object, what: str, stored: object, asked: JsonObject) -> None:
    """Raise InvalidInput if a folder holds a result of other settings than those asked for.

    Args:
      folder: that holds it.
      what: kind of result, as "design".
      stored: settings in its record, if there are any.
      asked: settings of what is asked for.
    """
    found = differences(stored, asked) if isinstance(stored, dict) else "of unknown settings"
    if found:
        raise InvalidInput(refusal(folder, what, found))


def check_record(record: Path, what: str, asked: JsonObject) -> JsonObject | None:
    """Return a result's record, or None if there is none, and check that it is of what is asked.

    Args:
      record: JSON file of a result, with the entry "settings".
      what: kind of result, as "flow".
      asked: settings of what is asked for.

    Raises:
      InvalidInput: the result is of other settings.
    """
    if not record.is_file():
        return None
    stored = strict_json(record.read_text(encoding="utf-8"))
    check_settings(record.parent, what, stored.get("settings"), asked)
    return stored


def _flat(table: JsonObject, prefix: str = "") -> Iterator[tuple[str, object]]:
    """Yield the settings of nested tables, names joined by blanks."""
    for name, value in table.items():
        full = f"{prefix}{name.replace('_', ' ')}"
        if isinstance(value, dict):
            yield from _flat(value, f"{full} ")
        else:
            yield full, list(value) if isinstance(value, tuple) else value


def _word(value):
    if isinstance(value, list) and len(value) == 2:
        return f"{_word(value[0])} to {_word(value[1])}"
    if isinstance(value, float):
        return f"{value:.10g}"
    return value if isinstance(value, str) else "none" if value is None else shown(value)
