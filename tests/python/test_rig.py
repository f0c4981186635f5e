"""Rigs: one pose of many frames, the frames that disagree, and the camera refined with the pose."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import regionpose as rp
import shapely
from numpy.typing import NDArray
from regionpose import _core
from regionpose.cameras import Camera
from regionpose.estimation.contours import (
    BEND_TOLERANCE_PX,
    STRETCH,
    Contours,
    contours_of,
    correlation_length,
    distances_of,
    neighbor_scatter,
)
from regionpose.estimation.intrinsics import PARAMETERS, CameraPart, ContourProblem, refined_camera
from regionpose.evaluation import SyntheticScene, fisheye_scene, perspective_scene, pose_errors, squares_on_mask
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]
DATA = Path(__file__).parents[2].parent / "shared" / "data"

RIG = rp.Pose(Rotation.from_rotvec([0.4, -0.2, 0.1]), np.array([0.1, -0.2, 0.05]))
"""The rig's camera_from_world: any rotation and decimeters."""

SIGMAS = 3.0
"""Standard deviations that an estimate may be off by."""

EXACT_PX = 1e-9
"""Distances by shapely and by formula, pixels: rounding of coordinates up to 2000."""

SLOPE = 1e-6
"""Relative error of central differences of the distances."""

ALL: tuple[CameraPart, ...] = ("focal", "center", "distortion")


def frame_of(
    scene: SyntheticScene, disturb: Callable[[NDArray[np.bool_]], NDArray[np.bool_]] = lambda mask: mask
) -> rp.Frame:
    """The scene as a frame of the rig: its world moved to where the rig's camera sees it as the scene's does."""
    own = rp.Pose.from_parts(scene.rotation, scene.translation)
    worlds = [[RIG.inverse().transform(own.transform(ring)) for ring in rings] for rings in scene.regions]
    return rp.Frame(
        [rp.ImageRegion.from_mask(disturb(mask)) for mask in scene.masks()],
        [rp.WorldRegion.from_polygon(rings) for rings in worlds],
    )


@cache
def perspective_frame(seed: int) -> tuple[rp.PinholeCamera, rp.Frame]:
    """A frame of one region."""
    scene = perspective_scene(seed, 1, study="rig")
    assert isinstance(scene.camera, rp.PinholeCamera)
    return scene.camera, frame_of(scene)


@cache
def fisheye_frame(seed: int) -> tuple[rp.FisheyeCamera, rp.Frame]:
    """A frame of two regions."""
    scene = fisheye_scene(seed, 2, study="rig")
    assert isinstance(scene.camera, rp.FisheyeCamera)
    return scene.camera, frame_of(scene)


def perspective_frames(first: int, count: int) -> tuple[rp.PinholeCamera, list[rp.Frame]]:
    """Frames of one region each."""
    return perspective_frame(first)[0], [perspective_frame(seed)[1] for seed in range(first, first + count)]


def fisheye_frames(first: int, count: int) -> tuple[rp.FisheyeCamera, list[rp.Frame]]:
    """Frames of two regions each."""
    return fisheye_frame(first)[0], [fisheye_frame(seed)[1] for seed in range(first, first + count)]


def moved(frame: rp.Frame, offset: Sequence[float]) -> rp.Frame:
    """The frame with its world regions moved, meters."""
    regions = [[ring + np.array(offset) for ring in region.rings] for region in frame.world_regions]
    return replace(frame, world_regions=[rp.WorldRegion.from_polygon(rings) for rings in regions])


def sides(frames: Sequence[rp.Frame]) -> tuple[list[rp.ImageRegion], list[rp.WorldRegion]]:
    """All regions, frame after frame."""
    images = [region for frame in frames for region in frame.image_regions]
    return images, [region for frame in frames for region in frame.world_regions]


def millimeters(pose: rp.Pose, frames: Sequence[rp.Frame]) -> float:
    """How far a pose puts the middle of all regions from where it is."""
    middle = np.mean([region.rings[0].mean(axis=0) for region in sides(frames)[1]], axis=0)
    return float(1e3 * np.linalg.norm(pose.transform(middle) - RIG.transform(middle)))


