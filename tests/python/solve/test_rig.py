"""Rigs: one pose of many frames, the frames that disagree, and the camera refined with the pose."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import regionpose as rp
from diagnostics import between_frame_sigma_of, refinement_of, rig_of
from numpy.typing import NDArray
from regionpose import _core
from regionpose.cameras import Camera
from regionpose.solve.contours import (
    contours_of,
    distances_of,
)
from regionpose.solve.intrinsics import CameraPart, ContourProblem, refined_camera
from regionpose.solve.options import EXACT_EXPOSURE
from rig_frames import (
    RIG,
    fisheye_frames,
    frame_of,
    perspective_frames,
    sides,
    world_of,
)
from scipy.spatial.transform import Rotation

from benchmarks.synthetic import fisheye_scene, pose_errors, squares_on_mask

Array = NDArray[np.float64]
DATA = Path(__file__).parents[4] / "shared" / "data"

SIGMAS = 3.0
"""Standard deviations that an estimate may be off by."""

ALL: tuple[CameraPart, ...] = ("focal", "center", "distortion")


def moved(frame: rp.Frame, offset: Sequence[float]) -> rp.Frame:
    """The frame with its world regions moved, meters."""
    regions = [[ring + np.array(offset) for ring in region.rings] for region in frame.world_regions]
    return replace(frame, world_regions=[rp.WorldRegion.from_polygon(rings) for rings in regions])


def millimeters(pose: rp.Pose, frames: Sequence[rp.Frame]) -> float:
    """How far a pose puts the middle of all regions from where it is."""
    middle = np.mean([region.rings[0].mean(axis=0) for region in sides(frames)[1]], axis=0)
    return float(1e3 * np.linalg.norm(pose.transform(middle) - RIG.transform(middle)))


def parameters(camera: rp.PinholeCamera | rp.FisheyeCamera, names: Sequence[str]) -> Array:
    """The named parameters of a camera."""
    k = (*camera.distortion, 0.0, 0.0)
    values = {"fx": camera.fx, "fy": camera.fy, "cx": camera.cx, "cy": camera.cy, "k1": k[0], "k2": k[1]}
    return np.array([values[name] for name in names])


def codes(rig: rp.PoseEstimate) -> list[str]:
    """Codes of the warnings that a rig adds."""
    return [warning.code for warning in rig.warnings if warning.code in ("outlier-frame", "unobservable-intrinsics")]


def test_the_pose_of_a_rig_is_that_of_all_its_regions() -> None:
    camera, frames = fisheye_frames(0, 3)
    rig = rp.estimate_rig(camera, frames)
    joint = rp.estimate_pose(camera, *sides(frames), solver=rp.Solver(driver="native"))
    apart = joint.pose.local_coordinates(rig.pose)
    assert apart @ np.linalg.solve(joint.covariance, apart) < 6.0
    areas = np.array(
        [sum(_core.spherical_moments(r.bearings(camera), 0).ravel()) for f in frames for r in f.image_regions]
    )
    by_frame = areas.reshape(3, 2).sum(axis=1)
    assert np.average([fit.overlap_error for fit in rig_of(rig).frames], weights=by_frame) == pytest.approx(
        rig.diagnostics.overlap_error
    )
    assert rig.diagnostics.overlap_error == pytest.approx(joint.diagnostics.overlap_error, rel=0.2)
    assert rig_of(rig).camera is camera and rig_of(rig).refinement is None and codes(rig) == []
    assert [fit.name for fit in rig_of(rig).frames] == ["frame 0", "frame 1", "frame 2"]
    assert all(0.05 < fit.residual_px < 0.3 for fit in rig_of(rig).frames)


def test_the_pose_without_a_frame_is_that_of_the_others() -> None:
    camera, frames = perspective_frames(0, 3)
    rig = rp.estimate_rig(camera, frames)
    one = rig_of(rig).leave_one_out[1]
    others = rp.estimate_pose(
        camera, *sides([frames[0], frames[2]]), prior=rp.Prior(initial=rig.pose), solver=rp.Solver(driver="native")
    )
    assert np.array_equal(one.pose.matrix, others.pose.matrix)
    pose, joint = one.pose, rig.pose
    errors = pose_errors(
        joint.rotation.as_matrix(), joint.translation, pose.rotation.as_matrix(), pose.translation, np.zeros(3)
    )
    assert one.rotation_deg == pytest.approx(errors.rotation_deg)
    assert 0.3 < one.residual_px / one.expected_px < 3.0


def test_one_frame_has_no_influence() -> None:
    camera, frames = fisheye_frames(0, 1)
    rig = rp.estimate_rig(camera, frames)
    assert rig_of(rig).leave_one_out == () and rig_of(rig).between_frame_sigma is None
    alone = rp.estimate_pose(camera, *sides(frames), solver=rp.Solver(driver="native"))
    assert np.array_equal(rig.pose.matrix, alone.pose.matrix) and np.array_equal(rig.covariance, alone.covariance)


def test_errors_of_whole_frames_are_allowed_for() -> None:
    """Frames 2 mm off in directions of their own, where masks hold them to a few tenths."""
    camera, frames = fisheye_frames(0, 4)
    ways = 2e-3 * np.array([[1.0, -1.0, 0.0], [-1.0, 0.0, 1.0], [0.0, 1.0, -1.0], [1.0, 1.0, 0.5]])
    off = [moved(frame, way) for frame, way in zip(frames, ways, strict=True)]
    calm, rig = rp.estimate_rig(camera, frames), rp.estimate_rig(camera, off)
    joint = rp.estimate_pose(camera, *sides(off), solver=rp.Solver(driver="native", **EXACT_EXPOSURE))
    assert between_frame_sigma_of(calm).center_sigma_m < 3e-4
    assert 1e-3 < between_frame_sigma_of(rig).center_sigma_m < 4e-3
    assert rig.confidence <= joint.confidence + 1e-12
    squared = [
        pose.local_coordinates(RIG) @ np.linalg.solve(held, pose.local_coordinates(RIG)) / 6.0
        for pose, held in ((joint.pose, joint.covariance), (rig.pose, rig.covariance))
    ]
    assert squared[1] < 1.5 < squared[0]


@pytest.mark.slow
@pytest.mark.parametrize("draw", [perspective_frames, fisheye_frames])
@pytest.mark.parametrize("count", [3, 4])
def test_true_poses_of_rigs_are_where_the_covariance_says(
    draw: Callable[[int, int], tuple[Camera, list[rp.Frame]]], count: int
) -> None:
    """The squared distances of 16 rigs have the mean of six numbers, or less: what frames are off by is taken for a
    little though there is nothing. The poses are no worse than those of all regions in one problem.
    """
    squared, errors = [], []
    for seed in range(16):
        camera, frames = draw(seed, count)
        rig = rp.estimate_rig(camera, frames)
        joint = rp.estimate_pose(camera, *sides(frames), solver=rp.Solver(driver="native"))
        away = rig.pose.local_coordinates(RIG)
        squared.append(away @ np.linalg.solve(rig.covariance, away))
        errors.append(
            [
                [np.linalg.norm(pose.local_coordinates(RIG)[:3]), np.linalg.norm(pose.local_coordinates(RIG)[3:])]
                for pose in (rig.pose, joint.pose)
            ]
        )
    assert 0.5 < np.mean(squared) < 9.0
    own, all_at_once = np.sqrt(np.mean(np.square(errors), axis=0))
    assert (own < 1.1 * all_at_once).all()


@pytest.mark.parametrize("wrong", [0, 3])
@pytest.mark.parametrize("draw", [perspective_frames, fisheye_frames])
def test_a_frame_whose_world_was_moved_is_named(
    draw: Callable[[int, int], tuple[Camera, list[rp.Frame]]], wrong: int
) -> None:
    camera, frames = draw(0, 4)
    assert codes(rp.estimate_rig(camera, frames)) == []
    frames[wrong] = replace(moved(frames[wrong], (0.03, 0.0, 0.0)), name="the moved one")
    rig = rp.estimate_rig(camera, frames)
    assert codes(rig) == ["outlier-frame"]
    assert "the moved one disagrees" in str(rig.warnings[-1])
    assert rig_of(rig).leave_one_out[wrong].is_outlier
    assert millimeters(rig_of(rig).leave_one_out[wrong].pose, frames) < 1.0


def test_two_moved_frames_of_six_are_named_and_of_two_frames_both() -> None:
    camera, frames = fisheye_frames(0, 6)
    frames[1], frames[4] = moved(frames[1], (0.05, 0.0, 0.0)), moved(frames[4], (0.0, 0.0, 0.05))
    rig = rp.estimate_rig(camera, frames)
    named = {warning.values["name"] for warning in rig.warnings if warning.code == "outlier-frame"}
    assert named == {"frame 1", "frame 4"}
    assert codes(rp.estimate_rig(camera, frames[:2])) == ["outlier-frame"] * 2


@pytest.mark.parametrize(("draw", "first"), [(perspective_frames, 20), (fisheye_frames, 0)])
def test_two_moved_frames_of_four_do_not_hide_one_another(
    draw: Callable[[int, int], tuple[Camera, list[rp.Frame]]], first: int
) -> None:
    """However far they are moved: what the others scatter by is no measure of what is to be expected."""
    camera, frames = draw(first, 4)
    for distance in (0.05, 0.2):
        off = [moved(frames[0], (distance, 0.0, 0.0)), frames[1], moved(frames[2], (0.0, 0.0, distance)), frames[3]]
        rig = rp.estimate_rig(camera, off)
        named = {warning.values["name"] for warning in rig.warnings if warning.code == "outlier-frame"}
        assert named == {"frame 0", "frame 2"}


def told(rig: rp.PoseEstimate) -> list[tuple[int, ...]]:
    return [warning.regions for warning in rig.warnings if warning.code == "outlier-frame"]


def test_the_wrong_region_of_a_frame_that_disagrees_is_named() -> None:
    camera, frames = fisheye_frames(0, 4)
    wrong = moved(frames[2], (0.05, 0.0, 0.0)).world_regions[0]
    frames[2] = replace(frames[2], world_regions=[wrong, frames[2].world_regions[1]], name="the third")
    rig = rp.estimate_rig(camera, frames)
    assert told(rig) == [(4,)]
    assert "(face 4)" in rig.warnings[-1].text_with([f"face {index}" for index in range(8)])


def test_a_frame_all_of_whose_regions_disagree_is_named_alone() -> None:
    camera, frames = fisheye_frames(0, 4)
    frames[2] = moved(frames[2], (0.05, 0.0, 0.0))
    assert told(rp.estimate_rig(camera, frames)) == [()]


def test_a_contour_that_is_not_in_view_lies_no_infinite_number_of_pixels_off() -> None:
    camera, frames = perspective_frames(0, 4)
    behind = [rp.WorldRegion.from_polygon([-ring for ring in region.rings]) for region in frames[1].world_regions]
    rig = rp.estimate_rig(camera, [frames[0], replace(frames[1], world_regions=behind), *frames[2:]])
    warning = next(warning for warning in rig.warnings if warning.code == "outlier-frame")
    assert rig_of(rig).leave_one_out[1].residual_px == np.inf
    assert all(np.isfinite(value) for value in warning.values.values() if not isinstance(value, str))
    assert "inf" not in warning.text.split()


@pytest.mark.parametrize("first", [0, 2])
def test_a_wrong_focal_length_and_center_are_recovered(first: int) -> None:
    """One per cent and 5 px put the scene 5 cm off; the refined camera's pose is within millimeters."""
    camera, frames = perspective_frames(first, 4)
    given = replace(camera, fx=1.01 * camera.fx, fy=1.01 * camera.fy, cx=camera.cx + 5.0, cy=camera.cy - 5.0)
    rig = rp.estimate_rig(given, frames, refine_camera=("focal", "center"))
    found = rig_of(rig).refinement
    assert found is not None and found.outcome == "refined" and codes(rig) == []
    assert found.parameters == ("fx", "fy", "cx", "cy")
    assert (np.abs(found.found - parameters(camera, found.parameters)) < SIGMAS * found.sigma).all()
    refined = rig_of(rig).camera
    assert isinstance(refined, rp.PinholeCamera)
    assert parameters(refined, found.parameters) == pytest.approx(found.found)
    assert parameters(given, found.parameters) == pytest.approx(found.given)
    assert millimeters(rp.estimate_rig(given, frames).pose, frames) > 30.0
    assert millimeters(rig.pose, frames) < 3.0
    assert millimeters(found.pose, frames) < 3.0


