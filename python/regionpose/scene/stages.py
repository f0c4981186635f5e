"""The stages of a run: told as they begin, and timed."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from regionpose.progress import Progress


@dataclass
class Stages:
    """The seconds that each stage of a run took.

    `begin` is told its name when it begins, and of what it is; `of_bytes` then the bytes of what it reads, where it
    reads a cloud; `progress` which share of it is done, where that is known.
    """

    begin: Callable[[str], object] = lambda name: None
    progress: Progress = lambda share: None
    of_bytes: Callable[[int], object] = lambda size_bytes: None
    seconds: dict[str, float] = field(default_factory=dict)
    _whose: str = ""

    @contextmanager
    def within(self, whose: str) -> Iterator[None]:
        """Say before the name of each stage in the block whose it is, such as a camera's, and of it a frame's."""
        before = self._whose
        self._whose += f"{whose}: " if whose else ""
        try:
            yield
        finally:
            self._whose = before

    def tell(self, name: str) -> None:
        """Say that a part of the stage begins, which is not timed by itself."""
        self.begin(self._whose + name)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Time a block as the stage `name`."""
        self.begin(self._whose + name)
        start = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start
