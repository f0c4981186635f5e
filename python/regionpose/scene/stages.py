"""The stages of a run: reported as they begin, and timed."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from regionpose.progress import Progress


@dataclass
class Stages:
    """The seconds that each stage of a run took.

    `begin` is called with its name when it begins, and the frame's; `of_bytes` then with the bytes of what it reads,
    where it reads a cloud; `progress` with the fraction of it that is done, where that is known.
    """

    begin: Callable[[str], object] = lambda name: None
    progress: Progress = lambda fraction: None
    of_bytes: Callable[[int], object] = lambda size_bytes: None
    seconds: dict[str, float] = field(default_factory=dict)
    _whose: str = ""

    @contextmanager
    def within(self, whose: str) -> Iterator[None]:
        """Prefix the name of each stage in the block by its owner, such as a camera, and of it a frame."""
        before = self._whose
        self._whose += f"{whose}: " if whose else ""
        try:
            yield
        finally:
            self._whose = before

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Time a block as the stage `name`."""
        self.begin(self._whose + name)
        start = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start