def parameters(camera: rp.PinholeCamera | rp.FisheyeCamera, names: Sequence[str]) -> Array:
    """The named parameters of a camera."""
    k = (*camera.distortion, 0.0, 0.0)
    values = {"fx": camera.fx, "fy": camera.fy, "cx": camera.cx, "cy": camera.cy, "k1": k[0], "k2": k[1]}
    return np.array([values[name] for name in names])


def codes(rig: rp.RigEstimate) -> list[str]:
    """Codes of the warnings that a rig adds."""
    return [warning.code for warning in rig.warnings if warning.code in ("outlier-frame", "weak-camera")]


def bent_scene() -> tuple[rp.FisheyeCamera, rp.Pose, Contours]:
    """Contours of a fisheye scene with a distortion."""
    camera, frames = fisheye_frames(3, 1)
    bent = replace(camera, distortion=(-0.03, 0.01, 0.0, 0.0))
    return bent, RIG, contours_of(bent, RIG, *sides(frames))


def test_distances_are_those_from_the_projected_outline() -> None:
    """Compared with shapely's distance between a point and the outline's edges."""
    camera, pose, contours = bent_scene()
    distances = distances_of(camera, pose, contours)
    assert distances is not None
    pixels = camera.project(pose.transform(contours.vertices))
    for pieces, vertices in contours.regions:
        ends = pixels[contours.following[vertices]]
        outline = shapely.MultiLineString(list(np.stack([pixels[vertices], ends], axis=1)))
        expected = shapely.distance(outline, shapely.points(contours.pieces[pieces]))
        assert np.abs(np.abs(distances.values[pieces]) - expected).max() < EXACT_PX


@pytest.mark.parametrize("off_px", [3.0, 30.0, 1000.0])
def test_the_nearest_edge_is_that_of_shapely_wherever_the_points_lie(off_px: float) -> None:
    """Thin, spiky rings, whose edges are often not the ones next to the nearest vertex."""
    rng = np.random.default_rng(4)
    for count in (5, 40, 400):
        angle = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
        spikes = np.column_stack([200.0 * np.cos(angle), 20.0 * np.sin(angle)]) * rng.uniform(0.5, 1.0, (count, 1))
        rings = [spikes, spikes[:4] + np.array([300.0, 40.0])]
        points = np.concatenate(rings) + off_px * rng.normal(size=(count + 4, 2))
        ends = np.concatenate([np.roll(ring, -1, axis=0) for ring in rings])
        edges = np.asarray(shapely.linestrings(np.stack([np.concatenate(rings), ends], axis=1)))
        found = shapely.distance(edges[_core.nearest_edges(rings, points)], shapely.points(points))
        least = shapely.distance(shapely.MultiLineString(list(edges)), shapely.points(points))
        assert np.abs(found - least).max() < EXACT_PX


def test_a_point_outside_is_at_a_distance_of_the_other_sign_than_one_inside() -> None:
    square = np.array([[-1.0, -1.0, 5.0], [1.0, -1.0, 5.0], [1.0, 1.0, 5.0], [-1.0, 1.0, 5.0]])
    camera = rp.PinholeCamera(500.0, 500.0, 320.0, 240.0)
    identity = rp.Pose(Rotation.identity(), np.zeros(3))
    pixels = camera.project(square)
    signed = []
    for grown in (0.9, 1.1):
        image = rp.ImageRegion.from_polygon((pixels - [320.0, 240.0]) * grown + [320.0, 240.0])
        distances = distances_of(camera, identity, contours_of(camera, identity, [image], [world_of(square)]))
        assert distances is not None
        signed.append(float(np.median(distances.values)))
    assert np.sort(signed) == pytest.approx([-10.0, 10.0])


def world_of(ring: Array) -> rp.WorldRegion:
    """The region inside one ring."""
    return rp.WorldRegion.from_polygon([ring])