def test_a_fisheye_s_distortion_is_recovered_on_disturbed_contours() -> None:
    """A fortieth of each region's area is changed by squares along its boundary."""
    rng = np.random.default_rng(7)
    scenes = [fisheye_scene(seed, 2, study="rig") for seed in range(3)]
    frames = [frame_of(scene, lambda mask: squares_on_mask(mask, 0.025, rng)) for scene in scenes]
    camera = scenes[0].camera
    assert isinstance(camera, rp.FisheyeCamera)
    given = replace(camera, fx=1.01 * camera.fx, cx=camera.cx - 5.0, distortion=(0.02, -0.01, 0.0, 0.0))
    rig = rp.estimate_rig(given, frames, refine_camera=("distortion", "center", "focal"))
    found = rig_of(rig).refinement
    assert found is not None and found.outcome == "refined"
    assert found.parameters == ("fx", "fy", "cx", "cy", "k1", "k2")
    assert (np.abs(found.found - parameters(camera, found.parameters)) < SIGMAS * found.sigma).all()
    assert millimeters(rig.pose, frames) < 0.2 * millimeters(rp.estimate_rig(given, frames).pose, frames)


@pytest.mark.parametrize("draw", [perspective_frames, fisheye_frames])
def test_a_right_camera_is_confirmed_and_nothing_changes(
    draw: Callable[[int, int], tuple[Camera, list[rp.Frame]]],
) -> None:
    camera, frames = draw(0, 4)
    plain, rig = rp.estimate_rig(camera, frames), rp.estimate_rig(camera, frames, refine_camera=ALL)
    assert refinement_of(rig).outcome == "confirmed"
    assert rig_of(rig).camera is camera and codes(rig) == []
    assert np.array_equal(rig.pose.matrix, plain.pose.matrix)
    assert refinement_of(rig).residual_px[1] <= 1.05 * refinement_of(rig).residual_px[0]


