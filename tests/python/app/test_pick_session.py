"""Picking without a browser: regions, pairs, undo, and the scene file."""

from __future__ import annotations

import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from regionpose.app.outcome import Outcome
from regionpose.app.scanner import proposed_scanner
from regionpose.app.session import Session
from regionpose.app.shared_session import SharedSession
from regionpose.app.texts import outcome_html
from regionpose.datasets.demo import demo_folder
from regionpose.io.clouds import Cloud, read_cloud
from regionpose.scene.bundle import read_truth, truth_errors
from regionpose.scene.estimate import SceneEstimate, estimate_scene
from regionpose.scene.fit import region_fits, scene_fit
from regionpose.scene.loading import load_scene

from benchmarks._demo_clicks import BOARD, CHALKBOARD, DOOR, click_sign, demo_files, demo_session

pytestmark = pytest.mark.slow

SQUARE = [[100.0, 100.0], [160.0, 100.0], [160.0, 150.0], [100.0, 150.0]]


@pytest.fixture
def session(tmp_path: Path) -> Session:
    """A session whose scanner stands at zero."""
    return demo_session(tmp_path / "scene.yaml")


def test_three_clicks_a_side_give_the_demo_s_pose_and_the_saved_file_the_same(session: Session) -> None:
    for pixel, place in (DOOR, BOARD, CHALKBOARD):
        session.click_photo(pixel)
        click_sign(session, place)
    assert [picked.is_paired for picked in session.regions] == [True, True, True]
    run = session.estimate()
    errors = truth_errors(run.estimate.pose, read_truth(demo_folder() / "truth.json"))
    assert errors["rotation_deg"] < 0.3
    assert errors["camera_center_m"] < 0.05
    check_measure(run, outcome_html(Outcome.of(run, session.keys_of(run.sides.names))))
    written = session.save()
    assert written[-1] == session.path
    assert not session.is_changed
    np.testing.assert_array_equal(
        estimate_scene(load_scene(session.path)).estimate.pose.matrix, run.estimate.pose.matrix
    )
    again = Session.open(session.path)
    assert not again.is_changed
    np.testing.assert_array_equal(again.estimate().estimate.pose.matrix, run.estimate.pose.matrix)


def check_measure(run: SceneEstimate, html: str) -> None:
    """The share of samples counts where all regions have such, and stands on the page; the areas' doesn't."""
    fits = [fit for fit in run.sample_fits if fit is not None]
    assert len(fits) == len(run.names)
    share = np.average([fit.consistent_fraction for fit in fits], weights=[fit.count for fit in fits])
    assert scene_fit(run).on_their_side == pytest.approx(share)
    assert [fit.on_their_side for fit in region_fits(run)] == [fit.consistent_fraction for fit in fits]
    assert f"{100.0 * share:.1f} %" in html and f"{100.0 * run.estimate.diagnostics.overlap_error:.1f} %" not in html


def test_a_click_on_a_sign_takes_its_whole_wall_and_a_further_one_there_the_sign(session: Session) -> None:
    session.click_cloud(BOARD[1])
    sizes = [points_of(session)]
    for _ in range(2):
        session.click_cloud(np.add(BOARD[1], [0.0, 0.0, 0.05]))
        sizes.append(points_of(session))
    assert sizes[1] < 0.2 * sizes[0] and sizes[2] == sizes[0]
    assert len(session.regions) == 1
    assert session.regions[0].world is not None
    assert session.regions[0].world.at(0).chosen.written["seed"] == BOARD[1]
    session.click_cloud(np.add(BOARD[1], [0.0, 0.0, 0.8]))
    assert len(session.regions) == 2
    again = session.regions[1].world
    assert again is not None
    one, other = again.chosen.side.indices, session.regions[0].world.chosen.side.indices
    assert one is not None and other is not None
    assert len(np.intersect1d(one, other)) > 0.95 * len(np.union1d(one, other)), "the wall is the same from elsewhere"


def points_of(session: Session) -> int:
    world = session.regions[0].world
    assert world is not None and world.chosen.side.indices is not None
    return len(world.chosen.side.indices)


