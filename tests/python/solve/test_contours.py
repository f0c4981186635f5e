"""Distances of observed contours from projected outlines, and how they scatter."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import regionpose as rp
import shapely
from numpy.typing import NDArray
from regionpose import _core
from regionpose.cameras import Camera
from regionpose.solve.contours import (
    BEND_TOLERANCE_PX,
    STRETCH,
    Contours,
    contours_of,
    correlation_length,
    distances_of,
    neighbor_scatter,
)
from regionpose.solve.intrinsics import PARAMETERS, CameraPart, ContourProblem
from rig_frames import RIG, fisheye_frames, perspective_frames, sides, world_of
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]

EXACT_PX = 1e-9
"""Distances by shapely and by formula, pixels: rounding of coordinates up to 2000."""

SLOPE = 1e-6
"""Relative error of central differences of the distances."""

ALL: tuple[CameraPart, ...] = ("focal", "center", "distortion")


def bent_scene() -> tuple[rp.FisheyeCamera, rp.Pose, Contours]:
    """Contours of a fisheye scene with a distortion."""
    camera, frames = fisheye_frames(3, 1)
    bent = replace(camera, distortion=(-0.03, 0.01, 0.0, 0.0))
    return bent, RIG, contours_of(bent, *sides(frames), RIG)


def test_distances_are_those_from_the_projected_outline() -> None:
    """Compared with shapely's distance between a point and the outline's edges."""
    camera, pose, contours = bent_scene()
    distances = distances_of(camera, contours, pose)
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
        distances = distances_of(camera, contours_of(camera, [image], [world_of(square)], identity), identity)
        assert distances is not None
        signed.append(float(np.median(distances.values)))
    assert np.sort(signed) == pytest.approx([-10.0, 10.0])


@pytest.mark.parametrize("draw", [perspective_frames, fisheye_frames])
def test_derivatives_agree_with_central_differences_of_the_distances(
    draw: Callable[[int, int], tuple[Camera, list[rp.Frame]]],
) -> None:
    camera, frames = draw(2, 1)
    if isinstance(camera, rp.PinholeCamera):
        camera = replace(camera, distortion=(0.1, -0.05, 0.0, 0.0))
    names = tuple(name for part in ALL for name in PARAMETERS[part])
    problem = ContourProblem(camera, RIG, contours_of(camera, *sides(frames), RIG), names)
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
    contours = contours_of(camera, [image], [world], identity)
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
    vertices = contours_of(camera, [image], [world_of(square)], identity).vertices
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
