"""A session's pose, estimated in the background at first and whenever it changes, in stages that can be abandoned."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from regionpose.app.outcome import Outcome
from regionpose.app.session import Session
from regionpose.progress import UnwantedError, while_wanted
from regionpose.scene.estimate import SceneEstimate, uses_edges, with_edges
from regionpose.scene.stages import Stages

DEBOUNCE_S = 0.35
"""Seconds without an edit after which the pose is estimated: a pause, not the time between two clicks."""

STAGES = {
    "matching": "Matching regions",
    "pose": "The regions' pose",
    "edges": "Edges of photo and cloud",
}
"""What the page calls the stages of an estimate by regions."""

EDGE_STAGES = {
    "read files": "Reading files",
    "edges": "Searching all poses by edges",
}
"""The same of one by edges."""


@dataclass
class Running:
    """One estimate: which of its stages, how much of that is done where this is known, since when, and whether
    it is still wanted. `titles`: what stages are called.
    """

    titles: dict[str, str] = field(default_factory=lambda: STAGES)
    stage: str = ""
    fraction: float | None = None
    start: float = field(default_factory=time.monotonic)
    is_wanted: bool = True
    ended: bool = False

    def begin(self, stage: str) -> None:
        """Record the stage."""
        self.stage, self.fraction = stage, None

    def progress(self, fraction: float) -> None:
        """Record the fraction of the stage that is done."""
        self.fraction = fraction

    @property
    def status(self) -> str:
        """The stage, the fraction of it that is done, and the seconds since the start; nothing where it has ended or
        was canceled.
        """
        if self.ended or not self.is_wanted or not self.stage:
            return ""
        frame, colon, stage = self.stage.rpartition(": ")
        fraction = "" if self.fraction is None else f"{100.0 * self.fraction:.0f} %, "
        return f"{frame}{colon}{self.titles.get(stage, stage)} … {fraction}{time.monotonic() - self.start:.0f} s"


class Estimator:
    """The thread that estimates. `snapshot` gives the session to be estimated, whose edits do not reach it; `show` is
    called with the outcome, again once edges were compared after the regions. `lock` is held during that call, and by
    who abandons an estimate: what is shown is of the regions as they are.
    """

    def __init__(
        self, lock: threading.RLock, snapshot: Callable[[], Session], show: Callable[[Outcome], object]
    ) -> None:
        """Wait for the first `begin`."""
        self._lock, self._snapshot, self._show = lock, snapshot, show
        self._wake = threading.Event()
        self._ended = False
        self._by_edges: tuple[dict[str, Any], SceneEstimate] | None = None
        self._running = Running(ended=True)
        self._worker = threading.Thread(target=self._work, daemon=True, name="regionpose-pick-estimate")
        self._worker.start()

    @property
    def stage(self) -> str:
        """What the estimate that runs does, and for how long it has run; nothing where none runs."""
        return self._running.status

    def begin(self) -> None:
        """Estimate the session once no edit has come for a moment; cancel the estimate that runs."""
        self._running.is_wanted = False
        self._wake.set()

    def abandon(self) -> bool:
        """Cancel the estimate that runs; return whether there was one."""
        running = self._running
        found = running.is_wanted and not running.ended
        running.is_wanted = False
        return found

    def close(self) -> None:
        """End the thread."""
        self._ended = True
        self.begin()

    def _work(self) -> None:
        while not self._ended:
            self._wake.wait()
            self._wake.clear()
            while not self._ended and self._wake.wait(DEBOUNCE_S):
                self._wake.clear()
            if not self._ended:
                self._estimate()

    def _estimate(self) -> None:
        with self._lock:
            session = self._snapshot()
            by_edges = session.searches_edges
            running = self._running = Running(EDGE_STAGES if by_edges else STAGES)
            # Of other frames, edits would reach it later.
            values = session.edge_values() if by_edges else {}
        if not session.has_estimate:
            running.ended = True
            return
        try:
            with while_wanted(lambda: running.is_wanted):
                if by_edges:
                    self._of_edges(session, values, running)
                else:
                    self._in_stages(session, running)
        except UnwantedError:
            pass
        except ValueError as error:
            self._publish(running, Outcome("failed", str(error), searches_edges=by_edges))
        except Exception as error:
            # The page would wait for ever for a worker that is gone.
            self._publish(running, Outcome("failed", f"{type(error).__name__}: {error}", searches_edges=by_edges))
        finally:
            running.ended = True

    def _of_edges(self, session: Session, values: dict[str, Any], running: Running) -> None:
        """Publish the pose by edges; that of the same photos, clouds and prior is not searched for again."""
        if self._by_edges is None or self._by_edges[0] != values:
            self._by_edges = (values, session.estimate_edges(values, Stages(running.begin, running.progress)))
        self._publish(running, Outcome.of(self._by_edges[1], []))

    def _in_stages(self, session: Session, running: Running) -> None:
        """Publish the regions' pose as soon as it is there, and then that of the whole scene."""
        stages = Stages(running.begin)
        run = session.estimate_regions(stages)
        keys, goes_on = session.keys_of(run.sides.names), uses_edges(run)
        self._publish(running, Outcome.of(run, keys, "regions" if goes_on else "ready"))
        if goes_on:
            self._publish(running, Outcome.of(with_edges(run, stages), keys))

    def _publish(self, running: Running, outcome: Outcome) -> None:
        with self._lock:
            if running.is_wanted:
                self._show(outcome)
