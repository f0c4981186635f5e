"""How much of long work is done, told to whoever waits."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

Item = TypeVar("Item")

Progress = Callable[[float], object]
"""Told again and again which share of the work is done, from 0 to 1."""


def part(progress: Progress | None, start: float, end: float) -> Progress | None:
    """What to tell the progress of a part of the work, which goes from one share of the whole to another."""
    if progress is None:
        return None
    return lambda share: progress((1.0 - share) * start + share * end)


def told_each(items: Sequence[Item], progress: Progress | None) -> Iterator[tuple[Item, Progress | None]]:
    """Items that take about as long, in turn, each with its part of the progress, which is told when it is done."""
    for index, item in enumerate(items):
        own = part(progress, index / len(items), (index + 1) / len(items))
        yield item, own
        if own is not None:
            own(1.0)
