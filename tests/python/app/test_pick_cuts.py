"""Regions of the cloud that are cut out and drawn around in a picture of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from regionpose.app.session import Session
from regionpose.app.shared_session import SharedSession
from regionpose.io.clouds import Cloud
from regionpose.scene.region_sides import Scan

from benchmarks._demo_clicks import BOARD, CHALKBOARD, click_sign, demo_session

pytestmark = pytest.mark.slow

SQUARE = [[100.0, 100.0], [160.0, 100.0], [160.0, 150.0], [100.0, 150.0]]


@pytest.fixture
def session(tmp_path: Path) -> Session:
    """A session whose scanner stands at zero."""
    return demo_session(tmp_path / "scene.yaml")


def all_of(session: Session) -> NDArray[np.int64]:
    """The points of a picture that shows them all."""
    return np.arange(len(session.cloud), dtype=np.int64)


def inside_of(session: Session, margin: float) -> Callable[[NDArray[np.float64]], NDArray[np.bool_]]:
    """Says which points lie within a distance, meters, of where the board was clicked."""
    return lambda points: np.linalg.norm(points + session.cloud.origin - BOARD[1], axis=1) < margin


def test_what_is_cut_out_of_a_plane_is_saved_and_read_again(session: Session, tmp_path: Path) -> None:
    session.click_photo(BOARD[0])
    click_sign(session, BOARD[1])
    session.choose(0, "world", 1)
    whole = session.regions[0].world
    assert whole is not None and whole.chosen.side.indices is not None
    session.cut_cloud(inside_of(session, 0.5), all_of(session))
    cut = session.regions[0].world
    assert cut is not None and cut.chosen.side.indices is not None
    assert len(cut.chosen.side.indices) < len(whole.chosen.side.indices)
    assert inside_of(session, 0.5)(session.cloud.local_points[cut.chosen.side.indices]).all()
    written = session.save()
    assert [path.suffix for path in written] == [".png", ".npy", ".yaml"]
    read = Session.open(tmp_path / "scene.yaml").regions[0].world
    assert read is not None
    np.testing.assert_array_equal(read.chosen.side.indices, cut.chosen.side.indices)
    session.set_scanner([0.5, 0.0, 0.0])
    session.save()
    assert not session.is_changed
    session.undo()
    session.undo()
    assert session.regions[0].world is whole


def test_a_cut_that_leaves_nothing_changes_nothing(session: Session) -> None:
    session.click_photo(BOARD[0])
    click_sign(session, BOARD[1])
    before = session.sketch
    with pytest.raises(ValueError, match="found 0 points inside; needed at least 3"):
        session.cut_cloud(inside_of(session, 0.0), all_of(session))
    assert session.sketch is before


def test_an_outline_in_the_range_image_cuts_the_selected_region(session: Session) -> None:
    shared = SharedSession(session)
    try:
        session.click_cloud(CHALKBOARD[1])
        world = session.regions[0].world
        assert world is not None
        indices = world.chosen.side.indices
        assert indices is not None
        pixels = shared.range_view.pixels(session.cloud.local_points[indices])
        low, high = pixels.min(axis=0) - 1.0, pixels.max(axis=0) + 1.0
        middle = float(np.median(pixels[:, 0]))
        ring = [[low[0], low[1]], [middle, low[1]], [middle, high[1]], [low[0], high[1]]]
        shared.edit(shared.cut_in_range(ring))
        cut = session.regions[0].world
        assert cut is not None and cut.chosen.side.indices is not None
        kept = shared.range_view.pixels(session.cloud.local_points[cut.chosen.side.indices])
        assert (kept[:, 0] < middle).all()
        held = np.isin(indices[pixels[:, 0] < middle], cut.chosen.side.indices)
        assert held.mean() > 0.95
        with pytest.raises(ValueError, match="found 2 corners around no area"):
            shared.edit(shared.cut_in_range(ring[:2]))
        shared.edit(lambda held: held.select(None))
        shared.edit(shared.cut_in_range(ring))
        drawn = session.regions[1].world
        assert drawn is not None
        # The plane that most of the points inside lie on is the one that was clicked.
        np.testing.assert_array_equal(drawn.chosen.side.indices, cut.chosen.side.indices)
    finally:
        shared.close()


def test_an_outline_that_crosses_itself_holds_all_that_it_goes_around(session: Session) -> None:
    shared = SharedSession(session)
    try:
        session.click_cloud(CHALKBOARD[1])
        world = session.regions[0].world
        assert world is not None and world.chosen.side.indices is not None
        pixels = shared.range_view.pixels(session.cloud.local_points[world.chosen.side.indices])
        low, high = pixels.min(axis=0) - 1.0, pixels.max(axis=0) + 1.0
        middle = 0.5 * (low + high)
        # Two triangles that meet in the middle.
        shared.edit(shared.cut_in_range([[low[0], low[1]], [high[0], high[1]], [high[0], low[1]], [low[0], high[1]]]))
        cut = session.regions[0].world
        assert cut is not None and cut.chosen.side.indices is not None
        kept = shared.range_view.pixels(session.cloud.local_points[cut.chosen.side.indices])
        assert (kept[:, 0] < middle[0]).any() and (kept[:, 0] > middle[0]).any()
        assert not ((np.abs(kept[:, 0] - middle[0]) < 2.0) & (np.abs(kept[:, 1] - low[1]) < 2.0)).any()
    finally:
        shared.close()


def test_what_is_drawn_around_holds_the_points_that_growing_did_not_reach(session: Session) -> None:
    session.click_cloud(CHALKBOARD[1])
    world = session.regions[0].world
    assert world is not None and world.chosen.side.indices is not None
    whole = session.cloud.local_points[world.chosen.side.indices]
    low, high = whole.min(axis=0), whole.max(axis=0)
    middle = 0.5 * (low + high)
    session.cut_cloud(
        lambda points: ((points > low - 0.01) & (points < [high[0], middle[1], high[2]])).all(axis=1), all_of(session)
    )
    half = session.regions[0].world
    assert half is not None and half.chosen.side.indices is not None
    session.cut_cloud(lambda points: ((points > low - 0.01) & (points < high + 0.01)).all(axis=1), all_of(session))
    again = session.regions[0].world
    assert again is not None and again.chosen.side.indices is not None
    assert len(again.chosen.side.indices) > 1.5 * len(half.chosen.side.indices)


def test_what_lies_behind_the_points_that_are_shown_has_no_part_in_their_plane(session: Session) -> None:
    # A board and, seen through it, a wall of twice as many points.
    grid = np.stack(np.meshgrid(np.linspace(-0.5, 0.5, 40), np.linspace(-0.5, 0.5, 40)), axis=-1).reshape(-1, 2)
    board = np.column_stack([np.full(len(grid), 4.0), grid])
    wall = np.concatenate([np.column_stack([np.full(len(grid), 4.1), (grid + shift) * 1.02]) for shift in (0.0, 0.01)])
    cloud = Cloud(np.concatenate([board, wall]))
    there = replace(session, cloud=cloud, sketch=replace(session.sketch, scan=Scan(cloud, np.zeros(3), np.zeros(3))))
    there.cut_cloud(lambda points: np.asarray((np.abs(points[:, 1:]) < 0.6).all(axis=1)), np.arange(len(board)))
    world = there.regions[0].world
    assert world is not None
    np.testing.assert_array_equal(world.chosen.side.indices, np.arange(len(board)))


def test_points_that_are_drawn_around_need_no_click(session: Session) -> None:
    session.click_photo(CHALKBOARD[0])
    session.cut_cloud(near_chalkboard(session, 0.45), all_of(session))
    assert [picked.is_paired for picked in session.regions] == [True]
    session.cut_cloud(near_chalkboard(session, 0.3), all_of(session))
    (paired,) = session.regions
    assert paired.world is not None and paired.world.chosen.side.indices is not None
    drawn = paired.world.chosen.side.indices
    assert near_chalkboard(session, 0.3)(session.cloud.local_points[drawn]).all()
    session.select(None)
    session.click_cloud(CHALKBOARD[1])
    session.cut_cloud(near_chalkboard(session, 0.3), all_of(session))
    clicked = session.regions[1].world
    assert clicked is not None
    np.testing.assert_array_equal(clicked.chosen.side.indices, drawn)


def near_chalkboard(session: Session, reach: float) -> Callable[[NDArray[np.float64]], NDArray[np.bool_]]:
    """Says which points lie within a distance, meters, of where the chalkboard was clicked."""
    return lambda points: np.linalg.norm(points + session.cloud.origin - CHALKBOARD[1], axis=1) < reach


def test_what_is_drawn_around_does_not_depend_on_how_far_the_plane_grew(session: Session) -> None:
    cuts = []
    for margin in (0.3, 5.0):
        session.select(None)
        session.click_cloud(CHALKBOARD[1])
        for reach in (margin, 0.45):
            session.cut_cloud(near_chalkboard(session, reach), all_of(session))
        world = session.regions[-1].world
        assert world is not None and world.chosen.side.indices is not None
        cuts.append(world.chosen.side.indices.tolist())
    assert cuts[0] == cuts[1]


def test_edges_are_hidden_as_they_are_drawn(session: Session) -> None:
    session.draw_polygon(SQUARE, hidden=[2, 0])
    part = session.regions[0].image
    assert part is not None
    assert part.chosen.written["hidden_edges"] == [0, 2]
