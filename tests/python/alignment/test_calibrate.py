"""`calibrate`: the pose of a camera from photos and clouds of made-up worlds, without regions or a start."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from dataclasses import FrozenInstanceError, replace
from typing import Any, NamedTuple

import numpy as np
import pytest
import regionpose as rp
from diagnostics import edges_of
from made_up_worlds import CAMERA, World, made_world, pose_of
from numpy.typing import NDArray
from regionpose import _core
from regionpose.alignment.edge_frame import EdgeFrame
from regionpose.alignment.photo_cloud import PhotoCloud
from regionpose.progress import UnwantedError, while_wanted
from regionpose.solve.options import EXACT_EXPOSURE
from regionpose.solve.prior import MOUNT_SIGMA_M
from small_searches import draw_fewer, try_fewer_focal_lengths, two_worlds

pytestmark = pytest.mark.slow

Array = NDArray[np.float64]

KNOWN = rp.Prior(camera_near=[0.0, 0.0, 0.0], camera_near_sigma_m=0.5, up=[0.0, 0.0, 1.0], up_sigma_deg=3.0)
"""Of the camera, whose heading is not known."""

MOST_DEG, MOST_M, SIGMAS = 0.3, 0.1, 4.0
"""What a pose may be off by, and in its own standard deviations."""

FAR = np.array([500_000.0, 4_200_000.0, 120.0])
"""A place of a map's grid, meters."""

EXACT = rp.Solver(**EXACT_EXPOSURE)


class Found(NamedTuple):
    """A world, what was found of it, and what was told of the progress meanwhile."""

    world: World
    calibration: rp.PoseEstimate
    shares: list[float]


@pytest.fixture(scope="module")
def worlds() -> list[World]:
    """Two places at which one rig stood."""
    return two_worlds()


@pytest.fixture(scope="module")
def found(worlds: list[World]) -> Found:
    shares: list[float] = []
    return Found(worlds[0], rp.calibrate(CAMERA, [worlds[0].frame()], prior=KNOWN, progress=shares.append), shares)


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Far fewer poses are looked at than a search needs."""
    draw_fewer(monkeypatch, 2_000, (60, 20, 6))


def about_mount(pose: rp.Pose, sigma_deg: float = 20.0, sigma_m: float = 0.5) -> rp.Prior:
    return rp.Prior(initial=pose, initial_rotation_sigma_deg=sigma_deg, initial_center_sigma_m=sigma_m)


def errors(pose: rp.Pose, truth: rp.Pose) -> tuple[float, float]:
    """Degrees, and meters of the camera's center."""
    turn = np.degrees((pose.rotation * truth.rotation.inv()).magnitude())
    return float(turn), float(np.linalg.norm(pose.camera_center - truth.camera_center))


def off_by(calibration: rp.PoseEstimate, truth: rp.Pose) -> float:
    """The error along the worst axis, in standard deviations."""
    error = calibration.pose.local_coordinates(truth)
    return float(np.max(np.abs(error) / np.sqrt(np.diag(calibration.covariance))))


def assert_right(calibration: rp.PoseEstimate, truth: rp.Pose) -> None:
    turn, shift = errors(calibration.pose, truth)
    assert turn < MOST_DEG and shift < MOST_M, (turn, shift)
    assert off_by(calibration, truth) < SIGMAS


def codes(calibration: rp.PoseEstimate) -> set[str]:
    return {warning.code for warning in calibration.warnings}


def same(calibration: rp.PoseEstimate, other: rp.PoseEstimate) -> bool:
    """Whether two are the same to the last bit."""
    return pickle.dumps(calibration.covariance.tolist()) == pickle.dumps(other.covariance.tolist()) and [
        (mode.pose.matrix.tolist(), mode.log_mass, mode.edges) for mode in edges_of(calibration).modes
    ] == [(mode.pose.matrix.tolist(), mode.log_mass, mode.edges) for mode in edges_of(other).modes]


def test_the_pose_is_found_without_a_heading(found: Found) -> None:
    calibration, estimate = found.calibration, found.calibration
    assert_right(calibration, found.world.pose)
    assert (
        edges_of(calibration).log_odds > 2.0
        and edges_of(calibration).log_odds_over_next > 2.0
        and edges_of(calibration).count > 500
    )
    assert edges_of(calibration).assumed == () and edges_of(calibration).prior == KNOWN
    assert calibration.pose is estimate.pose and estimate.confidence > 0.98
    assert estimate.diagnostics.region_overlap_errors.shape == (0,) and np.isnan(estimate.diagnostics.overlap_error)
    assert 2.0 < estimate.diagnostics.distance_m < 15.0
    assert estimate.diagnostics.pixel_angle_rad == pytest.approx(1.0 / 260.0, rel=0.01)
    assert codes(calibration) <= {"weak-geometry"}


