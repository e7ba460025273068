"""Contours from files: CSV in its variants, Selig's and Lednicer's coordinates."""

import re
from pathlib import Path

import numpy as np
from jaxtyping import Float

from surrogate.arrays import AnyArray
from surrogate.errors import InvalidInput
from surrogate.files import path_of

FAR = 8.0  # sizes from the body, beyond which a first row is not a point of it
TOGETHER = 0.1  # sizes of the body between the first points of both sides, at most
TITLES = 5  # rows of titles and headers, at most
LARGEST = 1 << 27  # bytes of a file, at most


def read_contour(path: str | Path) -> Float[AnyArray, "points 2"]:
    """Return the points (x, y) of a contour file: CSV with usual delimiters, Selig's or Lednicer's.

    Titles, headers, comments and empty lines are passed over; decimal commas and Fortran's
    exponents are read. Columns beyond x and y are passed over where a header names them all.

    Raises:
      InvalidInput: the file is missing, too large or not text, a row is not two finite numbers, a
        header names y first, or Lednicer's counts are not those of the rows.
    """
    path = path_of(path)
    lines = [_bare(line) for line in _text(path).splitlines()]
    rows = [(k, _words(line)) for k, line in enumerate(lines, start=1) if line]
    count, header = len(rows), list[str]()
    while rows and _is_title(rows[0][1]) and count - len(rows) < TITLES:
        header = _columns(rows[0][1])
        if header[:2] == ["y", "x"]:
            raise InvalidInput(f"contour {path}: row {rows[0][0]} names y first; x comes first")
        rows = rows[1:]
    if not rows:
        raise InvalidInput(
            f"contour {path}: none of its {len(lines)} rows is two finite numbers, x and y; "
            "columns apart by commas, semicolons, tabs or spaces are read"
        )
    points = []
    for k, words in rows:
        named = len(words) == len(header) and header[:2] == ["x", "y"]
        if (pair := _pair(words[:2] if named else words)) is None:
            raise InvalidInput(f"contour {path}: row {k} must be two finite numbers, x and y")
        points.append(pair)
    counts, sides = points[0], np.array(points[1:]).reshape(-1, 2)
    if len(sides) and np.abs(counts - sides.mean(axis=0)).max() > FAR * np.ptp(sides):
        points = points[1:]  # numbers that stand so far off are a title, or Lednicer's counts
    if _are_counts(counts, sides):  # Lednicer: both sides from nose to tail
        upper = int(counts[0])
        return np.concatenate([sides[:upper], sides[: upper - 1 : -1]])
    if len(points) == len(sides) and _nearly(counts, len(sides)):
        stated = " + ".join(f"{count:g}" for count in counts)
        raise InvalidInput(
            f"contour {path}: row {rows[0][0]} counts {stated} points, where {len(sides)} follow"
        )
    return np.array(points)


def _text(path):
    """Return the text of a file that is not too large, in UTF-16 if its first bytes say so."""
    try:
        with path.open("rb") as file:
            content = file.read(LARGEST + 1)
    except OSError as problem:
        raise InvalidInput(f"contour {path}: cannot be read ({problem.strerror})") from None
    if len(content) > LARGEST:
        raise InvalidInput(f"contour {path}: is larger than {LARGEST >> 20} MiB")
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return content.decode("utf-16", "replace")
    if b"\0" in content:
        raise InvalidInput(f"contour {path}: cannot be read (it is not a text file)")
    return content.decode("utf-8-sig", "replace")  # titles may have any encoding


def _bare(line):
    """Return a row without comments, its minus signs in ASCII."""
    line = re.split(r"#|%|!|//", line)[0].replace("\N{MINUS SIGN}", "-")
    return line.strip().strip(",;|").strip()


def _is_title(words):
    """Whether a row is a title or header, as is a single number; other numbers are wrong rows."""
    return _pair(words) is None and (len(words) == 1 or not _are_numbers(words))


def _words(line):
    """Split a row; two columns may have decimal commas, and D instead of E in exponents."""
    line = re.sub(r"(?<=[\d.])[dD](?=[+-]?\d)", "e", line.replace('"', ""))
    columns = re.split(r"[\s;|]+", line)
    if len(columns) == 2 and re.search(r"\d,\d", line):
        return [re.sub(r"(?<=\d),(?=\d)", ".", column) for column in columns]
    return re.split(r"[\s,;|]+", line)


def _columns(words):
    """Return the names of a header's columns in lower case, without units: x of ``x[mm]``, x/c."""
    names = (re.match(r"[A-Za-z]+", word) for word in words)
    return [name[0].lower() for name in names if name]


def _are_counts(counts, sides):
    """Whether two numbers are Lednicer's counts of the points that follow, noses together."""
    upper = int(counts[0])
    if sum(counts) != len(sides) or counts[0] != upper or min(counts) < 2:
        return False
    return np.abs(sides[0] - sides[upper]).max() < TOGETHER * np.ptp(sides)


def _nearly(counts, points):
    """Whether two whole numbers are meant as Lednicer's counts of this number of points."""
    whole = all(count == round(count) and count >= 2 for count in counts)
    return whole and 0.8 < sum(counts) / points < 1.25


def _pair(words):
    """Return the two finite numbers of a row, or None."""
    try:
        values = [float(word) for word in words]
    except ValueError:
        return None
    return values if len(values) == 2 and np.all(np.isfinite(values)) else None


def _are_numbers(words):
    """Whether all words are numbers, nan included."""
    try:
        return bool([float(word) for word in words])
    except ValueError:
        return False
