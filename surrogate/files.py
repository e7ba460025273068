"""Atomic writing of files and folders, checks of paths before a job, and strict JSON."""

import contextlib
import hashlib
import json
import os
import shutil
import tempfile
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

from surrogate.errors import InvalidInput

JsonObject = dict[str, Any]  # as the standard library's json has it


@contextlib.contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path that replaces ``path`` when the block succeeds."""
    path = target_of(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    part = Path(tempfile.mkdtemp(dir=path.parent, prefix=".part-"))
    try:
        yield part / path.name
        if path.is_file():
            (part / path.name).chmod(path.stat().st_mode)
        os.replace(part / path.name, path)
    finally:
        shutil.rmtree(part, ignore_errors=True)


@contextlib.contextmanager
def whole_files(folder: str | Path, record: str) -> Iterator[Path]:
    """Yield a temporary folder whose files are moved into ``folder`` when the block succeeds.

    Files of the same names are replaced, all others stay. The file ``record`` is moved first, so
    that ``check_target`` accepts the folder again if the process is killed in between.
    """
    folder = target_of(folder)
    folder.mkdir(parents=True, exist_ok=True)
    part = Path(tempfile.mkdtemp(dir=folder, prefix=".part-"))
    try:
        yield part
        for path in sorted(part.iterdir(), key=lambda path: path.name != record):
            os.replace(path, folder / path.name)
    finally:
        shutil.rmtree(part, ignore_errors=True)


def check_target(
    folder: str | Path,
    record: str,
    keys: Collection[str],
    others: Collection[str] = (),
) -> None:
    """Check that results may be written to ``folder``, without making it.

    It must be new, empty, hold a ``record`` of earlier results (a JSON object that has ``keys``),
    or hold only files named in ``others``, which an interrupted command leaves.

    Args:
      folder: of the results; its parent is made if it is missing.
      record: name of the file with the record of earlier results.
      keys: names that the record must have.
      others: names of files that may be there without a record.

    Raises:
      InvalidInput: the folder holds something else, or is not writable.
    """
    folder = target_of(folder)
    if folder.exists() and not folder.is_dir():
        raise InvalidInput(f"{folder}: is a file; a folder is needed")
    if (folder / record).is_file():
        if not _has_keys(folder / record, keys):
            raise InvalidInput(
                f"{folder}: its {record} is damaged or of another program; choose another folder"
            )
    elif folder.is_dir():
        names = {path.name for path in folder.iterdir() if not path.name.startswith(".part-")}
        if foreign := sorted(names - set(others)):
            raise InvalidInput(
                f"{folder}: is not empty and has no {record} but {foreign[0]}; "
                "choose another folder"
            )
    make_folder(folder if folder.is_dir() else folder.parent)


def check_file(path: str | Path, *suffixes: str) -> Path:
    """Check the path of a file to be written, make its folder, and return the path.

    Raises:
      InvalidInput: it is a folder, has none of the ``suffixes``, or its folder is not writable.
    """
    path = path_of(path)
    if path.suffix not in suffixes or path.is_dir():
        raise InvalidInput(f"{path}: must name a file that ends in {' or '.join(suffixes)}")
    make_folder(target_of(path).parent)
    return path


def make_folder(folder: Path) -> None:
    """Make a folder, with its parents, and check that it is writable.

    Raises:
      InvalidInput: it cannot be made, or is not writable.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        raise InvalidInput(f"{folder}: is not writable ({error.strerror})") from None


def path_of(value: object) -> Path:
    """Return a path given as text or as a path.

    Raises:
      InvalidInput: it is neither, is empty, or not a valid name in the file system.
    """
    if not isinstance(value, str | os.PathLike) or not str(value):
        raise InvalidInput(f"path {value!r}: text or a path is needed")
    try:
        str(value).encode()
        Path(value).lstat()
    except (FileNotFoundError, NotADirectoryError, PermissionError):
        pass  # refused, or made, where it is used
    except (OSError, ValueError) as error:  # too long, not Unicode, or with a null character
        name = f"{str(value)[:40]!r}"
        raise InvalidInput(f"path {name}: no valid file name, {error.args[-1]}") from None
    return Path(value)


def target_of(value: object) -> Path:
    """Return the absolute path that a path names, through symbolic links.

    Raises:
      InvalidInput: as ``path_of``, or a link leads back to itself.
    """
    path = path_of(value)
    with contextlib.suppress(RuntimeError):  # by Python 3.11 and 3.12; later ones return the link
        if not (target := path.resolve()).is_symlink():
            return target
    raise InvalidInput(f"{path}: a symbolic link that leads back to itself")


def strict_json(text: str) -> Any:
    """Return the value of a JSON text, in which NaN and infinity are not allowed.

    Raises:
      ValueError: it is not JSON.
    """

    def refuse(word):
        raise ValueError(f"{word} is not JSON")

    return json.loads(text, parse_constant=refuse)


def file_digest(path: Path) -> str:
    """Return the SHA-256 digest of a file, in hexadecimal digits."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def file_digests(folder: Path) -> dict[str, str]:
    """Return the digests of all files of a folder by their names, for its record."""
    return {path.name: file_digest(path) for path in sorted(folder.iterdir())}


def changed_files(folder: Path, digests: dict[str, str]) -> list[str]:
    """Return which files of a folder are missing, or have other digests than those by name."""
    paths = {name: folder / name for name in digests}
    return [n for n, path in paths.items() if not path.is_file() or file_digest(path) != digests[n]]


def json_digest(value: object) -> str:
    """Return the SHA-256 digest of a JSON value, by which later changes of it are detected."""
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()


def _has_keys(path, keys):
    try:
        value = strict_json(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return False
    return isinstance(value, dict) and set(keys) <= set(value)