def test_alternatives_are_elsewhere_and_share_what_the_pose_leaves(found: Found) -> None:
    estimate = found.calibration
    assert estimate.diagnostics.alternatives
    shares = [other.mode_probability for other in estimate.diagnostics.alternatives]
    assert shares == sorted(shares, reverse=True) and estimate.diagnostics.mode_probability + sum(shares) <= 1.0 + 1e-12
    for other in estimate.diagnostics.alternatives:
        turn, shift = errors(other.pose, estimate.pose)
        assert turn > 5.0 or shift > 1.0
    masses = [mode.log_mass for mode in edges_of(found.calibration).modes]
    assert masses == sorted(masses, reverse=True)
    assert all(np.linalg.eigvalsh(mode.covariance).min() > 0.0 for mode in edges_of(found.calibration).modes)


def test_progress_rises_from_0_to_1(found: Found) -> None:
    assert found.shares == sorted(found.shares) and len(found.shares) > 2
    assert found.shares[0] >= 0.0 and found.shares[-1] == 1.0
    # No part of the work is so long without a share that the time left is anybody's guess.
    assert np.diff(found.shares).max() < 0.25


def test_the_answer_is_the_same_each_time(few: None, worlds: list[World]) -> None:
    first, second = (rp.calibrate(CAMERA, [worlds[0].frame()], prior=KNOWN) for _ in range(2))
    assert same(first, second)


def test_the_answer_is_the_same_on_any_number_of_threads(worlds: list[World]) -> None:
    core, density = (
        EdgeFrame(PhotoCloud.of(CAMERA, worlds[0].frame()), np.zeros(3)).core,
        _core.Density.of_prior(KNOWN.core),
    )
    one, many = (_core.search_poses([core], density, [], 1_000, [40, 20, 6], threads=count) for count in (1, 3))
    assert one and len(one) == len(many)
    for mode, other in zip(one, many, strict=True):
        assert all(np.array_equal(np.asarray(a), np.asarray(b)) for a, b in zip(mode, other, strict=True))


def test_frames_of_a_rig_add_up(few: None, worlds: list[World]) -> None:
    known = about_mount(pose_of(41.0), 3.0, 0.1)
    frames = [world.frame() for world in worlds]
    alone = [rp.calibrate(CAMERA, [frame], prior=known, solver=EXACT) for frame in frames]
    both = rp.calibrate(CAMERA, frames, prior=known, solver=EXACT)
    assert_right(both, worlds[0].pose)
    assert edges_of(both).count > max(edges_of(one).count for one in alone)
    assert np.linalg.det(both.covariance) < min(np.linalg.det(one.covariance) for one in alone)


def test_errors_of_whole_exposures_shrink_by_the_number_of_frames(few: None, worlds: list[World]) -> None:
    known = about_mount(worlds[0].pose, 3.0, 0.1)
    frames = [world.frame() for world in worlds]
    solvers = [EXACT, replace(EXACT, frame_sigma_deg=1.0, frame_sigma_m=0.2)]
    for count in (1, 2):
        exact, rough = (rp.calibrate(CAMERA, frames[:count], prior=known, solver=solver) for solver in solvers)
        added = np.diag(rough.covariance - exact.covariance)
        assert added == pytest.approx(np.repeat([np.radians(1.0) ** 2, 0.2**2], 3) / count)


def test_a_mount_is_enough_to_know(worlds: list[World], monkeypatch: pytest.MonkeyPatch) -> None:
    """As many poses are drawn as the prior distinguishes: a tenth of those without a heading."""
    try_fewer_focal_lengths(monkeypatch)
    rough = rp.Pose.from_parts(pose_of(55.0).rotation.as_matrix(), np.zeros(3))
    calibration = rp.calibrate(CAMERA, [worlds[0].frame()], prior=about_mount(rough))
    assert_right(calibration, worlds[0].pose)
    assert edges_of(calibration).assumed == ()
    assert all(errors(mode.pose, rough)[0] < 100.0 for mode in edges_of(calibration).modes)


