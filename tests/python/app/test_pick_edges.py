"""The picking page before there is a pair: the pose by edges, the cloud over the photo, and what is saved of it."""

from __future__ import annotations

import io
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import regionpose as rp
from commands import run
from diagnostics import edges_of
from made_up_worlds import World, pose_of
from pick_sessions import holds
from PIL import Image
from regionpose.app.frames import Frames
from regionpose.app.outcome import Outcome
from regionpose.app.prior_settings import PriorSettings
from regionpose.app.session import Session
from regionpose.app.shared_session import SharedSession
from regionpose.app.texts import outcome_html
from regionpose.fusion.colors import seen_points
from regionpose.io.clouds import Cloud, write_ply
from regionpose.progress import UnwantedError, check_wanted
from regionpose.scene.document import SceneError
from regionpose.scene.estimate import estimate_scene
from regionpose.scene.loading import load_scene
from regionpose.solve.estimate import Alternative
from small_searches import draw_fewer, skip_planes, two_worlds

pytestmark = pytest.mark.slow

COLMAP = "1 PINHOLE 480 320 260 260 240 160\n"
SHARED = {"initial_rotation_sigma_deg": 5.0, "initial_center_sigma_m": 0.3, "up": [0.0, 0.0, 1.0], "up_sigma_deg": 3.0}
PRIOR = {"initial": {"camera_from_world": {"matrix": pose_of(45.0).matrix.tolist()}}, **SHARED}
"""With which few poses are enough to find the true one."""

SOON_S = 20.0
"""Seconds after which work that nobody waits for has ended."""

SQUARE = [[200.0, 140.0], [280.0, 140.0], [280.0, 200.0], [200.0, 200.0]]


@pytest.fixture(scope="module")
def worlds() -> list[World]:
    return two_worlds()