def test_masks_are_proposed_in_order_of_size(session: Session) -> None:
    session.click_photo(DOOR[0])
    image = session.regions[0].image
    assert image is not None
    areas = [image.at(index).chosen.region.area for index in range(len(image))]
    assert areas == sorted(areas)
    assert len(areas) > 1


def test_clicks_fill_the_selected_region_and_then_begin_another(session: Session) -> None:
    session.draw_polygon(SQUARE)
    session.draw_polygon((np.array(SQUARE) + 200.0).tolist())
    assert [picked.name for picked in session.regions] == ["region 1", "region 2"]
    session.draw_polygon((np.array(SQUARE) + 50.0).tolist(), again=True)
    assert len(session.regions) == 2
    session.select(None)
    session.click_cloud(CHALKBOARD[1])
    assert len(session.regions) == 3
    session.select(0)
    session.click_cloud(CHALKBOARD[1])
    assert session.regions[0].is_paired


def test_undo_takes_steps_back_and_redo_takes_them_again(session: Session) -> None:
    session.draw_polygon(SQUARE)
    session.rename(0, "door")
    session.edit_polygon(0, [[*SQUARE[:3], [90.0, 160.0]]], [[1]])
    states = session.regions
    session.remove(0)
    session.undo()
    assert session.regions == states
    for _ in range(5):
        session.undo()
    assert session.regions == ()
    assert not session.can_undo
    for _ in range(3):
        session.redo()
    assert session.regions == states
    session.undo()
    session.rename(0, "gate")
    assert not session.can_redo


def test_pairs_are_made_and_taken_apart(session: Session) -> None:
    session.draw_polygon(SQUARE)
    session.select(None)
    session.click_cloud(CHALKBOARD[1])
    session.pair(0, 1)
    assert len(session.regions) == 1
    assert session.regions[0].is_paired
    session.unpair(0)
    assert [picked.is_paired for picked in session.regions] == [False, False]
    with pytest.raises(ValueError, match="not a pair"):
        session.unpair(0)
    with pytest.raises(ValueError, match="one side in the photo"):
        session.pair(0, 0)


def test_a_mask_becomes_a_polygon_whose_edges_can_be_hidden(session: Session, tmp_path: Path) -> None:
    session.click_photo(DOOR[0])
    before = session.regions[0].image
    assert before is not None
    session.as_polygon(0, 1.0)
    after = session.regions[0].image
    assert after is not None
    assert after.chosen.is_polygon
    assert after.chosen.region.area == pytest.approx(before.chosen.region.area, rel=0.02)
    session.edit_polygon(0, after.chosen.rings, [[0, 2], *[[] for _ in after.chosen.rings[1:]]])
    click_sign(session, DOOR[1])
    session.save()
    read = Session.open(tmp_path / "scene.yaml").regions[0].image
    assert read is not None
    assert read.chosen.hidden[0] == [0, 2]


@pytest.mark.parametrize("name", ["", "  ", "a\nb", "x" * 300])
def test_a_name_that_a_scene_file_cannot_hold_is_refused(session: Session, name: str) -> None:
    session.draw_polygon(SQUARE)
    with pytest.raises(ValueError, match="needed a name"):
        session.rename(0, name)


def test_what_goes_wrong_changes_nothing(session: Session) -> None:
    session.draw_polygon(SQUARE)
    before = session.sketch
    with pytest.raises(ValueError, match="outside"):
        session.click_photo([5000.0, 10.0])
    with pytest.raises(ValueError, match="nearest point"):
        session.click_cloud([500.0, 0.0, 0.0])
    with pytest.raises(ValueError, match=r"cross|intersect"):
        session.draw_polygon([SQUARE[0], SQUARE[2], SQUARE[1], SQUARE[3]])
    with pytest.raises(ValueError, match="no such region"):
        session.remove(17)
    with pytest.raises(ValueError, match="no pair"):
        session.estimate()
    assert session.sketch is before


def test_a_missing_folder_is_not_called_a_missing_image(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError) as raised:
        demo_session(tmp_path / "nowhere" / "scene.yaml")
    assert str(raised.value).startswith(f"{tmp_path / 'nowhere'}: ") and "image" not in str(raised.value)


