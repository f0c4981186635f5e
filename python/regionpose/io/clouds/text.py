"""Clouds as plain text: a point a line, numbers separated by white space, commas or semicolons."""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from regionpose.io.clouds.cloud import Cloud
from regionpose.io.clouds.columns import COORDINATES, cloud_of_table
from regionpose.io.clouds.errors import cloud_error
from regionpose.io.clouds.pieces import ProgressFile
from regionpose.io.reading import BOM, whole_number
from regionpose.progress import Progress

COMMENTS = ("#", "//", "%")

_COMMENT = re.compile("|".join(map(re.escape, COMMENTS)))

PREAMBLE_LINES = 100
"""Lines within which the first point must come."""


@dataclass(frozen=True)
class TextLayout:
    """Where the points of a text file begin and how its lines are written."""

    lines_before: int
    delimiter: str | None
    names: list[str] | None
    stated_count: int | None


def read_text(path: Path, columns: Sequence[str] | None, *, progress: Progress | None = None) -> Cloud:
    """The cloud of a text file, by `columns`, else by a heading that names x, y and z, else by guess."""
    with path.open("rb") as file:
        offset = len(BOM) if file.read(len(BOM)) == BOM else 0
    layout = _layout(path, offset)
    table = rows_of_text(path, offset, np.float64, layout.delimiter, layout.lines_before, progress=progress)
    if layout.stated_count not in (None, len(table)):
        raise cloud_error(path, "rows", len(table), f"{layout.stated_count}, as the first line states")
    return cloud_of_table(path, table, columns if columns is not None else layout.names)


def rows_of_text(
    path: Path,
    offset: int,
    kind: DTypeLike,
    delimiter: str | None = None,
    skip: int = 0,
    *,
    progress: Progress | None = None,
) -> NDArray[Any]:
    """The rows of numbers from byte `offset` on: (n, k), or (n,) of a structured type; CloudError for anything else."""
    structured = np.dtype(kind).names is not None
    if not _has_rows(path, offset, skip):
        # numpy warns of it; it is an error of the caller's own.
        return np.empty(0 if structured else (0, 1), dtype=kind)
    with io.BufferedReader(ProgressFile(path, offset, progress)) as file:
        text = io.TextIOWrapper(file, encoding="latin-1")
        try:
            return np.loadtxt(
                text, kind, delimiter=delimiter, comments=COMMENTS, skiprows=skip, ndmin=1 if structured else 2
            )
        except ValueError as error:
            parse_error = ("rows", repr(str(error).partition(";")[0]))
            item, found = _odd_line(path, offset, delimiter, skip) or parse_error
            raise cloud_error(path, item, found, "the same count of numbers on every line") from error


def _has_rows(path: Path, offset: int, skip: int) -> bool:
    """Whether there is more than blank lines and comments from byte `offset` on, so many lines left out."""
    with path.open("rb") as file:
        file.seek(offset)
        return any(_COMMENT.split(line.decode("latin-1"), maxsplit=1)[0].strip() for line in islice(file, skip, None))


def _odd_line(path: Path, offset: int, delimiter: str | None, skip: int) -> tuple[str, str] | None:
    """The first line of points, from byte `offset` on, that is no row of as many numbers as the one before: which it
    is in the file, and what it holds. None where there is none.
    """
    with path.open("rb") as file:
        before, count = file.read(offset).count(b"\n"), None
        for number, line in enumerate(file, start=before + 1):
            words = _COMMENT.split(line.decode("latin-1"), maxsplit=1)[0].strip().split(delimiter)
            if number <= before + skip or words in ([], [""]):
                continue
            odd = next((word for word in words if not _is_number(word)), None)
            if odd is not None or len(words) != (count or len(words)):
                wrong = f"{len(words)} numbers after rows of {count}" if odd is None else repr(odd)
                return f"line {number}", wrong if odd != "" else "an empty column"
            count = len(words)
    return None


def _layout(path: Path, offset: int) -> TextLayout:
    """The layout by the lines from byte `offset` up to the first point."""
    names, stated = None, None
    with path.open(encoding="latin-1") as file:
        file.seek(offset)
        for number, line in enumerate(islice(file, PREAMBLE_LINES)):
            bare = line.strip()
            delimiter = next((mark for mark in (",", ";") if mark in bare), None)
            words = bare.split(delimiter)
            if len(words) >= len(COORDINATES) and all(_is_number(word) for word in words):
                return TextLayout(number, delimiter, _matching(names, len(words)), stated)
            if len(words) == 1 and stated is None and (count := whole_number(words[0])) is not None:
                stated = count
            elif bare and (heading := _heading(bare)):
                names = heading
            elif bare and not bare.startswith(COMMENTS):
                raise cloud_error(path, f"line {number + 1}", repr(bare), "3 or more numbers, a heading or a comment")
    raise cloud_error(path, "points", "no line of numbers", f"one within the first {PREAMBLE_LINES} lines")


def _heading(line: str) -> list[str] | None:
    """The names of a line that names x, y and z, without repetition; None for any other line."""
    names = re.findall(r"[^\s,;\"]+", line.lstrip("#/% "))
    lower = [name.lower() for name in names]
    return names if set(COORDINATES) <= set(lower) and len(set(lower)) == len(lower) else None


def _matching(names: list[str] | None, count: int) -> list[str] | None:
    """`names` where there is one a column, else None."""
    return names if names is not None and len(names) == count else None


def _is_number(word: str) -> bool:
    """Whether `word` is a number, NaN and infinities among them."""
    try:
        float(word)
    except ValueError:
        return False
    return "_" not in word