def test_what_is_known_closely_makes_the_pose_surer(few: None, worlds: list[World]) -> None:
    loose, close = (
        rp.calibrate(CAMERA, [worlds[0].frame()], prior=about_mount(worlds[0].pose, *sigmas), solver=EXACT).covariance
        for sigmas in ((10.0, 0.5), (0.05, 0.003))
    )
    assert np.linalg.det(close) < 1e-3 * np.linalg.det(loose)
    assert np.sqrt(np.diag(close)).max() < 0.01


def test_a_rough_pose_is_a_start_without_deviations(few: None, worlds: list[World]) -> None:
    known = replace(KNOWN, initial=worlds[0].pose.retract([0.005, -0.005, 0.005, 0.02, 0.0, -0.02]))
    calibration = rp.calibrate(CAMERA, [worlds[0].frame()], prior=known)
    assert_right(calibration, worlds[0].pose)


def test_what_is_not_said_of_the_place_is_assumed(few: None, worlds: list[World]) -> None:
    frame = worlds[0].frame()
    calibration = rp.calibrate(CAMERA, [frame], prior=rp.Prior(up=[0, 0, 1], up_sigma_deg=3.0))
    assert edges_of(calibration).assumed == ("camera_near", "camera_near_sigma_m")
    assert edges_of(calibration).prior.camera_near == (0.0, 0.0, 0.0)
    assert edges_of(calibration).prior.camera_near_sigma_m == MOUNT_SIGMA_M
    near = rp.calibrate(CAMERA, [frame], prior=rp.Prior(camera_near=[0.1, 0.0, 0.0]))
    assert edges_of(near).assumed == ("camera_near_sigma_m",) and edges_of(near).prior.camera_near == (0.1, 0.0, 0.0)
    assert edges_of(rp.calibrate(CAMERA, [frame])).assumed == ("camera_near", "camera_near_sigma_m")


def test_a_photo_of_another_world_is_not_trusted(worlds: list[World], monkeypatch: pytest.MonkeyPatch) -> None:
    try_fewer_focal_lengths(monkeypatch)
    mixed = worlds[0]._replace(photo=made_world(30, 200.0, 0.7).photo)
    calibration = rp.calibrate(CAMERA, [mixed.frame()], prior=KNOWN)
    assert calibration.confidence < 0.8 and codes(calibration) & {"low-confidence", "ambiguous-pose"}


def test_a_photo_of_one_shade_is_not_trusted(few: None, worlds: list[World]) -> None:
    world = worlds[0]._replace(photo=np.full_like(worlds[0].photo, 128))
    calibration = rp.calibrate(CAMERA, [world.frame()], prior=KNOWN)
    assert calibration.confidence < 0.5 and codes(calibration) & {"low-confidence", "ambiguous-pose"}


def test_nobody_waits_for_unwanted_work(few: None, worlds: list[World]) -> None:
    asked: list[int] = []

    def is_wanted() -> bool:
        asked.append(1)
        return len(asked) < 3

    shares: list[float] = []
    with while_wanted(is_wanted), pytest.raises(UnwantedError):
        rp.calibrate(CAMERA, [world.frame() for world in worlds], prior=KNOWN, progress=shares.append)
    assert shares and max(shares) < 0.5


def test_points_that_are_not_finite_are_left_out(few: None, worlds: list[World]) -> None:
    world, known = worlds[0], about_mount(worlds[0].pose, 3.0, 0.2)
    points, shades = world.points.copy(), world.intensity.copy()
    points[::11], points[3] = np.nan, np.inf
    shades[5::11] = np.nan
    calibration = rp.calibrate(CAMERA, [rp.Frame(image=world.photo, points=points, intensity=shades)], prior=known)
    assert_right(calibration, world.pose)


def test_numbers_may_be_of_any_kind(few: None, worlds: list[World]) -> None:
    world, known = worlds[0], about_mount(worlds[0].pose, 3.0, 0.2)
    # To be the same in single precision.
    points, shades = world.points.astype(np.float32), world.intensity.astype(np.float32)
    kinds: list[tuple[Any, Any]] = [
        (points, shades),
        (np.asfortranarray(points, dtype=np.float64), shades.tolist()),
        (points.tolist(), shades.astype(np.float64)),
    ]
    first, *others = (
        rp.calibrate(CAMERA, [rp.Frame(image=world.photo, points=cloud, intensity=intensity)], prior=known)
        for cloud, intensity in kinds
    )
    assert all(same(first, other) for other in others)


