"""The line at a terminal that shows a stage of long work, by rich; `console` imports it where there is a terminal."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from datetime import timedelta

from rich.console import Console, RenderableType
from rich.progress import (
    BarColumn,
    DownloadColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    SpinnerColumn,
    Task,
    TaskProgressColumn,
    TextColumn,
    TimeRemainingColumn,
    TransferSpeedColumn,
)
from rich.text import Text

BAR_WIDTH = 20
"""Characters; with all else, a line of bytes fits into 80."""

BESIDE_NAME, LEAST_NAME = 46, 16
"""Characters of a line of fractions beside its name; those that a name has on the narrowest terminal."""

DRAWN_EVERY_S = 0.05
"""Sooner updates are dropped: readers report thousands a second."""


class Elapsed(ProgressColumn):
    """The time since a stage began, which goes on when all of its amount is done."""

    def render(self, task: Task) -> Text:
        """As 0:00:05."""
        return Text(str(timedelta(seconds=int(task.elapsed or 0.0))), style="progress.elapsed")


class Turning(SpinnerColumn):
    """A spinner that goes on when all of the amount that was known is done."""

    def render(self, task: Task) -> RenderableType:
        """Its picture for this moment."""
        return self.spinner.render(task.get_time())


class Rate(ProgressColumn):
    """Items a second, or seconds an item where these are more."""

    def render(self, task: Task) -> Text:
        """As 2.5/s or 4.0 s each; nothing before it is known."""
        speed = task.speed or 0.0
        rate = "" if not speed else f"{speed:.1f}/s" if speed >= 1.0 else f"{1.0 / speed:.1f} s each"
        return Text(rate, style="progress.data.speed")


NAME, BAR = TextColumn("{task.description}", markup=False), BarColumn(BAR_WIDTH)
TIMES = (Elapsed(), TimeRemainingColumn(), TextColumn("left"))
UNKNOWN = (Turning(), NAME, Elapsed())
PERCENT = (NAME, BAR, TaskProgressColumn(), *TIMES)
BYTES = (NAME, BAR, DownloadColumn(), TransferSpeedColumn(), *TIMES)
ITEMS = (NAME, BAR, MofNCompleteColumn(), Rate(), *TIMES)


def shortened(name: str, room: int) -> str:
    """The name, without its middle where it has no room: it begins with a frame and ends with a stage."""
    kept = (room - 1) // 2
    return name if len(name) <= room else f"{name[: room - 1 - kept]}…{name[-kept:]}"


class StageLine(Progress):
    """One line on standard error for the stage at hand, once the work has taken `after_s`; it is gone when it stops."""

    def __init__(self, after_s: float, clock: Callable[[], float]) -> None:
        """Show nothing yet; `clock` gives seconds."""
        self._clock, self._shown_from, self._drawn_at = clock, clock() + after_s, -math.inf
        self._kind: tuple[ProgressColumn, ...] = UNKNOWN
        # Items may take minutes: the rate is that of all of them.
        super().__init__(
            console=Console(stderr=True),
            transient=True,
            redirect_stdout=False,
            get_time=clock,
            speed_estimate_period=math.inf,
        )

    def get_renderables(self) -> Iterable[RenderableType]:
        """The line; an empty one before its time, since older versions of rich leave a gap where there is none."""
        if self._clock() < self._shown_from or not self.tasks:
            yield Text()
            return
        # What follows the last fraction, such as making arrays of what was read, is of unknown amount again.
        self.columns = UNKNOWN if self.finished else self._kind
        yield self.make_tasks_table(self.tasks)

    def begin(self, stage: str) -> None:
        """Show another stage, of an amount that isn't known yet."""
        with self._lock:
            for task in self.task_ids:
                self.remove_task(task)
            self._kind, self._drawn_at = UNKNOWN, -math.inf
        # It draws, which must not be within the lock: the thread that draws by itself takes that after the drawing's.
        self.add_task(shortened(stage, max(LEAST_NAME, self.console.width - BESIDE_NAME)), total=None)

    def set_amount(self, kind: tuple[ProgressColumn, ...], done: float, total: float) -> None:
        """Show how much of the stage is done."""
        now = self._clock()
        if (now < self._drawn_at + DRAWN_EVERY_S and done < total) or not self.tasks:
            return
        with self._lock:
            self._drawn_at, self._kind = now, kind
            self.update(self.task_ids[-1], completed=done, total=total)
            if not done:
                # The rate counts from the first sample, which rich takes of what is more than nothing.
                self.advance(self.task_ids[-1], 0)
        # At once: the thread that draws by itself may wait long for a reader that is busy. Not within the lock, either.
        self.refresh()
