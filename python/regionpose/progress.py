"""How much of long work is done, told to whoever waits, and whether anybody still does."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeVar

Item = TypeVar("Item")

Progress = Callable[[float], object]
"""Told again and again which share of the work is done, from 0 to 1."""


_is_wanted: ContextVar[Callable[[], bool] | None] = ContextVar("is_wanted", default=None)


class UnwantedError(Exception):
    """Long work that nobody waits for any more. No ValueError: nothing is wrong with what it was given."""


@contextmanager
def while_wanted(is_wanted: Callable[[], bool]) -> Iterator[None]:
    """Long work of the block, in this thread, ends with an UnwantedError soon after `is_wanted` is False."""
    token = _is_wanted.set(is_wanted)
    try:
        yield
    finally:
        _is_wanted.reset(token)


def check_wanted() -> None:
    """Pass where somebody waits for the work that this is called from; UnwantedError otherwise."""
    is_wanted = _is_wanted.get()
    if is_wanted is not None and not is_wanted():
        raise UnwantedError("nobody waits for this any more")


def part(progress: Progress | None, start: float, end: float) -> Progress | None:
    """What to tell the progress of a part of the work, which goes from one share of the whole to another."""
    if progress is None:
        return None
    return lambda share: progress((1.0 - share) * start + share * end)


def with_progress(items: Sequence[Item], progress: Progress | None) -> Iterator[tuple[Item, Progress | None]]:
    """Items that take about as long, in turn, each with its part of the progress, which is told when it is done."""
    for index, item in enumerate(items):
        own = part(progress, index / len(items), (index + 1) / len(items))
        yield item, own
        if own is not None:
            own(1.0)