@pytest.mark.parametrize("draw", [perspective_frames, fisheye_frames])
def test_derivatives_agree_with_central_differences_of_the_distances(
    draw: Callable[[int, int], tuple[Camera, list[rp.Frame]]],
) -> None:
    camera, frames = draw(2, 1)
    if isinstance(camera, rp.PinholeCamera):
        camera = replace(camera, distortion=(0.1, -0.05, 0.0, 0.0))
    names = tuple(name for part in ALL for name in PARAMETERS[part])
    problem = ContourProblem(camera, RIG, contours_of(camera, RIG, *sides(frames)), names)
    at = np.array([1e-3, -2e-3, 1e-3, 2e-3, 1e-3, -1e-3, 3e-3, -2e-3, 1e-3, 2e-3, 0.01, -0.01])
    jacobian, step = problem.jacobian(at), 1e-5
    for column, unit in enumerate(np.eye(12)):
        ahead, behind = problem.distances(at + step * unit), problem.distances(at - step * unit)
        assert ahead is not None and behind is not None
        # Where a piece changes its edge or the side of a vertex, the distance has a kink.
        smooth = (ahead.edges == behind.edges) & (np.abs(ahead.normals - behind.normals).max(axis=1) < 1e-3)
        assert smooth.mean() > 0.9
        expected = ((ahead.values - behind.values) / (2.0 * step))[smooth]
        assert np.abs(jacobian[smooth, column] - expected).max() < SLOPE * np.abs(jacobian).max()


def test_the_pieces_of_a_ring_are_its_parts_and_have_its_centroid() -> None:
    triangle = np.array([[10.0, 10.0], [190.0, 30.0], [60.0, 140.0]])
    image = rp.ImageRegion.from_polygon(triangle)
    camera = rp.PinholeCamera(500.0, 500.0, 100.0, 80.0)
    identity = rp.Pose(Rotation.identity(), np.zeros(3))
    world = world_of(camera.bearings(triangle) / camera.bearings(triangle)[:, 2:])
    contours = contours_of(camera, identity, [image], [world])
    ring = shapely.LinearRing(image.rings[0])
    assert contours.pieces.mean(axis=0) == pytest.approx(shapely.get_coordinates(ring.centroid)[0], abs=EXACT_PX)
    assert len(contours.pieces) == round(ring.length / 3.0)
    off = shapely.distance(ring, shapely.points(contours.pieces))
    assert np.sum(off > EXACT_PX) <= 3


def test_split_edges_follow_the_camera_s_curves() -> None:
    camera = rp.FisheyeCamera(500.0, 500.0, 600.0, 600.0)
    square = np.array([[-2.0, 1.0, 1.0], [2.0, 1.0, 1.0], [2.0, 3.0, 1.0], [-2.0, 3.0, 1.0]])
    identity = rp.Pose(Rotation.identity(), np.zeros(3))
    image = rp.ImageRegion.from_polygon(camera.project(square))
    vertices = contours_of(camera, identity, [image], [world_of(square)]).vertices
    share = np.linspace(0.0, 1.0, 2001)[:-1, None]
    dense = np.concatenate([a + share * (b - a) for a, b in zip(square, np.roll(square, -1, axis=0), strict=True)])
    split = shapely.LinearRing(camera.project(vertices))
    gap = shapely.distance(split, shapely.points(camera.project(dense))).max()
    assert 4 < len(vertices) < 400
    assert gap < 1.1 * BEND_TOLERANCE_PX


def test_neighbors_scatter_with_bartlett_s_weights() -> None:
    """The windows' mean is the double sum over lags with falling weights."""
    rng = np.random.default_rng(1)
    rings = [rng.normal(size=(count, 2)) for count in (100, 75)]
    expected = np.zeros((2, 2))
    for ring in rings:
        for lag in range(-STRETCH + 1, STRETCH):
            expected += (1.0 - abs(lag) / STRETCH) * ring.T @ np.roll(ring, lag, axis=0)
    assert neighbor_scatter(rings) == pytest.approx(expected)


def test_a_moving_sum_varies_over_its_length() -> None:
    noise = np.random.default_rng(2).normal(size=20000)
    assert correlation_length([np.tile([1.0, -1.0], 50)]) == 1.0
    assert correlation_length([noise]) == pytest.approx(1.0, abs=0.1)
    assert correlation_length([np.convolve(noise, np.ones(8))]) == pytest.approx(8.0, rel=0.2)


