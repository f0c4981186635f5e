"""Files read in pieces, with progress reports and handling of Ctrl-C in between."""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from regionpose.progress import Progress

PIECE_BYTES = 1 << 24
"""Bytes read at once: a tenth of a second from a slow disk."""

PIECE_POINTS = 1 << 18
"""Points read at once: a tenth of a second where they are compressed."""

WHITE_SPACE = (b"\n", b" ", b"\r", b"\t")


class ProgressFile(io.RawIOBase):
    """A file from byte `offset` on that reports the fraction read to `progress`."""

    def __init__(self, path: Path, offset: int, progress: Progress | None) -> None:
        """Open it."""
        self._file = path.open("rb", buffering=0)
        self._at, self._size, self._progress = self._file.seek(offset), path.stat().st_size, progress

    def readable(self) -> bool:
        """Return True."""
        return True

    def readinto(self, buffer: Any) -> int:
        """Fill the buffer with at most a piece; return the number of bytes read."""
        count = self._file.readinto(memoryview(buffer)[:PIECE_BYTES])
        self._at += count
        if self._progress is not None and count:
            self._progress(min(1.0, self._at / self._size))
        return count

    def close(self) -> None:
        """Close it."""
        self._file.close()
        super().close()


def file_bytes(path: Path, offset: int = 0, *, progress: Progress | None = None) -> NDArray[np.uint8]:
    """The bytes of a file from `offset` on."""
    data = np.empty(max(0, path.stat().st_size - offset), dtype=np.uint8)
    at = 0
    with ProgressFile(path, offset, progress) as file:
        while count := file.readinto(data[at:]):
            at += count
    return data[:at]


def file_words(path: Path, offset: int, *, progress: Progress | None = None) -> Iterator[bytes]:
    """The text of a file from byte `offset` on, in pieces that end between words."""
    rest = b""
    with ProgressFile(path, offset, progress) as file:
        while piece := file.read(PIECE_BYTES):
            rest += piece
            end = max(rest.rfind(mark) for mark in WHITE_SPACE) + 1
            yield rest[:end]
            rest = rest[end:]
    yield rest
