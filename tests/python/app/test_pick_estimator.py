"""The estimate that runs beside the picking page: in stages, stopped, abandoned."""

from __future__ import annotations

import io
import threading
import time
from collections.abc import Iterator
from copy import copy
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from pick_sessions import WAIT_S, holds
from PIL import Image
from regionpose.app import estimator
from regionpose.app.outcome import Outcome
from regionpose.app.session import Session
from regionpose.app.shared_session import SharedSession
from regionpose.app.texts import outcome_html
from regionpose.fusion.colors import seen_points
from regionpose.progress import UnwantedError, check_wanted, while_wanted
from regionpose.scene.estimate import with_edges
from regionpose.scene.stages import Stages

from benchmarks._demo_clicks import BOARD, CHALKBOARD, DOOR, click_sign, demo_session

pytestmark = pytest.mark.slow

"""Seconds that a busy machine may take for what takes one."""

SOON_S = 5.0
"""Seconds after which work that nobody waits for has ended: many times what one look at a scene takes."""


@pytest.fixture(scope="module")
def pairs(tmp_path_factory: pytest.TempPathFactory) -> Session:
    """A session with two pairs whose scanner stands at zero."""
    held = demo_session(tmp_path_factory.mktemp("pairs") / "scene.yaml")
    for pixel, place in (DOOR, BOARD):
        held.click_photo(pixel)
        click_sign(held, place)
    return held


@pytest.fixture
def session(pairs: Session) -> Session:
    """One of its own, to edit."""
    return copy(pairs)


def reaches_state(shared: SharedSession, state: str) -> bool:
    return holds(lambda: shared.outcome.state == state)


def test_the_regions_pose_comes_first_and_then_that_of_the_whole_scene(
    session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown: list[Outcome] = []
    stages: list[str] = []
    show = SharedSession._show

    def noted(shared: SharedSession, outcome: Outcome) -> None:
        shown.append(outcome)
        stages.append(shared.stage)
        show(shared, outcome)

    monkeypatch.setattr(SharedSession, "_show", noted)
    shared = SharedSession(session)
    try:
        assert reaches_state(shared, "ready"), shared.outcome
    finally:
        shared.close()
    first, last = shown
    assert (first.state, last.state) == ("regions", "ready")
    assert all(stages) and stages[0] != stages[1] and shared.stage == ""
    assert first.run is not None and first.run.estimate.diagnostics.edges is None
    assert last.run is not None and last.run.estimate.diagnostics.edges is not None
    assert "rp-trusted" not in outcome_html(first) and "rp-trusted" in outcome_html(last)
    np.testing.assert_array_equal(with_edges(first.run).estimate.pose.matrix, last.run.estimate.pose.matrix)


def test_the_cloud_is_drawn_over_the_photo_at_the_current_pose(session: Session, ends: list[str]) -> None:
    """Where it is wanted, and anew at each pose: of the pose that was shown, nothing stays."""
    shared = SharedSession(session)
    try:
        assert reaches_state(shared, "regions")
        assert shared.depth_files == [] and "depth.jpg" not in shared.files
        shared.show_depth(True)
        first, run = shared.files["depth.jpg"], shared.outcome.run
        assert run is not None and shared.depth_files[0].startswith("files/depth.jpg")
        shown = np.asarray(Image.open(io.BytesIO(first.content)).convert("RGB"), dtype=np.float64)
        pixels, depths, _ = seen_points(run.camera, shared.cloud.local_points, run.local_pose, shown.shape[:2])
        seen = np.flatnonzero(np.isfinite(depths) & (depths > 0.0))[::50]
        drawn = shown[tuple(np.round(pixels[seen][:, ::-1]).astype(int).T)]
        assert np.ptp(drawn, axis=1).mean() > 40.0, "the dots are colored, the photo below them is gray"
        before = shared.depth_files
        moved = replace(run, estimate=replace(run.estimate, pose=run.estimate.pose.retract(np.full(6, 0.05))))
        shared._show(replace(shared.outcome, run=moved))
        assert shared.depth_files != before and shared.files["depth.jpg"].content != first.content
        shared.show_depth(False)
        assert shared.depth_files == []
    finally:
        shared.close()


@pytest.fixture
def ends(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[str]]:
    """How the rest of the scene ended to be asked, which takes for ever."""
    held: list[str] = []

    def forever(run: object, stages: Stages) -> None:
        stages.begin("edges")
        try:
            while True:
                check_wanted()
                time.sleep(0.01)
        except UnwantedError:
            held.append("abandoned")
            raise

    monkeypatch.setattr(estimator, "with_edges", forever)
    yield held


def test_what_runs_can_be_stopped_and_the_regions_pose_stays(session: Session, ends: list[str]) -> None:
    shared = SharedSession(session)
    try:
        assert reaches_state(shared, "regions")
        run = shared.outcome.run
        shared.stop()
        assert shared.outcome.state == "stopped" and shared.outcome.run is run and shared.stage == ""
        assert holds(lambda: ends == ["abandoned"], SOON_S)
        assert "rp-trusted" not in outcome_html(shared.outcome)
        shared.estimate_again()
        assert reaches_state(shared, "regions")
    finally:
        shared.close()


def test_an_edit_of_a_pair_abandons_what_runs(session: Session, ends: list[str]) -> None:
    shared = SharedSession(session)
    try:
        assert reaches_state(shared, "regions")
        shared.edit(lambda held: held.select(None))
        shared.edit(partial(Session.click_photo, pixel=CHALKBOARD[0]))
        assert ends == [] and shared.outcome.state == "regions", "a side alone changes no pose"
        shared.edit(partial(Session.click_cloud, place=CHALKBOARD[1]))
        assert shared.outcome.state == "busy"
        assert holds(lambda: ends == ["abandoned"], SOON_S)
        assert reaches_state(shared, "regions")
        run = shared.outcome.run
        assert run is not None and len(run.names) == 3
    finally:
        shared.close()


def test_the_rest_of_a_scene_ends_soon_after_nobody_waits(session: Session) -> None:
    run = session.estimate_regions()
    is_wanted, began, ended = threading.Event(), threading.Event(), threading.Event()
    is_wanted.set()

    def work() -> None:
        with while_wanted(is_wanted.is_set), pytest.raises(UnwantedError):
            with_edges(run, Stages(lambda _: began.set()))
        ended.set()

    threading.Thread(target=work, daemon=True).start()
    assert began.wait(WAIT_S)
    time.sleep(0.5)
    assert not ended.is_set()
    is_wanted.clear()
    assert ended.wait(SOON_S)