def test_the_pose_of_a_rig_is_that_of_all_its_regions() -> None:
    camera, frames = fisheye_frames(0, 3)
    rig = rp.estimate_rig(camera, frames)
    joint = rp.estimate_pose(camera, *sides(frames), solver=rp.Solver(driver="native"))
    assert np.array_equal(rig.pose.matrix, joint.pose.matrix)
    areas = np.array(
        [sum(_core.spherical_moments(r.bearings(camera), 0).ravel()) for f in frames for r in f.image_regions]
    )
    by_frame = areas.reshape(3, 2).sum(axis=1)
    assert np.average([fit.overlap_error for fit in rig.frames], weights=by_frame) == pytest.approx(joint.overlap_error)
    assert rig.camera is camera and rig.refinement is None and codes(rig) == []
    assert [fit.name for fit in rig.frames] == ["frame 0", "frame 1", "frame 2"]
    assert all(0.05 < fit.residual_px < 0.3 for fit in rig.frames)


def test_the_pose_without_a_frame_is_that_of_the_others() -> None:
    camera, frames = perspective_frames(0, 3)
    rig = rp.estimate_rig(camera, frames)
    one = rig.influence[1]
    others = rp.estimate_pose(
        camera, *sides([frames[0], frames[2]]), prior=rp.Prior(initial=rig.pose), solver=rp.Solver(driver="native")
    )
    assert np.array_equal(one.pose.matrix, others.pose.matrix)
    pose, joint = one.pose, rig.pose
    errors = pose_errors(
        joint.rotation.as_matrix(), joint.translation, pose.rotation.as_matrix(), pose.translation, np.zeros(3)
    )
    assert one.rotation_deg == pytest.approx(errors.rotation_deg)
    own = rp.estimate_pose(
        camera, *sides([frames[1]]), prior=rp.Prior(initial=rig.pose), solver=rp.Solver(driver="native")
    )
    increment = np.array([*(own.pose.rotation * pose.rotation.inv()).as_rotvec(), 0.0, 0.0, 0.0])
    increment[3:] = own.pose.translation - Rotation.from_rotvec(increment[:3]).as_matrix() @ pose.translation
    back = _core.moved_pose(pose.rotation.as_matrix(), pose.translation, increment)
    assert back[1] == pytest.approx(own.pose.translation)
    both = np.linalg.inv(one.covariance + own.covariance)
    assert one.sigmas == pytest.approx(np.sqrt(increment @ both @ increment / 6.0), rel=1e-6)
    assert 0.3 < one.residual_px / one.expected_px < 3.0


def test_one_frame_has_no_influence() -> None:
    camera, frames = fisheye_frames(0, 1)
    rig = rp.estimate_rig(camera, frames)
    assert rig.influence == () and rig.dispersion == 1.0


def test_frames_that_scatter_beyond_their_noise_widen_the_covariance_by_as_much() -> None:
    """Frames 2 mm off in directions of their own, where masks hold them to a few tenths."""
    camera, frames = fisheye_frames(0, 4)
    ways = 2e-3 * np.array([[1.0, -1.0, 0.0], [-1.0, 0.0, 1.0], [0.0, 1.0, -1.0], [1.0, 1.0, 0.5]])
    off = [moved(frame, way) for frame, way in zip(frames, ways, strict=True)]
    calm, rig = rp.estimate_rig(camera, frames), rp.estimate_rig(camera, off)
    joint = rp.estimate_pose(camera, *sides(off), solver=rp.Solver(driver="native"))
    assert calm.dispersion < 1.5 and rig.dispersion > 3.0
    assert rig.dispersion == pytest.approx(np.sqrt(np.mean([one.sigmas**2 for one in rig.influence])))
    assert np.array_equal(rig.pose.matrix, joint.pose.matrix)
    assert rig.covariance == pytest.approx(rig.dispersion**2 * joint.covariance)
    assert rig.estimate.confidence <= joint.confidence
    error = rig.pose.increment_to(RIG)
    narrow, wide = (np.sqrt(error @ np.linalg.solve(held, error) / 6.0) for held in (joint.covariance, rig.covariance))
    assert wide < 1.5 < narrow


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
    assert rig.influence[wrong].is_outlier
    assert millimeters(rig.influence[wrong].pose, frames) < 1.0


