"""Messages of a bag as paths name them: `bag.mcap#/topic`, `bag.mcap#/topic@12.5`, `bag.mcap#/topic@12.5x10`."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path

from regionpose.io.reading import FileError

BAG_ENDINGS = (".bag", ".mcap", ".db3")
"""Endings of the names of bags in one file: ROS 1, ROS 2 in MCAP, ROS 2 in SQLite."""

METADATA = "metadata.yaml"
"""The file that makes a folder a bag of ROS 2."""

MARK = "#/"
"""What stands between the bag and the topic, with the topic's slash."""

WHEN = re.compile(r"(?P<time>\d{1,12}(\.\d{1,9})?)(x(?P<count>[1-9]\d{0,5}))?")
"""A time in seconds, and how many messages."""

NANOSECONDS = 10**9


@dataclass(frozen=True)
class BagPlace:
    """Messages of a bag: the `count` of a topic from the one nearest to a time on, the first ones without a time.

    `time_ns`: nanoseconds from the bag's beginning, or since 1970.
    """

    bag: Path
    topic: str
    time_ns: int | None = None
    count: int = 1

    def __str__(self) -> str:
        """As a path names it, without the time."""
        return f"{self.bag}#{self.topic}"


def bag_place(path: str | Path) -> BagPlace | None:
    """The messages that a path names; None of a path without `#/topic` after a bag's name, or to a file that is there.

    FileError for a time that is none.
    """
    bag, mark, rest = str(path).partition(MARK)
    if not mark or not is_bag(Path(bag)) or os.path.exists(path):
        return None
    topic, at, when = rest.partition("@")
    if not topic:
        raise FileError(f"{path}: found no topic; needed such as {bag}#/points@12.5")
    if not at:
        return BagPlace(Path(bag), f"/{topic}")
    found = WHEN.fullmatch(when)
    if found is None:
        needed = "seconds, from the bag's beginning or since 1970, as @12.5, or with a number of scans, as @12.5x10"
        raise FileError(f"{path}: found {when!r} after @; needed {needed}")
    return BagPlace(Path(bag), f"/{topic}", int(Decimal(found["time"]) * NANOSECONDS), int(found["count"] or 1))


def is_there(path: str | Path) -> bool:
    """Whether the file of a path is there, or the bag whose messages it names."""
    place = bag_place(path)
    return os.path.exists(path if place is None else place.bag)


def is_bag(path: Path) -> bool:
    """Whether a path is that of a bag by its name, or a folder with a bag of ROS 2."""
    return path.suffix.lower() in BAG_ENDINGS or os.path.isfile(path / METADATA)