def test_a_frontal_plane_determines_no_camera() -> None:
    """Nearer and wider look alike, and so do aside and a moved center."""
    shape = np.array([[-1.0, -0.6, 4.0], [1.2, -0.8, 4.0], [0.9, 0.7, 4.0], [0.1, 0.2, 4.0], [-0.7, 0.9, 4.0]])
    camera = rp.PinholeCamera(800.0, 800.0, 400.0, 300.0, width=800, height=600)
    frame = rp.Frame([rp.ImageRegion.from_polygon(camera.project(shape))], [world_of(shape)], "wall")
    given = replace(camera, fx=808.0, fy=808.0)
    rig = rp.estimate_rig(given, [frame], refine_camera=("focal", "center"))
    assert refinement_of(rig).outcome == "weak"
    assert refinement_of(rig).weak == ("fx", "fy", "cx", "cy")
    assert rig_of(rig).camera is given
    assert codes(rig) == ["unobservable-intrinsics"]
    assert str(rig.warnings[-1].values["parameters"]).startswith("fx (standard deviation ")
    assert np.array_equal(rig.pose.matrix, rp.estimate_rig(given, [frame]).pose.matrix)


def test_an_outline_out_of_view_leaves_the_camera_and_says_so() -> None:
    """Beside the fold of the distortion the observed part is visible, the projected outline isn't wholly."""
    camera = rp.PinholeCamera(500.0, 500.0, 300.0, 300.0, distortion=(-0.3, 0.0, 0.0, 0.0))
    square = np.array([[0.2, 0.2, 1.0], [2.0, 0.2, 1.0], [2.0, 0.9, 1.0], [0.2, 0.9, 1.0]])
    image = rp.ImageRegion.from_polygon(camera.project(square * [0.3, 0.5, 1.0]))
    identity = rp.Pose(Rotation.identity(), np.zeros(3))
    contours = contours_of(camera, [image], [world_of(square)], identity)
    assert distances_of(camera, contours, identity) is None
    found = refined_camera(camera, identity, contours, ("focal",))
    assert found.outcome == "weak" and found.weak == ("fx", "fy") and found.camera is camera
    assert found.found == pytest.approx(found.given)


