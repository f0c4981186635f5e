"""Signals that wait while files are put in place."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

HELD = (signal.SIGINT, signal.SIGTERM)
"""Those that ask a run to end."""

Deliver = Callable[[], None]


@contextmanager
def deferred_signals() -> Iterator[Deliver]:
    """Signals that come in the block are handled at its end, or when it calls what it is given.

    Only those that have a handler in Python, and in the main thread, as no other one handles any.
    """
    came: list[tuple[int, FrameType | None]] = []
    before = {number: signal.getsignal(number) for number in HELD} if _in_main_thread() else {}

    def deliver() -> None:
        while came:
            number, frame = came.pop(0)
            handler = before[signal.Signals(number)]
            if callable(handler):
                handler(number, frame)

    try:
        for number, handler in before.items():
            if callable(handler):
                signal.signal(number, lambda number, frame: came.append((number, frame)))
        yield deliver
    finally:
        for number, handler in before.items():
            if callable(handler):
                signal.signal(number, handler)
        deliver()


def _in_main_thread() -> bool:
    return threading.current_thread() is threading.main_thread()
