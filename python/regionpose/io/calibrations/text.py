"""The text of a calibration file, the error that names a place in it, and the choice among its cameras."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from regionpose.cameras import Camera
from regionpose.io.bags.camera_info import camera_info_text
from regionpose.io.bags.place import bag_place
from regionpose.io.reading import check_regular

MAX_BYTES = 4 * 2**20
"""Largest file read, in bytes; calibrations hold some kilobytes."""

MOST_NAMES = 20
"""Names of cameras that a message lists at most: photogrammetry has one for each photo."""

Builder = Callable[[], Camera]


class CalibrationError(ValueError):
    """A calibration file that cannot be used: names the file, the item, what was found and what is needed."""


@dataclass(frozen=True)
class CalibrationText:
    """The text of a calibration file with its path, the model that the caller gives, and whether the
    camera of the rectified photo is wanted.
    """

    path: Path
    text: str
    model: str | None = None
    rectified: bool = False

    @classmethod
    def read(
        cls, path: str | Path, model: str | None = None, *, rectified: bool = False, what: str = "calibration"
    ) -> CalibrationText:
        """The text at `path`, of a bag that of a CameraInfo; FileNotFoundError when missing.

        CalibrationError when empty, binary or too large; FileError for what is no file, and for other messages.
        `what`: the kind of file that messages ask for.
        """
        if not isinstance(path, str | os.PathLike):
            raise CalibrationError(f"path is a {type(path).__name__}; needed the path of a {what} file")
        place = bag_place(path)
        if place is not None:
            return cls(Path(path), camera_info_text(place), model, rectified)
        location = Path(path)
        check_regular(location)
        if location.is_dir():
            raise CalibrationError(f"{location}: found a directory; needed a {what} file")
        size = location.stat().st_size
        if size > MAX_BYTES:
            raise CalibrationError(f"{location}: found {size} bytes; needed a {what} file of at most {MAX_BYTES}")
        content = location.read_bytes()
        try:
            text = content.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            raise CalibrationError(f"{location}: found a binary file; needed {what} text in UTF-8") from error
        if "\0" in text:
            raise CalibrationError(f"{location}: found a binary file; needed {what} text in UTF-8")
        if not text.strip():
            raise CalibrationError(f"{location}: found an empty file; needed a {what}")
        return cls(location, text, model, rectified)

    @property
    def lines(self) -> list[str]:
        """The lines without their ends."""
        return self.text.splitlines()

    def error(self, item: str, found: object, needed: str, line: int | None = None) -> CalibrationError:
        """The error about `item` on `line` (from 1)."""
        place = "" if line is None else f"line {line}: "
        return CalibrationError(f"{self.path}: {place}{item}: found {found}; needed {needed}")

    def number(self, item: str, word: str, line: int | None) -> float:
        """`word` as a finite number."""
        try:
            value = float(word)
        except ValueError as error:
            raise self.error(item, repr(word), "a number", line) from error
        if not math.isfinite(value):
            raise self.error(item, repr(word), "a finite number", line)
        return value

    def numbers(self, item: str, words: Sequence[str], count: int, line: int | None) -> list[float]:
        """`count` words as finite numbers."""
        if len(words) != count:
            raise self.error(item, f"{len(words)} numbers", f"{count} numbers", line)
        return [self.number(f"{item}[{index}]", word, line) for index, word in enumerate(words)]

    def whole_number(self, item: str, word: str, line: int | None) -> int:
        """`word` as a whole number."""
        value = self.number(item, word, line)
        if not value.is_integer():
            raise self.error(item, repr(word), "a whole number", line)
        return int(value)

    def camera(self, builders: Mapping[str, Builder], name: str | None, default: str | None = None) -> Camera:
        """The camera called `name`, or `default`, or the only one; CalibrationError that lists the names otherwise."""
        chosen = self.choice(list(builders), name, default)
        try:
            return builders[chosen]()
        except CalibrationError:
            raise
        except ValueError as error:
            raise CalibrationError(f"{self.path}: camera {chosen}: {error}") from error

    def choice(self, names: Sequence[str], name: str | None, default: str | None = None) -> str:
        """`name` where it is one of `names`, else `default`, else the only one."""
        listed = ", ".join(names[:MOST_NAMES]) + (", ..." if len(names) > MOST_NAMES else "")
        if name is not None:
            if name not in names:
                raise self.error("camera name", repr(name), f"one of {listed}")
            return name
        if default is not None and default in names:
            return default
        if len(names) != 1:
            raise self.error("camera name", f"none for {len(names)} cameras", f"name= one of {listed}")
        return names[0]