def test_a_camera_that_folds_before_the_contour_is_not_taken() -> None:
    """The pieces lie 0.64 off the axis; with k1 = -1 the distorted radius reaches 0.38 only."""
    triangle = np.array([[-0.6, -0.2, 1.0], [0.6, -0.1, 1.0], [0.1, 0.5, 1.0]])
    camera = rp.PinholeCamera(500.0, 500.0, 300.0, 300.0)
    identity = rp.Pose(Rotation.identity(), np.zeros(3))
    image = rp.ImageRegion.from_polygon(camera.project(triangle))
    problem = ContourProblem(
        camera, identity, contours_of(camera, [image], [world_of(triangle)], identity), ("k1", "k2")
    )
    sure = 1e-12 * np.eye(8)
    assert problem.refinement(np.array([0.0] * 6 + [-1.0, 0.0]), sure, (1.0, 0.1)).outcome == "weak"
    taken = problem.refinement(np.array([0.0] * 6 + [0.1, 0.0]), sure, (1.0, 0.1))
    assert taken.outcome == "refined" and taken.camera.distortion == (0.1, 0.0, 0.0, 0.0)  # type: ignore[attr-defined]


def test_a_disc_alone_leaves_a_direction_free_and_names_nobody() -> None:
    """The pose without the other frame may turn about the disc's axis, so it contradicts nothing."""
    camera, frames = perspective_frames(0, 1)
    angle = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
    disc = np.column_stack([0.4 + 0.5 * np.cos(angle), 0.5 * np.sin(angle) - 0.3, np.full(720, 5.0)])
    image = rp.ImageRegion.from_polygon(camera.project(disc))
    rig = rp.estimate_rig(camera, [*frames, rp.Frame([image], [world_of(RIG.inverse().transform(disc))], "disc")])
    assert codes(rig) == []
    assert rig_of(rig).leave_one_out[0].expected_px > 10.0 * rig_of(rig).leave_one_out[1].expected_px
    error = rig.pose.local_coordinates(RIG)
    assert error @ np.linalg.solve(rig.covariance, error) < SIGMAS**2 * 6.0


