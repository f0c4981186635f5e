"""Chunks of bags decompressed within their file's budget, where rosbags would unfold whatever a chunk holds."""

from __future__ import annotations

import bz2
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from io import BytesIO
from pathlib import Path
from types import SimpleNamespace
from typing import IO, Any, NamedTuple

from regionpose.io.reading import FileError, check_regular, most_bytes
from regionpose.validation.extras import MissingExtraError, load_extra

LEAST_LENGTH = 1 << 16
"""Bytes of a value that SQLite needs for its own work, such as on the text of a query: a convention."""

Opener = Callable[[IO[bytes]], IO[bytes]]


class Budget(NamedTuple):
    """Bytes to which each chunk of a bag may unfold, and those of its largest file, which no value in it exceeds."""

    bag: Path
    most: int
    largest_bytes: int


BUDGET: ContextVar[Budget | None] = ContextVar("BUDGET", default=None)
"""That of the bag that is being read; None where someone else reads with rosbags."""


@contextmanager
def bounded(bag: Path) -> Iterator[None]:
    """Bound what each chunk of a bag unfolds to while it is read: FileError beyond, `reading.most_bytes` of it."""
    _install()
    held_paths = [bag] if bag.is_file() else sorted(bag.rglob("*"))
    for path in held_paths:
        check_regular(path)
    files = [path for path in held_paths if path.is_file()]
    largest_bytes = max((file.stat().st_size for file in files), default=0)
    token = BUDGET.set(Budget(bag, max(map(most_bytes, files), default=0), largest_bytes))
    try:
        yield
    finally:
        BUDGET.reset(token)


@cache
def _install() -> None:
    """Put bounded decompressors in the place of those of rosbags."""
    ros1, ros2 = load_extra("rosbags.rosbag1.reader", "ros", "ROS"), load_extra("rosbags.rosbag2.reader", "ros", "ROS")
    mcap = load_extra("rosbags.rosbag2.storage_mcap", "ros", "ROS")
    sqlite, lz4 = load_extra("rosbags.rosbag2.storage_sqlite3", "ros", "ROS"), load_extra("lz4.frame", "ros", "ROS")
    try:
        of_chunks, of_mcap, zstd = ros1.decompressors, mcap.DECOMPRESSORS, ros2.zstd
        apsw = sqlite.apsw
    except AttributeError as error:
        message = f'found another version of rosbags ({error}); needed pip install "regionpose[ros]"'
        raise MissingExtraError(message, name="rosbags") from error
    for registry, name, opener in (
        (of_chunks, "bz2", bz2.open),
        (of_chunks, "lz4", lz4.open),
        (of_mcap, "lz4", lz4.open),
        (of_mcap, "zstd", zstd.open),
    ):
        registry[name] = _within_budget(opener, registry[name])
    sqlite.apsw = SimpleNamespace(**vars(apsw) | {"Connection": _of_stored_values(apsw)})
    # Messages that are compressed one by one.
    ros2.zstd = SimpleNamespace(open=zstd.open, decompress=_within_budget(zstd.open, zstd.decompress))


def _of_stored_values(apsw: Any) -> type:
    """A connection to SQLite that refuses values longer than the bag: columns may be computed, a gigabyte each."""

    class Connection(apsw.Connection):  # type: ignore[misc]
        def __init__(self, *given: Any, **named: Any) -> None:
            super().__init__(*given, **named)
            budget = BUDGET.get()
            if budget is not None:
                self.limit(apsw.SQLITE_LIMIT_LENGTH, min(max(budget.largest_bytes, LEAST_LENGTH), 2**31 - 1))

    return Connection


def _within_budget(opener: Opener, whole: Callable[..., bytes]) -> Callable[..., bytes]:
    """What unfolds bytes by a stream, no farther than a budget; by `whole` where there is none."""

    def unfolded(packed: bytes, *promised: Any) -> bytes:
        budget = BUDGET.get()
        if budget is None:
            return whole(packed, *promised)
        with opener(BytesIO(packed)) as stream:
            content = stream.read(budget.most + 1)
        if len(content) > budget.most:
            raise FileError(
                f"{budget.bag}: found a chunk of {len(packed)} bytes that holds more than {budget.most}; "
                "needed a bag of smaller chunks"
            )
        return content

    return unfolded
