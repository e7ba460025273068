"""Files that are written whole or not at all; nothing of the user's is ever deleted."""

import os
import shutil
import tempfile
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path

from surrogate.errors import InvalidInput

try:
    import fcntl
except ImportError:
    fcntl = None


@contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """A temporary path beside ``path`` that takes its place when the block succeeds."""
    path = Path(path)
    make_folder(path.parent)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=".part-", suffix=path.suffix)
    os.close(handle)
    try:
        yield Path(name)
        Path(name).chmod(0o644)
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
    ``record``, which says what the others are, comes last.
    """
    folder = Path(folder).resolve()
    make_folder(folder)
    part = Path(tempfile.mkdtemp(dir=folder, prefix=".part-"))
    try:
        yield part
        for path in sorted(part.iterdir(), key=lambda path: path.name == record):
            os.replace(path, folder / path.name)
    finally:
        shutil.rmtree(part, ignore_errors=True)


def check_target(folder: str | Path, record: str, others: Collection[str] = ()) -> None:
    """Make sure that a folder may be written to: it is new, empty, or our own.

    Our own holds the ``record``, or nothing but files of the names of ours (``others``).

    Raises:
      InvalidInput: it is a file, a stranger's folder, or cannot be written.
    """
    folder = Path(folder).resolve()
    if folder.is_file():
        raise InvalidInput(f"{folder}: is a file; a folder is needed")
    if folder.is_dir() and not (folder / record).is_file():
        names = {path.name for path in folder.iterdir() if not path.name.startswith(".part-")}
        if foreign := sorted(names - set(others)):
            raise InvalidInput(
                f"{folder}: is not empty and has no {record} but {foreign[0]}; "
                "choose another folder"
            )
    make_folder(folder if folder.is_dir() else folder.parent)


def check_file(path: str | Path, *suffixes: str) -> Path:
    """The path of a file that a job will write, its folder made before the job.

    Raises:
      InvalidInput: it is a folder, ends otherwise, or its folder is not writable.
    """
    path = Path(path)
    if path.suffix not in suffixes or path.is_dir():
        raise InvalidInput(f"{path}: must name a file that ends in {' or '.join(suffixes)}")
    make_folder(path.parent)
    return path


def make_folder(folder: Path) -> None:
    """Make a folder that a job will write to.

    Raises:
      InvalidInput: it cannot be made, or is not writable.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise InvalidInput(f"{folder}: cannot be made ({problem.strerror})") from None
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as problem:
        raise InvalidInput(f"{folder}: is not writable ({problem.strerror})") from None