def test_polygons_without_error_have_a_pose_and_a_covariance() -> None:
    camera, frames = perspective_frames(0, 3)
    exact = [
        replace(
            frame,
            image_regions=[
                rp.ImageRegion.from_polygon([camera.project(RIG.transform(ring)) for ring in region.rings])
                for region in frame.world_regions
            ],
        )
        for frame in frames
    ]
    rig = rp.estimate_rig(camera, exact)
    assert np.abs(rig.pose.local_coordinates(RIG)).max() < 1e-6
    assert np.isfinite(rig.covariance).all()


def test_a_frame_at_another_place_does_not_move_the_pose() -> None:
    """Its regions are turned by 20 degrees about the camera: alone they put it there."""
    camera, frames = fisheye_frames(0, 3)
    turn = Rotation.from_rotvec([0.0, np.radians(20.0), 0.0])
    center = RIG.inverse().translation
    worlds = [
        rp.WorldRegion.from_polygon([turn.apply(ring - center) + center for ring in region.rings])
        for region in frames[2].world_regions
    ]
    rig = rp.estimate_rig(camera, [*frames[:2], replace(frames[2], world_regions=worlds)])
    assert codes(rig) == ["outlier-frame"]
    assert np.degrees((rig.pose.rotation * RIG.rotation.inv()).magnitude()) < 0.02
    assert between_frame_sigma_of(rig).rotation_sigma_deg < 0.01


def test_a_vertex_on_the_rim_of_the_view_has_no_derivative() -> None:
    camera = rp.PinholeCamera(500.0, 500.0, 300.0, 300.0, distortion=(-0.3, 0.0, 0.0, 0.0))
    rim = float(np.tan(camera.max_angle)) * (1.0 - 1e-9)
    triangle = np.array([[rim, 0.0, 1.0], [0.1, 0.5, 1.0], [0.1, 0.0, 1.0]])
    identity = rp.Pose(Rotation.identity(), np.zeros(3))
    image = rp.ImageRegion.from_polygon(camera.project(triangle))
    contours = contours_of(camera, [image], [world_of(triangle)], identity)
    problem = ContourProblem(camera, identity, contours)
    assert problem.distances(np.zeros(6)) is not None
    assert np.isfinite(problem.jacobian(np.zeros(6))).all()


@pytest.mark.parametrize(
    ("frames", "options", "message"),
    [
        (lambda good: 3, {}, "frames is a int; needed a list"),
        (lambda good: [], {}, "frames is empty"),
        (lambda good: [good, 5], {}, r"frames\[1\] is a int; needed a Frame"),
        (lambda good: [good, (good.image_regions, [])], {}, r"frames\[1\] is a tuple; needed a Frame"),
        (lambda good: [good, rp.Frame(good.image_regions)], {}, "frame 1 has 2 image regions and 0 world regions"),
        (
            lambda good: [good, rp.Frame(name="wall")],
            {},
            "wall has 0 image regions and 0 world regions; needed at least",
        ),
        (lambda good: [rp.Frame(good.world_regions, good.image_regions)], {}, r"image_regions\[0\] is a WorldRegion"),
        (lambda good: [replace(good, name="a"), replace(good, name="a")], {}, "two frames are named 'a'"),
        (lambda good: [good], {"refine_camera": "focal"}, r"needed a sequence, as \(\"focal\",\)"),
        (lambda good: [good], {"refine_camera": ("zoom",)}, "refine_camera holds 'zoom'; needed some of 'focal'"),
        (lambda good: [good], {"refine_camera": ("focal", "focal")}, "needed each part once"),
    ],
)
def test_bad_input_is_named(frames: Callable[[rp.Frame], object], options: dict[str, object], message: str) -> None:
    camera, good = fisheye_frames(0, 1)
    with pytest.raises(ValueError, match=message):
        rp.estimate_rig(camera, frames(good[0]), **options)  # type: ignore[arg-type]


