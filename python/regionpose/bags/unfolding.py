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

from regionpose.extras import MissingExtraError, load_extra
from regionpose.reading import FileError, most_bytes

Opener = Callable[[IO[bytes]], IO[bytes]]


class Budget(NamedTuple):
    """Bytes to which each chunk of a bag may unfold."""

    bag: Path
    most: int


BUDGET: ContextVar[Budget | None] = ContextVar("BUDGET", default=None)
"""That of the bag that is being read; None where someone else reads with rosbags."""


@contextmanager
def bounded(bag: Path) -> Iterator[None]:
    """Bound what each chunk of a bag unfolds to while it is read: FileError beyond, `reading.most_bytes` of it."""
    _install()
    files = [bag] if bag.is_file() else sorted(path for path in bag.rglob("*") if path.is_file())
    token = BUDGET.set(Budget(bag, max(map(most_bytes, files), default=0)))
    try:
        yield
    finally:
        BUDGET.reset(token)


@cache
def _install() -> None:
    """Put bounded decompressors in the place of those of rosbags."""
    ros1, ros2 = load_extra("rosbags.rosbag1.reader", "ros", "ROS"), load_extra("rosbags.rosbag2.reader", "ros", "ROS")
    mcap = load_extra("rosbags.rosbag2.storage_mcap", "ros", "ROS")
    lz4 = load_extra("lz4.frame", "ros", "ROS")
    try:
        of_chunks, of_mcap, zstd = ros1.decompressors, mcap.DECOMPRESSORS, ros2.zstd
    except AttributeError as error:
        message = f'found another version of rosbags ({error}); needed pip install "regionpose[ros]"'
        raise MissingExtraError(message, name="rosbags") from error
    for held, name, opener in (
        (of_chunks, "bz2", bz2.open),
        (of_chunks, "lz4", lz4.open),
        (of_mcap, "lz4", lz4.open),
        (of_mcap, "zstd", zstd.open),
    ):
        held[name] = _within_budget(opener, held[name])
    # Messages that are compressed one by one.
    ros2.zstd = SimpleNamespace(open=zstd.open, decompress=_within_budget(zstd.open, zstd.decompress))


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
