"""Files that are written whole or not at all; nothing of the user's is ever deleted."""

import hashlib
import json
import os
import shutil
import tempfile
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from surrogate.errors import InvalidInput

LEAST_ROOM = 1 << 18  # bytes that a folder must take before a job begins

try:
    import fcntl
except ImportError:
    fcntl = None


@contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """A temporary path beside ``path`` that takes its place when the block succeeds."""
    path = Path(path).resolve()  # a link stays one
    make_folder(path.parent)
    mode = path.stat().st_mode if path.is_file() else 0o644
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=".part-", suffix=path.suffix)
    os.close(handle)
    try:
        yield Path(name)
        Path(name).chmod(mode)
        os.replace(name, path)
    finally:
        Path(name).unlink(missing_ok=True)


@contextmanager
def locked(folder: str | Path) -> Iterator[None]:
    """One process at a time; who dies in the block frees it. POSIX alone knows such locks."""
    if fcntl is None:
        yield
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)


@contextmanager
def whole_files(folder: str | Path, record: str) -> Iterator[Path]:
    """A temporary folder whose files are put into ``folder`` when the block succeeds.

    Each takes the place of an older one of its name; everything else in the folder stays. The
    ``record`` comes first: by it the folder is known as ours if this is interrupted.
    """
    folder = Path(folder).resolve()
    make_folder(folder)
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
    files: Collection[str] = (),
    others: Collection[str] = (),
) -> None:
    """Make sure that a folder may be written to: it is new, empty, or our own.

    Our own holds the ``record``, a JSON object with these ``keys``, or nothing but what has the
    names of ``others``. None of the ``files`` that will be written may be a folder.

    Raises:
      InvalidInput: it is a file, a stranger's folder, or cannot be written.
    """
    folder = path_of(folder).resolve()
    if folder.exists() and not folder.is_dir():
        raise InvalidInput(f"{folder}: is no folder; one is needed")
    if folder.is_dir() and (folder / record).is_file():
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
    for name in (record, *files):
        if (folder / name).is_dir():
            raise InvalidInput(f"{folder / name}: is a folder, where a file is to be written")
    make_folder(folder if folder.is_dir() else folder.parent, LEAST_ROOM)


def path_of(value: Any) -> Path:
    """A path, of text or of a path.

    Raises:
      InvalidInput: it is neither.
    """
    if not isinstance(value, str | os.PathLike) or not str(value) or "\0" in str(value):
        raise InvalidInput(f"path {value!r}: text or a path is needed")
    try:
        str(value).encode()
        Path(value).is_dir()
    except UnicodeEncodeError:
        raise InvalidInput(f"path {value!r}: is not of Unicode's letters") from None
    except OSError as problem:
        raise InvalidInput(f"path {value!s:.40}...: {problem.strerror}") from None
    return Path(value)


def strict_json(text: str) -> Any:
    """What a text of JSON says, in which there is no NaN and no infinity.

    Raises:
      ValueError: it is none.
    """

    def refuse(word):
        raise ValueError(word)

    return json.loads(text, parse_constant=refuse)


def json_digest(value: Any) -> str:
    """Of what JSON can say, by which an altered letter is noticed."""
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()


def _has_keys(path, keys):
    """Whether a file is a JSON object with these keys."""
    try:
        value = strict_json(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return False
    return isinstance(value, dict) and set(keys) <= set(value)


def check_file(path: str | Path, *suffixes: str) -> Path:
    """The path of a file that a job will write, its folder made before the job.

    Raises:
      InvalidInput: it is a folder, ends otherwise, or its folder is not writable.
    """
    path = path_of(path)
    if path.suffix not in suffixes or path.is_dir():
        raise InvalidInput(f"{path}: must name a file that ends in {' or '.join(suffixes)}")
    make_folder(path.parent, LEAST_ROOM)
    return path


def make_folder(folder: Path, room: int = 0) -> None:
    """Make a folder that a job will write to, and see that it takes so many bytes.

    Raises:
      InvalidInput: it cannot be made, or is not writable.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise InvalidInput(f"{folder}: cannot be made ({problem.strerror})") from None
    try:
        with tempfile.TemporaryFile(dir=folder) as probe:
            probe.write(bytes(room))
            probe.flush()
    except OSError as problem:
        raise InvalidInput(f"{folder}: is not writable ({problem.strerror})") from None