def test_two_moved_frames_of_six_are_named_and_of_two_frames_both() -> None:
    camera, frames = fisheye_frames(0, 6)
    frames[1], frames[4] = moved(frames[1], (0.05, 0.0, 0.0)), moved(frames[4], (0.0, 0.0, 0.05))
    rig = rp.estimate_rig(camera, frames)
    named = [warning.message.split(" disagrees")[0] for warning in rig.warnings if warning.code == "outlier-frame"]
    assert sorted(named) == ["frame 1", "frame 4"]
    assert codes(rp.estimate_rig(camera, frames[:2])) == ["outlier-frame"] * 2


@pytest.mark.parametrize("first", [0, 2])
def test_a_wrong_focal_length_and_center_are_recovered(first: int) -> None:
    """One per cent and 5 px put the scene 5 cm off; the refined camera's pose is within millimeters."""
    camera, frames = perspective_frames(first, 4)
    given = replace(camera, fx=1.01 * camera.fx, fy=1.01 * camera.fy, cx=camera.cx + 5.0, cy=camera.cy - 5.0)
    rig = rp.estimate_rig(given, frames, refine_camera=("focal", "center"))
    found = rig.refinement
    assert found is not None and found.outcome == "refined" and codes(rig) == []
    assert found.parameters == ("fx", "fy", "cx", "cy")
    assert (np.abs(found.found - parameters(camera, found.parameters)) < SIGMAS * found.sigma).all()
    assert isinstance(rig.camera, rp.PinholeCamera)
    assert parameters(rig.camera, found.parameters) == pytest.approx(found.found)
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
    found = rig.refinement
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
    assert rig.refinement is not None and rig.refinement.outcome == "confirmed"
    assert rig.camera is camera and codes(rig) == []
    assert np.array_equal(rig.pose.matrix, plain.pose.matrix)
    assert rig.refinement.residual_px[1] <= 1.05 * rig.refinement.residual_px[0]


def test_a_frontal_plane_determines_no_camera() -> None:
    """Nearer and wider look alike, and so do aside and a moved center."""
    shape = np.array([[-1.0, -0.6, 4.0], [1.2, -0.8, 4.0], [0.9, 0.7, 4.0], [0.1, 0.2, 4.0], [-0.7, 0.9, 4.0]])
    camera = rp.PinholeCamera(800.0, 800.0, 400.0, 300.0, width=800, height=600)
    frame = rp.Frame([rp.ImageRegion.from_polygon(camera.project(shape))], [world_of(shape)], "wall")
    given = replace(camera, fx=808.0, fy=808.0)
    rig = rp.estimate_rig(given, [frame], refine_camera=("focal", "center"))
    assert rig.refinement is not None and rig.refinement.outcome == "weak"
    assert rig.refinement.weak == ("fx", "fy", "cx", "cy")
    assert rig.camera is given
    assert codes(rig) == ["weak-camera"]
    assert rig.warnings[-1].message.startswith("the regions don't determine fx (standard deviation ")
    assert np.array_equal(rig.pose.matrix, rp.estimate_rig(given, [frame]).pose.matrix)


def test_an_outline_out_of_view_leaves_the_camera_and_says_so() -> None:
    """Beside the fold of the distortion the observed part is visible, the projected outline isn't wholly."""
    camera = rp.PinholeCamera(500.0, 500.0, 300.0, 300.0, distortion=(-0.3, 0.0, 0.0, 0.0))
    square = np.array([[0.2, 0.2, 1.0], [2.0, 0.2, 1.0], [2.0, 0.9, 1.0], [0.2, 0.9, 1.0]])
    image = rp.ImageRegion.from_polygon(camera.project(square * [0.3, 0.5, 1.0]))
    identity = rp.Pose(Rotation.identity(), np.zeros(3))
    contours = contours_of(camera, identity, [image], [world_of(square)])
    assert distances_of(camera, identity, contours) is None
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
        camera, identity, contours_of(camera, identity, [image], [world_of(triangle)]), ("k1", "k2")
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
    assert rig.influence[0].expected_px > 10.0 * rig.influence[1].expected_px
    assert np.isfinite(rig.influence[0].sigmas)


