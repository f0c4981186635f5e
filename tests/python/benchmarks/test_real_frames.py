"""Real frames of the benchmarks: what is made of them, on small arrays, and the frames themselves where they are."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import regionpose as rp
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from benchmarks.real_frames import (
    DEGRADATIONS,
    KINDS,
    PROTOCOLS,
    RealFrame,
    Scan,
    axis_errors,
    cropped,
    darkened,
    degraded,
    load_frames,
    mirrored,
    mirrored_camera,
    mismatched,
    perturbed,
    random_rigs,
    rings_by_elevation,
    rings_by_order,
    thinned,
)
from benchmarks.real_scenes import DEFAULT_DATA

Array = NDArray[np.float64]

CAMERA = rp.PinholeCamera(60.0, 62.0, 33.0, 25.0, width=64, height=48, distortion=(-0.1, 0.02, 0.003, -0.004))
TILTED = replace(CAMERA, distortion=(*CAMERA.distortion, *[0.0] * 4, 1e-3, 2e-3, 3e-3, -1e-3, 0.02, -0.03))
TRUTH = rp.Pose(Rotation.from_rotvec([0.3, -1.2, 0.4]), np.array([0.1, -0.3, 0.2]))
UP = np.array([0.0, 0.0, 1.0])
BEAMS_DEG = np.array([2.0, 1.0, -1.0, -3.0, -6.0, -10.0])
PER_RING = 180


def photo(seed: int) -> NDArray[np.uint8]:
    """A photo of noise."""
    return np.random.default_rng(seed).integers(0, 256, (48, 64, 3), dtype=np.uint8)


def rows_of_beams(first_missing: int = 12) -> Array:
    """Points ring by ring from the azimuth 0 on, without the first ones of the first ring."""
    azimuth = np.radians(np.tile(2.0 * np.arange(PER_RING) + 0.5, len(BEAMS_DEG)))
    elevation = np.radians(np.repeat(BEAMS_DEG, PER_RING))
    distance = 5.0 + np.cos(3.0 * azimuth)
    level = distance * np.cos(elevation)
    points = np.column_stack([level * np.cos(azimuth), level * np.sin(azimuth), distance * np.sin(elevation)])
    return points[first_missing:]


def scan() -> Scan:
    """A scan of six rings, of which the higher ones have the larger numbers."""
    rings = len(BEAMS_DEG) - 1 - np.repeat(np.arange(len(BEAMS_DEG)), PER_RING)
    points = rows_of_beams(0)
    return Scan(points, np.arange(len(points), dtype=np.float64), rings)


def frame(number: int, rig: str = "one", scene: str | None = None) -> RealFrame:
    """A frame of a rig, its scene that of its number."""
    return RealFrame(
        name=f"{rig}/{number}",
        rig=rig,
        scene=scene or f"{rig}/{number}",
        camera=CAMERA,
        photo=partial(photo, number),
        scan=partial(scan),
        truth=TRUTH,
        truth_deg=0.1,
        truth_m=0.01,
        scanner=np.zeros(3),
        up=UP,
        near_m=0.5,
    )


def test_photos_and_clouds_are_read_when_asked_for_once_and_are_read_only() -> None:
    calls = []

    def read() -> NDArray[np.uint8]:
        calls.append(1)
        return photo(0)

    given = frame(0)
    object.__setattr__(given, "photo", read)
    assert not calls
    assert given.image is given.image and len(calls) == 1
    for values in (given.image, given.points, given.intensity, given.rings):
        assert values is not None and not values.flags.writeable


@pytest.mark.parametrize(("every", "kept"), [(1, [0, 1, 2, 3, 4, 5]), (2, [5, 3, 1]), (4, [5, 1])])
def test_thinned_keeps_rings_from_the_highest(every: int, kept: list[int]) -> None:
    thin = thinned(frame(0), every)
    assert thin.rings is not None and thin.intensity is not None
    assert sorted(set(thin.rings.tolist())) == sorted(kept)
    np.testing.assert_array_equal(thin.points, scan().points[thin.intensity.astype(int)])
    assert len(thin.points) == PER_RING * len(kept)


def test_thinned_needs_rings() -> None:
    given = frame(0)
    object.__setattr__(given, "scan", lambda: Scan(rows_of_beams()))
    with pytest.raises(ValueError, match="no rings"):
        _ = thinned(given, 2).points


@pytest.mark.parametrize("clockwise", [False, True])
def test_rings_are_told_by_order_and_by_elevation_in_any_frame(clockwise: bool) -> None:
    points, true = rows_of_beams(), np.repeat(np.arange(len(BEAMS_DEG)), PER_RING)[12:]
    points = points * [1.0, -1.0 if clockwise else 1.0, 1.0]
    turn, scanner = Rotation.from_rotvec([0.7, -2.0, 0.5]), np.array([40.0, -3.0, 2.0])
    for moved, place, up in ((points, np.zeros(3), UP), (turn.apply(points) + scanner, scanner, turn.apply(UP))):
        by_order, by_elevation = rings_by_order(moved, place, up), rings_by_elevation(moved, place, up)
        assert by_order is not None and by_elevation is not None
        np.testing.assert_array_equal(by_order, true)
        np.testing.assert_array_equal(by_elevation, len(BEAMS_DEG) - 1 - true)


def test_no_rings_are_told_of_points_without_order() -> None:
    points = np.random.default_rng(0).normal(size=(2000, 3))
    assert rings_by_order(points, np.zeros(3), UP) is None and rings_by_elevation(points, np.zeros(3), UP) is None


def test_a_cropped_photo_has_the_camera_that_saw_it() -> None:
    given, points = frame(1), np.random.default_rng(1).uniform([-1, -1, 4], [1, 1, 6], (50, 3))
    part = cropped(given, 10, 6, 40, 30)
    part.camera.check_size(part.image.shape)
    np.testing.assert_array_equal(part.image, given.image[6:36, 10:50])
    np.testing.assert_allclose(part.camera.project(points), CAMERA.project(points) - [10, 6], atol=1e-9)
    with pytest.raises(ValueError, match="window"):
        cropped(given, 30, 0, 40, 30)


@pytest.mark.parametrize("how", DEGRADATIONS)
def test_degraded_photos_keep_cloud_and_truth(how: str) -> None:
    given = frame(2)
    worse = degraded(given, how)
    worse.camera.check_size(worse.image.shape)
    assert worse.image.dtype == np.uint8 and worse.truth is given.truth and worse.points is given.points
    assert how in worse.name
    if how != "cropped":
        before, after = ((each.image.mean(), each.image.std()) for each in (given, worse))
        assert worse.camera is CAMERA and (after[1] < before[1] if "blurred" in how else after[0] < before[0])


def test_dark_photos_have_a_part_of_their_levels_and_the_same_noise_each_time() -> None:
    given = frame(3)
    np.testing.assert_allclose(darkened(given, factor=0.25).image, given.image / 4.0, atol=0.51)
    first, second = (darkened(given, factor=0.25, noise=4.0).image for _ in range(2))
    np.testing.assert_array_equal(first, second)
    with pytest.raises(ValueError, match="how"):
        degraded(given, "wet")


def test_mismatched_photos_and_clouds_are_of_different_scenes_and_never_the_same_pair() -> None:
    frames = [frame(k) for k in range(3)] + [frame(k, "two", "hall") for k in range(3)] + [frame(9, "three")]
    scenes = {each.name: each.scene for each in frames}
    pairs = mismatched(frames, 200)
    assert all(scenes[pair.photo_of] != scenes[pair.cloud_of] for pair in pairs)
    keys = [(pair.photo_of, pair.cloud_of, pair.is_mirrored) for pair in pairs]
    # 7 x 6 ordered pairs without 3 x 2 of the hall, and each flipped.
    assert len(set(keys)) == len(keys) == 2 * 36
    assert [pair.is_mirrored for pair in pairs] == [False] * 36 + [True] * 36
    assert all(pair.photo_of[:3] == pair.cloud_of[:3] == "one" for pair in pairs[:6])
    few = mismatched(frames, 10, seed=5)
    assert [pair.name for pair in few] == [pair.name for pair in mismatched(frames, 10, seed=5)]
    assert [pair.name for pair in few] != [pair.name for pair in mismatched(frames, 10, seed=6)]


def test_a_cloud_of_several_cameras_is_paired_once() -> None:
    left, right = frame(0, "left", "hall"), frame(0, "right", "hall")
    object.__setattr__(right, "scan", left.scan)
    pairs = mismatched([left, right, frame(1)], 3)
    assert {(pair.photo_of, pair.cloud_of[-1]) for pair in pairs} == {("left/0", "1"), ("right/0", "1"), ("one/1", "0")}


def test_a_mirrored_photo_is_what_its_camera_sees_of_a_mirrored_world() -> None:
    given, points = frame(4), np.random.default_rng(2).uniform([-1, -1, 4], [1, 1, 6], (50, 3))
    flipped = mirrored(given)
    np.testing.assert_array_equal(flipped.image, given.image[:, ::-1])
    assert flipped.is_mirrored and flipped.photo_of == flipped.cloud_of == given.name
    fisheye = rp.FisheyeCamera(60.0, 62.0, 33.0, 25.0, width=64, height=48, distortion=(0.01, 0.02, 0.0, 0.0))
    for camera in (CAMERA, TILTED, fisheye):
        expected = camera.project(points) * [-1.0, 1.0] + [63.0, 0.0]
        np.testing.assert_allclose(mirrored_camera(camera).project(points * [-1.0, 1.0, 1.0]), expected, atol=1e-9)


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_perturbed_poses_are_off_by_uniform_errors(protocol: str) -> None:
    deg, meters = PROTOCOLS[protocol]
    rng = np.random.default_rng(0)
    errors = np.array([axis_errors(perturbed(TRUTH, rng, deg, meters), TRUTH) for _ in range(300)])
    scaled = errors / [deg, deg, deg, meters, meters, meters]
    assert (np.abs(scaled) < 1.0 + 1e-9).all() and (np.abs(scaled).max(axis=0) > 0.9).all()
    np.testing.assert_allclose(scaled.std(axis=0), 1.0 / np.sqrt(3.0), atol=0.06)


def test_axis_errors_are_about_and_along_the_axes_of_the_true_camera() -> None:
    assert axis_errors(TRUTH, TRUTH) == pytest.approx([0.0] * 6, abs=1e-9)
    # A camera that looks further right by 3 degrees, and stands 0.2 m further right and 0.1 m further down.
    center = TRUTH.camera_center + TRUTH.rotation.inv().apply([0.2, 0.1, 0.0])
    rotation = Rotation.from_euler("y", -3.0, degrees=True) * TRUTH.rotation
    errors = axis_errors(rp.Pose(rotation, -rotation.apply(center)), TRUTH)
    assert errors == pytest.approx([0.0, 0.0, 3.0, 0.2, 0.1, 0.0], abs=1e-9)
    forward = TRUTH.rotation.apply(rotation.inv().apply([0.0, 0.0, 1.0]))
    assert forward[0] == pytest.approx(np.sin(np.radians(3.0)))


def test_random_rigs_are_different_frames_of_one_rig() -> None:
    frames = [frame(k) for k in range(5)] + [frame(k, "two") for k in range(2)]
    pairs = random_rigs(frames, 2, 100)
    assert len(pairs) == len({tuple(each.name for each in pair) for pair in pairs}) == 11
    assert all(len({each.rig for each in pair}) == 1 and pair[0] is not pair[1] for pair in pairs)
    assert len(random_rigs(frames, 3, 4, seed=1)) == 4 and random_rigs(frames, 6, 4) == []


def test_kinds_that_are_not_there_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert load_frames(tmp_path) == []
    assert capsys.readouterr().out.count("left out") == len(KINDS)
    with pytest.raises(ValueError, match="kinds"):
        load_frames(tmp_path, ["moon"])


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_real_frames_hold_what_they_say(kind: str) -> None:
    frames = load_frames(DEFAULT_DATA, [kind])
    if not frames:
        pytest.skip("the shared frames are not here")
    assert len({each.name for each in frames}) == len(frames)
    for rig in {each.rig for each in frames}:
        poses = [each.truth.matrix for each in frames if each.rig == rig]
        assert np.ptp(poses, axis=0).max() < 1e-6
    assert all(each.tilt_deg < 10.0 and each.from_scanner_m < 3.0 * each.near_m for each in frames)
    first = frames[0]
    first.camera.check_size(first.image.shape)
    assert first.rings is not None and len(np.unique(first.rings)) in {16, 32, 40, 64}
    pixels = first.camera.project(first.truth @ first.points)
    inside = ((pixels > 0.0) & (pixels < np.array(first.image.shape[1::-1]))).all(axis=1)
    assert inside.mean() > 0.02
