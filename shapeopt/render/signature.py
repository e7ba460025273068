"""Pictures that carry the project's name, so that no other is ever replaced."""

import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from surrogate.errors import InvalidInput
from surrogate.files import check_file, whole_file

NAME = b"drag-surrogates"
TEXT = b"tEXtSource\0" + NAME  # chunk of a PNG; its last, which says nothing, has 12 bytes
COMMENT = b"\x21\xfe" + bytes([len(NAME)]) + NAME + b"\0"  # of a GIF, whose last byte ends it


@contextmanager
def whole_picture(path: str | Path) -> Iterator[Path]:
    """A ``whole_file``, which is signed when the block succeeds where it is a PNG or GIF."""
    with whole_file(path) as part:
        yield part
        data = part.read_bytes()
        if data.startswith(b"\x89PNG"):
            ends = struct.pack(">I", len(TEXT) - 4), struct.pack(">I", zlib.crc32(TEXT))
            data = data[:-12] + ends[0] + TEXT + ends[1] + data[-12:]
        elif data.startswith(b"GIF8"):
            data = data[:-1] + COMMENT + data[-1:]
        part.write_bytes(data)


def check_picture(path: str | Path, *suffixes: str) -> Path:
    """The path of a picture to be drawn.

    Raises:
      InvalidInput: it is no such path, or a picture of another program is there.
    """
    path = check_file(path, *suffixes)
    if path.is_file() and NAME not in path.read_bytes()[-64:]:
        raise InvalidInput(f"{path}: is of another program; choose another name")
    return path
