"""Output of commands: results on standard output, progress on standard error."""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Self, TypeVar

import typer

if TYPE_CHECKING:
    from regionpose.cli.bars import StageLine
    from regionpose.io.clouds import Cloud
    from regionpose.scene.stages import Stages

Item = TypeVar("Item")

BAD_INPUT, NO_POSE = 2, 3
"""Exit codes of errors."""

SHOWN_AFTER_S = 1.0
"""Seconds that work takes before its progress is shown."""


def at_terminal() -> bool:
    """Whether standard error is a terminal that can draw over a line."""
    return sys.stderr.isatty() and os.environ.get("TERM", "").lower() not in {"dumb", "unknown"}


class Progress:
    """The stages of long work, at a terminal: bars with rates, or a spinner; nothing elsewhere and when quiet."""

    def __init__(self, quiet: bool) -> None:
        """Show nothing yet."""
        self._quiet = quiet
        self._line: StageLine | None = None
        self._size_bytes = 0

    def __enter__(self) -> Self:
        """Start the line where there is a terminal."""
        if not self._quiet and at_terminal():
            from regionpose.cli.bars import StageLine

            self._line = StageLine(SHOWN_AFTER_S, time.monotonic)
            self._line.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Take the line away."""
        if self._line is not None:
            self._line.stop()

    @contextmanager
    def aside(self) -> Iterator[None]:
        """Take the line away for a block that prints, and show it again."""
        if self._line is not None:
            self._line.stop()
        yield
        sys.stdout.flush()
        if self._line is not None:
            self._line.start()

    def begin(self, stage: str) -> None:
        """Begin a stage."""
        self._size_bytes = 0
        if self._line is not None:
            self._line.begin(stage)

    def of_bytes(self, size_bytes: int) -> None:
        """Show the fractions of the stage as bytes of so many; as percent where these are none."""
        self._size_bytes = size_bytes

    @property
    def stages(self) -> Stages:
        """The stages of a scene's run, shown as they come."""
        from regionpose.scene.stages import Stages

        return Stages(self.begin, self.fraction, self.of_bytes)

    def fraction(self, fraction: float) -> None:
        """Show the fraction of the stage that is done, from 0 to 1."""
        if self._line is None:
            return
        from regionpose.cli.bars import BYTES, PERCENT

        total = self._size_bytes or 1.0
        self._line.set_amount(BYTES if self._size_bytes else PERCENT, fraction * total, total)

    def count(self, done: int, total: int) -> None:
        """Show how many items of the stage are done."""
        if self._line is None:
            return
        from regionpose.cli.bars import ITEMS

        self._line.set_amount(ITEMS, done, total)

    def each(self, items: Sequence[Item], stage: str) -> Iterator[Item]:
        """The items in turn, as a stage that counts them."""
        self.begin(stage)
        for index, item in enumerate(items):
            self.count(index, len(items))
            yield item
        self.count(len(items), len(items))

    def read_cloud(self, path: Path, columns: Sequence[str] | None = None) -> Cloud:
        """The cloud of a file, as a stage that shows how much is read; `columns` as of `clouds.read_cloud`."""
        from regionpose.io.clouds import read_cloud
        from regionpose.io.clouds.kinds import file_size

        self.begin("read cloud")
        self.of_bytes(file_size(path))
        return read_cloud(path, columns=columns, progress=self.fraction)


def print_remarks(remarks: Sequence[str], quiet: bool) -> None:
    """Print remarks about files to standard error; if `quiet`, only warnings."""
    for remark in remarks:
        if not quiet or remark.startswith("warning:"):
            typer.echo(remark, err=True)


def error_code(error: BaseException) -> int:
    """The exit code of an error."""
    from regionpose.solve.estimate import PoseError

    return NO_POSE if isinstance(error, PoseError) else BAD_INPUT


def one_line(error: BaseException) -> str:
    """The message of an error, in one line."""
    if isinstance(error, OSError) and error.strerror and error.filename is not None:
        return f"{error.filename}: {error.strerror.lower()}"
    return " ".join(str(error).split()) or type(error).__name__


def print_json(values: object) -> None:
    """Print values as JSON."""
    typer.echo(json.dumps(values, indent=2, allow_nan=False))


def print_rows(rows: list[tuple[str, str]], indent: str = "  ") -> None:
    """Print names and values in two columns."""
    width = max((len(name) for name, _ in rows), default=0)
    for name, value in rows:
        typer.echo(f"{indent}{name:<{width}}  {value}")
