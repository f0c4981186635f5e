"""What commands say: results on standard output, progress on standard error."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator, Sequence
from types import TracebackType
from typing import Any, Self, TypeVar

import typer

Item = TypeVar("Item")


class Progress:
    """The stages of long work on standard error: a spinner at a terminal, a line each elsewhere, nothing when quiet."""

    def __init__(self, quiet: bool) -> None:
        """Say nothing yet."""
        self._quiet = quiet
        self._status: Any = None

    def __enter__(self) -> Self:
        """Start the spinner where there is a terminal."""
        if not self._quiet and sys.stderr.isatty():
            from rich.console import Console

            self._status = Console(stderr=True).status("starting")
            self._status.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Take the spinner away."""
        if self._status is not None:
            self._status.stop()

    def begin(self, stage: str) -> None:
        """Say that a stage begins."""
        if self._status is not None:
            self._status.update(stage)
        elif not self._quiet:
            typer.echo(f"{stage} ...", err=True)

    def each(self, items: Sequence[Item], stage: str) -> Iterator[Item]:
        """The items in turn; says which one is worked on and, after the first, how long the rest will take."""
        start = time.perf_counter()
        for index, item in enumerate(items):
            left = (time.perf_counter() - start) / max(index, 1) * (len(items) - index)
            self.begin(f"{stage} {index + 1} of {len(items)}" + (f", about {left:.0f} s left" if index else ""))
            yield item


def say_json(values: object) -> None:
    """Print values as JSON."""
    typer.echo(json.dumps(values, indent=2, allow_nan=False))


def say_rows(rows: list[tuple[str, str]], indent: str = "  ") -> None:
    """Print names and values in two columns."""
    width = max((len(name) for name, _ in rows), default=0)
    for name, value in rows:
        typer.echo(f"{indent}{name:<{width}}  {value}")