def test_nothing_is_saved_that_gives_no_pose(session: Session) -> None:
    session.base["solver"] = {"edges": False}
    with pytest.raises(ValueError, match="found no region"):
        session.save()
    assert not session.path.exists()


def test_what_a_scene_file_says_besides_its_regions_is_kept(session: Session, tmp_path: Path) -> None:
    session.base["prior"] = {"up": [0, 0, 1]}
    session.draw_polygon(SQUARE)
    session.click_cloud(CHALKBOARD[1])
    session.save()
    assert load_scene(tmp_path / "scene.yaml").model.prior.up == [0, 0, 1]
    read = Session.open(tmp_path / "scene.yaml")
    read.rename(0, "board")
    read.save()
    assert load_scene(tmp_path / "scene.yaml").model.regions[0].name == "board"
    assert load_scene(tmp_path / "scene.yaml").model.prior.up == [0, 0, 1]


def test_a_save_that_fails_leaves_the_old_files(session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    session.draw_polygon(SQUARE)
    session.click_cloud(CHALKBOARD[1])
    session.save()
    old = session.path.read_text(encoding="utf-8")
    files = {path.name for path in session.path.parent.iterdir()}
    session.click_photo(DOOR[0], again=True)

    def broken(levels: object, path: Path) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("regionpose.app.session._write_mask", broken)
    with pytest.raises(OSError, match="space"):
        session.save()
    assert session.path.read_text(encoding="utf-8") == old
    assert {path.name for path in session.path.parent.iterdir()} == files
    assert session.is_changed


def test_two_pages_edit_one_after_the_other_and_nothing_is_lost(session: Session) -> None:
    from concurrent.futures import ThreadPoolExecutor

    shared = SharedSession(session)
    try:
        squares = [(np.array(SQUARE) + 4.0 * number).tolist() for number in range(24)]
        with ThreadPoolExecutor(8) as pages:
            list(pages.map(lambda square: shared.edit(lambda held: held.draw_polygon(square)), squares))
        assert len(session.regions) == 24
        assert len({picked.name for picked in session.regions}) == 24
        assert len(shared.photo_shapes()) == 24
    finally:
        shared.close()


def reaches_state(shared: SharedSession, state: str) -> bool:
    """Whether the shared session's outcome comes to a state within a minute."""
    until = time.monotonic() + 60.0
    while shared.outcome.state != state and time.monotonic() < until:
        time.sleep(0.01)
    return shared.outcome.state == state


def test_regions_of_one_side_are_matched_as_they_are_picked(session: Session) -> None:
    clicks = (DOOR, BOARD, CHALKBOARD)
    session.base["solver"] = {"edges": False}
    shared = SharedSession(session)
    try:
        for pixel, _ in clicks:
            shared.edit(lambda held: held.select(None))
            shared.edit(partial(Session.click_photo, pixel=pixel))
        assert shared.outcome.state == "empty" and session.basis == []
        for _, place in reversed(clicks):
            shared.edit(lambda held: held.select(None))
            shared.edit(partial(click_sign, place=place))
        assert not session.pairs and len(session.basis) == 6
        assert reaches_state(shared, "ready"), shared.outcome
        run = shared.outcome.run
        assert run is not None
        assert truth_errors(run.estimate.pose, read_truth(demo_folder() / "truth.json"))["rotation_deg"] < 0.3
        assert sorted(shared.outcome.fits) == [picked.key for picked in session.regions[:3]]
        for picked in session.regions[3:]:
            shared.edit(partial(Session.remove, key=picked.key))
        assert shared.outcome.run is None
    finally:
        shared.close()


def test_planes_are_not_looked_for_to_tell_whether_they_can_be_matched(session: Session) -> None:
    session.base["world_regions"] = "planes"
    assert not session.can_estimate
    session.click_photo(DOOR[0])
    assert session.can_estimate and not session._planes


def test_an_estimate_that_breaks_is_told_and_the_next_one_is_made(
    session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    tried: list[int] = []

    def broken(held: Session, stages: object) -> None:
        tried.append(len(tried))
        raise RuntimeError("broken")

    monkeypatch.setattr(Session, "can_estimate", True)
    monkeypatch.setattr(Session, "estimate_regions", broken)
    shared = SharedSession(session)
    try:
        for number in (1, 2):
            until = time.monotonic() + 60.0
            while (len(tried) < number or shared.outcome.state != "failed") and time.monotonic() < until:
                time.sleep(0.01)
            assert shared.outcome.message == "RuntimeError: broken" and len(tried) == number
            shared.estimate_again()
    finally:
        shared.close()


def clicked(session: Session) -> Session:
    for pixel, place in (DOOR, BOARD):
        session.click_photo(pixel)
        click_sign(session, place)
    return session


def have_samples(session: Session) -> list[bool]:
    return [picked.world.chosen.side.region.samples is not None for picked in session.regions if picked.world]


@pytest.fixture
def unasked(tmp_path: Path) -> Session:
    """A session of a cloud whose scanner's place nobody has said."""
    return Session.create(tmp_path / "scene.yaml", **demo_files())


def test_the_scanner_s_place_is_asked_for_saved_and_read_back(unasked: Session) -> None:
    assert unasked.lacks_scanner and unasked.scanner is None
    unasked.set_scanner([0.0, 0.0, 0.0])
    assert not unasked.lacks_scanner and unasked.is_changed
    clicked(unasked).save()
    assert "sensor_origin: [0.0, 0.0, 0.0]" in unasked.path.read_text(encoding="utf-8")
    again = Session.open(unasked.path)
    assert not again.lacks_scanner and again.scanner is not None and not again.scanner.any()
    again.set_scanner(None)
    again.save()
    merged = Session.open(unasked.path)
    assert not merged.lacks_scanner and merged.scanner is None


def test_regions_follow_the_scanner_s_place_and_undo_takes_it_back(session: Session) -> None:
    clicked(session)
    before = session.regions
    assert have_samples(session) == [True, True]
    session.set_scanner([3.0, 0.0, 40.0])
    moved = [picked.world.chosen.side.region for picked in session.regions if picked.world]
    session.undo()
    assert session.regions == before and session.base["sensor_origin"] == [0, 0, 0]
    session.redo()
    assert [picked.world.chosen.side.region for picked in session.regions if picked.world] == moved
    assert session.values()["sensor_origin"] == [3.0, 0.0, 40.0]


def test_a_place_that_is_none_changes_nothing(session: Session) -> None:
    for place in ([0.0, 1.0], [0.0, np.nan, 1.0]):
        with pytest.raises(ValueError, match="the scanner's place: needed three numbers"):
            session.set_scanner(place)
    assert not session.can_undo and session.base["sensor_origin"] == [0, 0, 0]


def test_the_desk_looks_from_the_scanner_s_place(unasked: Session) -> None:
    shared = SharedSession(unasked)
    try:
        assert shared.proposal is not None and not shared.proposal.any()
        middle, pictured = shared.middle, shared.pictured
        shared.edit(lambda session: session.set_scanner([1.0, 0.5, 0.2]))
        np.testing.assert_array_equal(shared.place, [1.0, 0.5, 0.2])
        np.testing.assert_array_equal(shared.range_view.place, shared.place)
        np.testing.assert_array_equal(shared.middle, middle)
        assert shared.pictured > pictured
        shared.edit(Session.undo)
        np.testing.assert_array_equal(shared.place, [0.0, 0.0, 0.0])
    finally:
        shared.close()


def test_only_a_single_scan_around_zero_proposes_a_place() -> None:
    cloud = read_cloud(demo_folder() / "cloud.ply")
    points = cloud.local_points
    assert proposed_scanner(cloud) is not None
    assert proposed_scanner(Cloud(points - [2.0, 1.0, 0.3])) is None
    assert proposed_scanner(Cloud(points + np.array([4e5, 5e6, 100.0]))) is None
    generator = np.random.default_rng(0)
    assert proposed_scanner(Cloud(generator.normal(0.0, 3.0, (20_000, 3)))) is None
    assert proposed_scanner(Cloud(points[:1])) is None