def test_other_cameras_are_not_refined() -> None:
    _, frames = fisheye_frames(0, 1)
    camera = rp.cameras.UnifiedCamera(750.0, 750.0, 1187.5, 791.5, xi=0.5)
    with pytest.raises(
        ValueError, match="camera is a UnifiedCamera; a PinholeCamera or a FisheyeCamera can be refined"
    ):
        rp.estimate_rig(camera, frames, refine_camera=("focal",))
    with pytest.raises(ValueError, match="camera is a str; needed a Camera"):
        rp.estimate_rig("camera", frames)  # type: ignore[arg-type]


def test_what_is_known_beforehand_is_said_where_the_frames_contradict_it() -> None:
    camera, frames = fisheye_frames(0, 2)
    turn = Rotation.from_euler("y", 40.0, degrees=True)
    wrong = rp.Pose(turn * RIG.rotation, RIG.translation)
    told = rp.Prior(
        initial=wrong, initial_rotation_sigma_deg=3.0, initial_center_sigma_m=0.1, up=[0.0, 0.0, 1.0], up_sigma_deg=0.01
    )
    rig = rp.estimate_rig(camera, frames, prior=told)
    conflicts = {"initial-pose-conflict", "up-direction-conflict"}
    assert {warning.code for warning in rig.warnings} == conflicts and millimeters(rig.pose, frames) < 5.0
    known = rp.estimate_rig(
        camera, frames, prior=rp.Prior(initial=RIG, initial_rotation_sigma_deg=3.0, initial_center_sigma_m=0.1)
    )
    assert not known.warnings
    elsewhere = rp.Prior(camera_near=RIG.camera_center + np.array([9.0, 0.0, 0.0]), camera_near_sigma_m=0.5)
    far = rp.estimate_rig(camera, frames, prior=elsewhere)
    assert [warning.code for warning in far.warnings] == ["camera-position-conflict"]
    assert millimeters(far.pose, frames) < 5.0
    assert not rp.estimate_rig(camera, frames, prior=rp.Prior(camera_near=RIG.camera_center)).warnings


def test_six_boards_of_a_real_rig_agree_and_leave_the_camera_alone() -> None:
    """Against calib.json, good for half a degree and 3 cm; the lidar's own errors are no camera's."""
    folders = sorted(path.parent for path in DATA.glob("acfr_fisheye/*/regions.json"))
    if not folders:
        pytest.skip("the shared boards are not here")
    calibration = json.loads((folders[0] / "calib.json").read_text())
    camera = rp.FisheyeCamera.from_matrix(calibration["K"], distortion=calibration["D"])
    rig = rp.estimate_rig(camera, [board(folder) for folder in folders], refine_camera=ALL)
    assert rig_of(rig).camera is camera and codes(rig) == ["unobservable-intrinsics"]
    turn = rig.pose.rotation * Rotation.from_matrix(calibration["R"]).inv()
    assert np.degrees(turn.magnitude()) < 1.0
    assert np.linalg.norm(rig.pose.translation - calibration["t"]) < 0.04


def board(folder: Path) -> rp.Frame:
    """The board of a folder: its polygon in the image and its rectangle in the cloud."""
    regions = json.loads((folder / "regions.json").read_text())
    return rp.Frame(
        [rp.ImageRegion.from_polygon(region["image_polygon"]) for region in regions],
        [rp.WorldRegion.from_polygon(region["rectangle3d"]) for region in regions],
        folder.name,
    )


def test_a_region_without_an_edge_of_its_own_is_named_with_its_frame() -> None:
    camera, frames = fisheye_frames(0, 3)
    ring = frames[1].image_regions[1].rings[0]
    hidden = rp.ImageRegion.from_polygon(ring, hidden_edges=list(range(len(ring))))
    frames[1] = rp.Frame([frames[1].image_regions[0], hidden], frames[1].world_regions, "street")
    with pytest.raises(ValueError, match=r"^street: region 1: the share of the observed outline"):
        rp.estimate_rig(camera, frames)