def test_a_vertex_on_the_rim_of_the_view_has_no_derivative() -> None:
    camera = rp.PinholeCamera(500.0, 500.0, 300.0, 300.0, distortion=(-0.3, 0.0, 0.0, 0.0))
    rim = float(np.tan(camera.max_angle)) * (1.0 - 1e-9)
    triangle = np.array([[rim, 0.0, 1.0], [0.1, 0.5, 1.0], [0.1, 0.0, 1.0]])
    identity = rp.Pose(Rotation.identity(), np.zeros(3))
    image = rp.ImageRegion.from_polygon(camera.project(triangle))
    contours = contours_of(camera, identity, [image], [world_of(triangle)])
    problem = ContourProblem(camera, identity, contours)
    assert problem.distances(np.zeros(6)) is not None
    assert np.isfinite(problem.jacobian(np.zeros(6))).all()


@pytest.mark.parametrize(
    ("frames", "options", "message"),
    [
        (lambda good: 3, {}, "frames is a int; needed a list"),
        (lambda good: [], {}, "frames is empty"),
        (lambda good: [good, 5], {}, "frame 1 is a int; needed a Frame or a pair"),
        (lambda good: [good, (good.image_regions, [])], {}, "frame 1 has 2 image regions and 0 world regions"),
        (lambda good: [(good.world_regions, good.image_regions)], {}, "frame 0: region 0 is a WorldRegion"),
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
    camera = rp.UnifiedCamera(750.0, 750.0, 1187.5, 791.5, xi=0.5)
    with pytest.raises(
        ValueError, match="camera is a UnifiedCamera; a PinholeCamera or a FisheyeCamera can be refined"
    ):
        rp.estimate_rig(camera, frames, refine_camera=("focal",))
    with pytest.raises(ValueError, match="camera is a str; needed one of the regionpose cameras"):
        rp.estimate_rig("camera", frames)  # type: ignore[arg-type]


def test_what_is_known_beforehand_is_said_where_the_frames_contradict_it() -> None:
    camera, frames = fisheye_frames(0, 2)
    turn = Rotation.from_euler("y", 40.0, degrees=True)
    wrong = rp.Pose(turn * RIG.rotation, RIG.translation)
    told = rp.Prior(
        initial=wrong, initial_rotation_sigma_deg=3.0, initial_center_sigma_m=0.1, up=[0.0, 0.0, 1.0], up_sigma_deg=0.01
    )
    rig = rp.estimate_rig(camera, frames, prior=told)
    contradicted = {"initial-contradicted", "up-contradicted"}
    assert {warning.code for warning in rig.warnings} == contradicted and millimeters(rig.pose, frames) < 5.0
    known = rp.estimate_rig(
        camera, frames, prior=rp.Prior(initial=RIG, initial_rotation_sigma_deg=3.0, initial_center_sigma_m=0.1)
    )
    assert not known.warnings
    elsewhere = rp.Prior(camera_near=RIG.camera_center + np.array([9.0, 0.0, 0.0]), camera_near_sigma_m=0.5)
    far = rp.estimate_rig(camera, frames, prior=elsewhere)
    assert {warning.code for warning in far.warnings} == {"place-contradicted"} and millimeters(far.pose, frames) < 5.0
    assert not rp.estimate_rig(camera, frames, prior=rp.Prior(camera_near=RIG.camera_center)).warnings


def test_six_boards_of_a_real_rig_agree_and_leave_the_camera_alone() -> None:
    """Against calib.json, good for half a degree and 3 cm; the lidar's own errors are no camera's."""
    folders = sorted(path.parent for path in DATA.glob("acfr_fisheye/*/regions.json"))
    if not folders:
        pytest.skip("the shared boards are not here")
    calibration = json.loads((folders[0] / "calib.json").read_text())
    camera = rp.FisheyeCamera.from_matrix(calibration["K"], distortion=calibration["D"])
    rig = rp.estimate_rig(camera, [board(folder) for folder in folders], refine_camera=ALL)
    assert rig.camera is camera and codes(rig) == ["weak-camera"]
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