def test_clouds_of_a_map_s_grid_give_the_same_pose(few: None, worlds: list[World]) -> None:
    world = worlds[0]
    far = world._replace(points=world.points + FAR)
    here = rp.calibrate(CAMERA, [world.frame()], prior=KNOWN)
    there = rp.calibrate(CAMERA, [far.frame()], prior=KNOWN.rebase(-FAR), sensor_origin=FAR)
    pairs = [
        (here.pose, there.pose),
        *zip((m.pose for m in edges_of(here).modes), (m.pose for m in edges_of(there).modes), strict=True),
    ]
    others = zip(here.diagnostics.alternatives, there.diagnostics.alternatives, strict=True)
    pairs += [(one.pose, other.pose) for one, other in others]
    for one, other in pairs:
        assert one.matrix == pytest.approx(other.rebase(FAR).matrix, abs=1e-6)
        assert one.camera_center == pytest.approx(other.camera_center - FAR, abs=1e-6)
    sigmas = np.sqrt(np.diag(here.covariance))
    assert there.covariance / np.outer(sigmas, sigmas) == pytest.approx(
        here.covariance / np.outer(sigmas, sigmas), abs=1e-6
    )
    assert edges_of(there).log_odds == pytest.approx(edges_of(here).log_odds, abs=1e-9)
    assert edges_of(there).prior == KNOWN.rebase(-FAR)


def test_the_scanner_s_place_is_where_the_camera_is_assumed(few: None, worlds: list[World]) -> None:
    far = worlds[0]._replace(points=worlds[0].points + FAR)
    calibration = rp.calibrate(CAMERA, [far.frame()], prior=rp.Prior(up=[0.0, 0.0, 1.0]), sensor_origin=FAR)
    assert edges_of(calibration).prior.camera_near == tuple(FAR)
    assert np.linalg.norm(calibration.pose.camera_center - FAR) < 3.0


NOTHING: dict[str, tuple[Callable[[World], Array], str]] = {
    "no point": (lambda world: np.empty((0, 3)), r"0 points have 0 edges"),
    "one point": (lambda world: world.points[:1], r"1 points have 0 edges"),
    "five points": (lambda world: world.points[:5], r"5 points have 0 edges"),
    "no finite point": (lambda world: np.full((40, 3), np.nan), r"0 points have 0 edges"),
    "one place": (lambda world: np.tile([[4.0, 1.0, 0.5]], (100, 1)), r"100 points have 0 edges"),
    "points at the scanner": (lambda world: np.zeros((100, 3)), r"100 points have 0 edges"),
    "a cloud far away": (lambda world: world.points + FAR, r"\d+ points have \d+ edges as seen from sensor_origin"),
}


@pytest.mark.parametrize("case", NOTHING)
def test_clouds_without_edges_are_refused(few: None, worlds: list[World], case: str) -> None:
    cloud, said = NOTHING[case]
    frame = rp.Frame(image=worlds[0].photo, points=cloud(worlds[0]))
    with pytest.raises(rp.PoseError, match=rf"no pose was found: {said}.*; needed photos and dense clouds"):
        rp.calibrate(CAMERA, [frame], prior=KNOWN)


def test_a_photo_of_one_pixel_is_refused(few: None, worlds: list[World]) -> None:
    camera = rp.PinholeCamera(3.0, 3.0, 0.0, 0.0, width=1, height=1)
    frame = rp.Frame(image=np.zeros((1, 1), dtype=np.uint8), points=worlds[0].points)
    with pytest.raises(rp.PoseError, match="none of which a photo shows"):
        rp.calibrate(camera, [frame], prior=KNOWN)


def test_tiny_photos_are_not_trusted(few: None, worlds: list[World]) -> None:
    camera = rp.PinholeCamera(6.0, 6.0, 3.5, 2.5, width=8, height=6)
    photo = np.arange(48, dtype=np.uint8).reshape(6, 8)
    try:
        calibration = rp.calibrate(camera, [rp.Frame(image=photo, points=worlds[0].points)], prior=KNOWN)
    except rp.PoseError:
        return
    assert calibration.confidence < 0.98 and codes(calibration)


WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "a place of two numbers": ({"sensor_origin": [0.0, 0.0]}, r"sensor_origin has shape \(2,\); needed \(3,\)"),
    "a place that is not finite": ({"sensor_origin": [0.0, 0.0, np.nan]}, "sensor_origin is .*nan.*; needed finite"),
    "a place in words": ({"sensor_origin": "here"}, "sensor_origin has type .*; needed real numbers"),
    "a prior in words": ({"prior": "near"}, "prior is a str; needed a Prior or None"),
    "a solver in words": ({"solver": "fast"}, "solver is a str; needed a Solver"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_arguments_are_named(worlds: list[World], case: str) -> None:
    given, message = WRONG[case]
    with pytest.raises(ValueError, match=message):
        rp.calibrate(CAMERA, [worlds[0].frame()], **given)


def test_wrong_frames_are_named(worlds: list[World]) -> None:
    world = worlds[0]
    with pytest.raises(ValueError, match="frames is empty; needed at least one photo and cloud"):
        rp.calibrate(CAMERA, [])
    with pytest.raises(ValueError, match=r"frames\[0\] is a str; needed a Frame"):
        rp.calibrate(CAMERA, ["photo.png"])  # type: ignore[list-item]
    with pytest.raises(ValueError, match=r"points has shape \(38400, 2\); needed \(n, 3\)"):
        rp.calibrate(CAMERA, [rp.Frame(image=world.photo, points=world.points[:, :2])])
    with pytest.raises(ValueError, match="frame 1 has no image; needed image and points"):
        rp.calibrate(CAMERA, [world.frame(), rp.Frame(points=world.points)])
    with pytest.raises(ValueError, match="hall has no image and points"):
        rp.calibrate(CAMERA, [rp.Frame(name="hall")])
    with pytest.raises(ValueError, match="frame has no points"):
        rp.check_alignment(CAMERA, rp.Frame(image=world.photo), world.pose)
    with pytest.raises(ValueError, match=r"intensity has shape \(38399,\); needed \(38400,\)"):
        rp.calibrate(CAMERA, [rp.Frame(image=world.photo, points=world.points, intensity=world.intensity[1:])])
    with pytest.raises(ValueError, match=r"point 0 is .*; needed coordinates of at most"):
        rp.calibrate(CAMERA, [rp.Frame(image=world.photo, points=np.full((1, 3), 1e70))])


def test_clouds_are_looked_at_from_where_the_prior_has_the_camera(few: None, worlds: list[World]) -> None:
    far = worlds[0]._replace(points=worlds[0].points + FAR)
    near = replace(KNOWN.rebase(-FAR), up_sigma_deg=1.0)
    mounted = about_mount(worlds[0].pose.rebase(-FAR), 3.0, 0.1)
    for prior in (near, mounted):
        calibration = rp.calibrate(CAMERA, [far.frame()], prior=prior)
        assert edges_of(calibration).prior == prior and edges_of(calibration).count > 500
    assert_right(calibration, worlds[0].pose.rebase(-FAR))


def test_an_initial_pose_alone_says_where_the_camera_is(few: None, worlds: list[World]) -> None:
    known = about_mount(worlds[0].pose, 2.0, 0.1)
    calibration = rp.calibrate(CAMERA, [worlds[0].frame()], prior=known, sensor_origin=np.zeros(3))
    assert edges_of(calibration).prior.camera_near is None and edges_of(calibration).assumed == ()
    assert_right(calibration, worlds[0].pose)


def test_results_can_t_be_changed_and_can_be_copied(found: Found) -> None:
    calibration = found.calibration
    with pytest.raises(FrozenInstanceError):
        edges_of(calibration).count = 0  # type: ignore[misc]
    ways: list[Callable[[Any], Any]] = [copy.copy, copy.deepcopy, lambda value: pickle.loads(pickle.dumps(value))]
    for other in (calibration, *(way(calibration) for way in ways)):
        edges = edges_of(other)
        assert same(other, calibration) and edges.prior == KNOWN and edges.assumed == ()
        for array in (other.covariance, *(mode.covariance for mode in edges.modes)):
            with pytest.raises(ValueError, match="read-only"):
                array[0, 0] = 1.0
    assert repr(calibration).startswith(f"PoseEstimate({calibration.status.value}, confidence=")


def test_modes_keep_their_own_arrays() -> None:
    covariance = np.eye(6)
    mode = rp.solve.EdgeMode(rp.Pose.from_matrix(np.eye(4)), covariance, 1.0, 2.0, 3)
    covariance[0, 0] = 9.0
    assert mode.covariance[0, 0] == 1.0 and not mode.covariance.flags.writeable
