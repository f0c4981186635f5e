"""Progress callbacks and cancellation of long work."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeVar

Item = TypeVar("Item")

Progress = Callable[[float], object]
"""Called repeatedly with the fraction of the work that is done, from 0 to 1."""


_is_wanted: ContextVar[Callable[[], bool] | None] = ContextVar("is_wanted", default=None)


class UnwantedError(Exception):
    """Raised in long work that its caller canceled. No ValueError: its input is not at fault."""


@contextmanager
def while_wanted(is_wanted: Callable[[], bool]) -> Iterator[None]:
    """In the block, in this thread, long work raises an UnwantedError soon after `is_wanted` returns False."""
    token = _is_wanted.set(is_wanted)
    try:
        yield
    finally:
        _is_wanted.reset(token)


def check_wanted() -> None:
    """Raise an UnwantedError where the caller has canceled the work."""
    is_wanted = _is_wanted.get()
    if is_wanted is not None and not is_wanted():
        raise UnwantedError("the caller canceled this work")


def part(progress: Progress | None, start: float, end: float) -> Progress | None:
    """The progress callback of a part of the work that goes from the fraction `start` to `end` of the whole."""
    if progress is None:
        return None
    return lambda fraction: progress((1.0 - fraction) * start + fraction * end)


def with_progress(items: Sequence[Item], progress: Progress | None) -> Iterator[tuple[Item, Progress | None]]:
    """Yield items of about equal cost, each with its own progress callback, and report each one's end."""
    for index, item in enumerate(items):
        own = part(progress, index / len(items), (index + 1) / len(items))
        yield item, own
        if own is not None:
            own(1.0)