@pytest.fixture(autouse=True)
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Far fewer poses are looked at than a search needs, and no planes confirmed, which the page does not show."""
    draw_fewer(monkeypatch)
    skip_planes(monkeypatch)


def write_pair(folder: Path, world: World, name: str) -> None:
    Image.fromarray(world.photo).save(folder / f"{name}.png")
    write_ply(folder / f"{name}.ply", Cloud.from_points(world.points, intensity=world.intensity))


@pytest.fixture
def drive(worlds: list[World], tmp_path: Path) -> Path:
    """A folder of two pairs of one rig."""
    folder = tmp_path / "drive"
    folder.mkdir()
    for number, world in enumerate(worlds, start=1):
        write_pair(folder, world, f"000{number}")
    (tmp_path / "cameras.txt").write_text(COLMAP, encoding="utf-8")
    return folder


def session_of(drive: Path, **extra: Any) -> Session:
    """A new scene of the first pair; without a key where it is None."""
    image, camera, cloud = drive / "0001.png", drive.parent / "cameras.txt", drive / "0001.ply"
    held = {"sensor_origin": [0.0, 0.0, 0.0], "prior": PRIOR, **extra}
    given = {key: value for key, value in held.items() if value is not None}
    return Session.create(drive.parent / "scene.yaml", image=image, camera=camera, cloud=cloud, **given)


@contextmanager
def opened(session: Session) -> Iterator[SharedSession]:
    shared = SharedSession(session)
    try:
        yield shared
    finally:
        shared.close()


def reaches_state(shared: SharedSession, state: str = "ready") -> bool:
    return holds(lambda: shared.outcome.state == state)


def assert_right(pose: rp.Pose, truth: rp.Pose) -> None:
    assert np.degrees((pose.rotation * truth.rotation.inv()).magnitude()) < 0.5
    assert np.linalg.norm(pose.camera_center - truth.camera_center) < 0.15


def pick_pair(shared: SharedSession) -> None:
    """Mark a region in the photo, and some plane of the cloud as its other side."""
    shared.edit(lambda session: session.draw_polygon(SQUARE))
    points = shared.session.cloud.local_points
    wall = points[np.argmin(np.abs(points - [14.0, 0.0, 0.0]).sum(axis=1))]
    shared.edit(partial(Session.click_cloud, place=wall))


def test_the_page_opens_with_the_pose_by_edges(drive: Path, worlds: list[World]) -> None:
    with opened(session_of(drive)) as shared:
        assert shared.outcome.state == "busy" and shared.outcome.searches_edges
        assert "rp-spin" in outcome_html(shared.outcome)
        assert reaches_state(shared), shared.outcome
        run = shared.outcome.run
        assert run is not None and run.estimate.diagnostics.edges is not None
        assert_right(run.estimate.pose, worlds[0].pose)
        html = outcome_html(shared.outcome)
        assert f"rp-{run.estimate.status}" in html and f"{edges_of(run.estimate).count:,}" in html
        assert holds(lambda: shared.stage == "") and "photo" in shared.colorings
        shared.color_by("photo")
        assert shared.coloring == "photo"


def test_the_cloud_lies_over_the_photo_at_once_and_can_be_switched_off(drive: Path) -> None:
    with opened(session_of(drive)) as shared:
        assert shared.shows_depth and shared.depth_files == []
        assert reaches_state(shared) and holds(lambda: bool(shared.depth_files))
        run = shared.outcome.run
        assert run is not None and shared.depth_files[0].startswith("files/depth.jpg")
        shown = np.asarray(Image.open(io.BytesIO(shared.files["depth.jpg"].content)).convert("RGB"), dtype=np.float64)
        assert shown.shape == shared.session.image.shape, "pixels stay where they are"
        pixels, depths, _ = seen_points(run.camera, shared.cloud.local_points, run.local_pose, shown.shape[:2])
        seen = np.flatnonzero(np.isfinite(depths) & (depths > 0.0))[::50]
        drawn = shown[tuple(np.round(pixels[seen][:, ::-1]).astype(int).T)]
        assert np.ptp(drawn, axis=1).mean() > 40.0, "the dots are colored, the photo below them is gray"
        shared.show_depth(False)
        assert shared.depth_files == []


def test_the_runner_up_is_shown_where_the_pose_is_not_trusted(drive: Path) -> None:
    with opened(session_of(drive)) as shared:
        assert reaches_state(shared) and holds(lambda: shared.stage == "")
        run = shared.outcome.run
        assert run is not None
        other = run.estimate.pose.retract(np.array([0.0, 0.5, 0.0, 0.0, 0.0, 0.0]))
        place = Alternative(other, run.estimate.covariance, 0.3, 0.3, np.nan, np.empty(0))
        diagnostics = replace(run.estimate.diagnostics, alternatives=(place,))
        doubt = rp.PoseWarning(
            rp.WarningCode.AMBIGUOUS_POSE, values={"others": 1, "rotation_deg": 28.6, "shift_m": 0.0}
        )
        unsure = replace(run.estimate, warnings=(doubt,), diagnostics=diagnostics)
        shared._show(replace(shared.outcome, run=replace(run, estimate=unsure)))
        assert [name.split("?")[0] for name in shared.depth_files] == ["files/depth.jpg", "files/runner_up.jpg"]
        assert shared.files["depth.jpg"].content != shared.files["runner_up.jpg"].content
        shared._show(replace(shared.outcome, run=replace(run, estimate=replace(unsure, warnings=()))))
        assert len(shared.depth_files) == 1


def test_what_was_assumed_is_on_the_page(drive: Path) -> None:
    prior = {key: value for key, value in PRIOR.items() if "initial" not in key}
    with opened(session_of(drive, prior=prior)) as shared:
        assert reaches_state(shared), shared.outcome
        run = shared.outcome.run
        assert run is not None and run.estimate.diagnostics.edges is not None
        assert edges_of(run.estimate).assumed == ("camera_near_sigma_m",)
        html = outcome_html(shared.outcome)
        assert "within 0.5 m" in html and "(assumed)" in html and "up to 3 deg" in html
        assert html.count("(assumed)") == 1
    session = session_of(drive, prior=prior, sensor_origin=None)
    assert session.lacks_scanner
    outcome = Outcome.of(session.estimate_edges(session.edge_values()), [])
    assert outcome_html(outcome).count("(assumed)") == 2, "the scanner's place, too"


def test_a_scene_without_regions_is_saved_and_estimated_to_the_same_pose(drive: Path) -> None:
    session = session_of(drive)
    assert session.can_save and not session.is_changed
    with opened(session) as shared:
        assert reaches_state(shared)
        run = shared.outcome.run
        assert run is not None
        assert shared.save() == [session.path]
    assert not session.can_save
    again = load_scene(session.path)
    np.testing.assert_array_equal(estimate_scene(again).estimate.pose.matrix, run.estimate.pose.matrix)
    read = Session.open(session.path)
    assert read.regions == () and read.searches_edges and not read.can_save


def test_what_could_not_be_read_again_is_not_saved(drive: Path) -> None:
    session = session_of(drive)
    session.draw_polygon(SQUARE)
    with pytest.raises(SceneError, match="found regions of one side"):
        session.save()
    session.undo()
    session.base["solver"] = {"edges": False}
    with pytest.raises(SceneError, match="found no region"):
        session.save()
    assert not session.path.exists()


def test_scenes_whose_edges_do_not_count_wait_for_a_pair(drive: Path) -> None:
    session = session_of(drive, solver={"edges": False})
    assert not session.searches_edges and not session.has_estimate
    with opened(session) as shared:
        assert shared.outcome.state == "empty" and not shared.shows_depth
        time.sleep(1.0)
        assert shared.outcome.state == "empty" and shared.outcome.run is None


@pytest.fixture
def searches(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """How the searches by edges ended, which are as they are."""
    held: list[str] = []
    estimate = Session.estimate_edges

    def noted(session: Session, *given: Any) -> Any:
        held.append("begun")
        try:
            run = estimate(session, *given)
        except UnwantedError:
            held[-1] = "abandoned"
            raise
        held[-1] = "found"
        return run

    monkeypatch.setattr(Session, "estimate_edges", noted)
    return held


def test_a_pair_is_estimated_by_regions_and_without_it_the_edges_count_again(drive: Path, searches: list[str]) -> None:
    with opened(session_of(drive)) as shared:
        assert reaches_state(shared)
        first = shared.outcome.run
        shared.edit(lambda session: session.draw_polygon(SQUARE))
        assert shared.outcome.run is first and shared.outcome.state == "ready", "a side alone changes no pose"
        shared.edit(Session.undo)
        pick_pair(shared)
        assert shared.outcome.state == "busy" and not shared.outcome.searches_edges and shared.outcome.run is first
        assert holds(
            lambda: shared.outcome.state in ("regions", "ready", "failed") and not shared.outcome.searches_edges
        )
        assert shared.outcome.run is None or shared.outcome.run.estimate.diagnostics.edges is None
        shared.edit(lambda session: session.remove(session.regions[0].key))
        assert shared.outcome.run is None and shared.outcome.searches_edges and shared.depth_files == []
        assert reaches_state(shared)
        assert shared.outcome.run is first and searches == ["found"], "nothing was searched for twice"
        assert holds(lambda: len(shared.depth_files) >= 1)


def test_a_changed_prior_is_searched_anew(drive: Path, searches: list[str]) -> None:
    with opened(session_of(drive)) as shared:
        assert reaches_state(shared)
        first = shared.outcome.run
        shared.edit(lambda session: session.set_prior_settings(replace(session.prior_settings, up_sigma_deg=2.0)))
        assert shared.outcome.state == "busy" and shared.outcome.run is first
        assert reaches_state(shared)
        run = shared.outcome.run
        assert run is not first and run is not None and run.estimate.diagnostics.edges is not None
        assert edges_of(run.estimate).prior.up_sigma_deg == 2.0 and searches == ["found", "found"]


def test_a_place_of_the_scanner_is_searched_from(drive: Path, searches: list[str]) -> None:
    with opened(session_of(drive)) as shared:
        assert reaches_state(shared)
        shared.edit(lambda session: session.set_scanner([0.01, 0.0, 0.0]))
        assert shared.outcome.state == "busy" and reaches_state(shared)
        run = shared.outcome.run
        assert run is not None and run.scanner is not None
        np.testing.assert_array_equal(run.scanner.place, [0.01, 0.0, 0.0])
        assert searches == ["found", "found"]


def test_a_search_can_be_stopped_and_taken_up_again(
    drive: Path, monkeypatch: pytest.MonkeyPatch, worlds: list[World]
) -> None:
    ends: list[str] = []
    estimate, first = Session.estimate_edges, [True]

    def slow(session: Session, *given: Any) -> Any:
        if not first:
            return estimate(session, *given)
        first.pop()
        given[1].begin("pose")
        given[1].progress(0.25)
        try:
            while True:
                check_wanted()
                time.sleep(0.01)
        except UnwantedError:
            ends.append("abandoned")
            raise

    monkeypatch.setattr(Session, "estimate_edges", slow)
    with opened(session_of(drive)) as shared:
        assert holds(lambda: "25 %" in shared.stage)
        shared.stop()
        assert shared.outcome.state == "stopped" and shared.stage == "" and shared.outcome.run is None
        assert holds(lambda: ends == ["abandoned"], SOON_S)
        shared.estimate_again()
        assert reaches_state(shared)
        assert shared.outcome.run is not None
        assert_right(shared.outcome.run.estimate.pose, worlds[0].pose)


def test_a_page_that_is_closed_ends_its_search(drive: Path, searches: list[str], monkeypatch: Any) -> None:
    draw_fewer(monkeypatch, 3_000_000)
    shared = SharedSession(session_of(drive))
    assert holds(lambda: searches == ["begun"])
    time.sleep(1.0)
    shared.close()
    assert holds(lambda: searches == ["abandoned"], SOON_S)


def test_clouds_without_edges_are_named_as_such(drive: Path) -> None:
    write_ply(drive / "0001.ply", Cloud.from_points(np.random.default_rng(0).random((9, 3))), overwrite=True)
    with opened(session_of(drive)) as shared:
        assert reaches_state(shared, "failed")
        assert shared.outcome.searches_edges and "no pose was found" in outcome_html(shared.outcome)
        assert shared.depth_files == []


# Frames of a rig.


def frames_of(drive: Path) -> Frames:
    frames = Frames.of_folder(drive, drive.parent / "cameras.txt")
    frames.session_at(0).base["prior"] = PRIOR
    return frames


def test_the_pose_by_edges_is_of_all_frames_and_stays_when_another_is_shown(
    drive: Path, worlds: list[World], searches: list[str]
) -> None:
    frames = frames_of(drive)
    with opened(frames.session_at(0)) as shared:
        assert reaches_state(shared), shared.outcome
        run = shared.outcome.run
        assert run is not None and [sides.scene.name for sides in run.frames] == ["0001", "0002"]
        assert_right(run.estimate.pose, worlds[0].pose)
        assert holds(lambda: bool(shared.depth_files))
        first = shared.files["depth.jpg"].content
        shared.show_session(frames.session_at(1))
        assert shared.depth_files == [] and shared.outcome.state == "busy"
        assert reaches_state(shared)
        assert shared.outcome.run is run and searches == ["found"]
        assert holds(lambda: bool(shared.depth_files))
        assert shared.files["depth.jpg"].content != first, "it is drawn over the other photo"
        written = shared.save()
    assert written == [drive / "scene.yaml"]
    scene = load_scene(drive / "scene.yaml")
    assert [frame.name for frame in scene.frames] == ["0001", "0002"]
    np.testing.assert_array_equal(estimate_scene(scene).estimate.pose.matrix, run.estimate.pose.matrix)
    again = Frames.of_scene(drive / "scene.yaml").session_at(1)
    assert again.searches_edges and not again.can_save


def test_frames_with_a_pair_are_saved_without_the_others(drive: Path) -> None:
    frames = frames_of(drive)
    with opened(frames.session_at(1)) as shared:
        pick_pair(shared)
        shared.save()
    assert [frame.name for frame in load_scene(drive / "scene.yaml").frames] == ["0002"]


def test_frames_far_from_zero_share_one_origin(drive: Path, worlds: list[World]) -> None:
    far = np.array([431_000.0, 5_230_000.0, 440.0])
    for number, world in enumerate(worlds, start=1):
        # A kilometer apart in what their files hold, whose local origins differ.
        beside = [1000.0 * number, 0.0, 0.0]
        points = np.concatenate([world.points, np.repeat([beside], number * len(world.points), axis=0)])
        intensity = np.concatenate([world.intensity, np.zeros(number * len(world.points))])
        write_ply(drive / f"000{number}.ply", Cloud.from_points(points + far, intensity=intensity), overwrite=True)
    frames = Frames.of_folder(drive, drive.parent / "cameras.txt")
    session = frames.session_at(0)
    truth = worlds[0].pose.rebase(-far)
    start = pose_of(45.0).rebase(-far)
    session.base["prior"] = {"initial": {"camera_from_world": {"matrix": start.matrix.tolist()}}, **SHARED}
    run = session.estimate_edges(session.edge_values())
    assert_right(run.estimate.pose, truth)
    origins = {tuple(sides.origin) for sides in run.frames}
    assert len(origins) == 1


# The command.


def pick_words(drive: Path) -> list[str]:
    files = {"--image": drive / "0001.png", "--camera": drive.parent / "cameras.txt", "--cloud": drive / "0001.ply"}
    return [str(word) for pair in files.items() for word in pair]


@pytest.mark.parametrize("is_folder", [False, True])
def test_the_options_of_calibrate_narrow_the_search(
    drive: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], is_folder: bool
) -> None:
    held: list[Session] = []

    def served(shared: SharedSession, **_: Any) -> None:
        shared.close()
        held.append(shared.session)

    monkeypatch.setattr("regionpose.app.server.serve", served)
    place = [str(drive), "--camera", str(drive.parent / "cameras.txt")]
    scene = place if is_folder else [str(drive.parent / "scene.yaml"), *pick_words(drive)]
    code, _, errors = run(capsys, "pick", *scene, "--up", "-y", "--near", "0,0,1,0.3", "--quiet")
    assert (code, errors) == (0, "")
    session = held[0]
    assert session.prior_settings == PriorSettings(
        near=(0.0, 0.0, 1.0), near_sigma_m=0.3, up=(0.0, -1.0, 0.0), up_sigma_deg=5.0
    )
    prior = session.edge_values()["prior"]
    assert prior["up"] == [0.0, -1.0, 0.0] and prior["camera_near_sigma_m"] == 0.3 and session.is_changed


WRONG = [
    ("--up", "north"),
    ("--up", "0,0,0"),
    ("--near", "close"),
    ("--near=0,0,0,-1",),
    ("--near", "0.3"),  # Of a cloud whose scanner is not known.
    ("--mount", "top"),
]


@pytest.mark.parametrize("words", WRONG)
def test_options_that_are_wrong_are_named(
    drive: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...]
) -> None:
    scene = drive.parent / "scene.yaml"
    code, out, errors = run(capsys, "pick", scene, *pick_words(drive), *words, "--quiet")
    assert code == 2 and out == "" and "Traceback" not in errors
    assert words[0].partition("=")[0] in " ".join(errors.split()), errors
    assert not scene.exists()
