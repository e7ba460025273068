"""Files that are written whole or not at all."""

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from surrogate.errors import InvalidInput


@contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """A temporary path beside ``path`` that takes its place when the block succeeds."""
    path = Path(path)
    _make_folder(path.parent)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=".part-", suffix=path.suffix)
    os.close(handle)
    try:
        yield Path(name)
        Path(name).chmod(0o644)
        os.replace(name, path)
    finally:
        Path(name).unlink(missing_ok=True)


@contextmanager
def whole_folder(path: str | Path) -> Iterator[Path]:
    """A temporary folder that takes the place of ``path`` when the block succeeds."""
    path = Path(path).resolve()
    _make_folder(path.parent)
    part = Path(tempfile.mkdtemp(dir=path.parent, prefix=".part-"))
    try:
        yield part
        part.chmod(0o755)
        old = part.with_name(part.name + "-old")
        if path.exists():
            os.replace(path, old)
        try:
            os.replace(part, path)
        except OSError:
            if old.exists():
                os.replace(old, path)
            raise
        shutil.rmtree(old, ignore_errors=True)
    finally:
        shutil.rmtree(part, ignore_errors=True)


def check_target(folder: str | Path, record: str) -> None:
    """Refuse to write a folder where other files would be lost.

    Raises:
      InvalidInput: it is a file, or it holds files but not ``record``, which marks our own, or
        the folder it is to lie in cannot be written.
    """
    folder = Path(folder).resolve()
    if folder.is_file():
        raise InvalidInput(f"{folder}: is a file; --out must name a folder")
    if folder.is_dir() and any(folder.iterdir()) and not (folder / record).is_file():
        raise InvalidInput(f"{folder}: is not empty and has no {record}; choose another --out")
    _make_folder(folder.parent)


def check_file(path: str | Path, *suffixes: str) -> Path:
    """The path of a file that a job will write, its folder made before the job.

    Raises:
      InvalidInput: it is a folder, ends otherwise, or its folder is not writable.
    """
    path = Path(path)
    if path.suffix not in suffixes or path.is_dir():
        raise InvalidInput(f"--out {path}: must name a file that ends in {' or '.join(suffixes)}")
    _make_folder(path.parent)
    return path


def check_folder(folder: str | Path) -> None:
    """Make the folder of what a long job will write, before the job.

    Raises:
      InvalidInput: it cannot be made, or is not writable.
    """
    _make_folder(Path(folder))


def _make_folder(folder):
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise InvalidInput(f"{folder}: cannot be made ({problem.strerror})") from None
    if not os.access(folder, os.W_OK):
        raise InvalidInput(f"{folder}: is not writable")
