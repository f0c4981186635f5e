"""Waiting for what a session does in the background."""

from __future__ import annotations

import time
from collections.abc import Callable

WAIT_S = 120.0


def holds(condition: Callable[[], bool], seconds: float = WAIT_S) -> bool:
    """Whether a condition comes to hold in time."""
    until = time.monotonic() + seconds
    while not condition() and time.monotonic() < until:
        time.sleep(0.01)
    return condition()
