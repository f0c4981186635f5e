"""A pose doesn't depend on how its problem is written down: order, direction, place, unit and handedness."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
import pytest
import regionpose as rp
from numpy.typing import NDArray

from benchmarks.synthetic import perspective_scene
from benchmarks.synthetic.masks import binary_mask

Array = NDArray[np.float64]
Rings = list[Array]

EXACT = 1e-9
"""Rotation (rad) and place of the camera over its distance, on exact data."""

SHARE = 0.01
"""Of a standard deviation, on noisy data."""

FAR = np.array([1e6, -7e5, 3e5])
"""How far the world is moved, meters: a 1e-9 of the distance is then the last digit of its coordinates."""

ROUNDING = 8 * np.finfo(float).eps
"""Of coordinates of the world, relative, in the camera's place."""


class Given(NamedTuple):
    """A problem by its numbers: rings of each region in pixels and meters, and what leads its pose back."""

    camera: rp.PinholeCamera
    image: list[Rings]
    world: list[Rings]
    back: Callable[[Array], Array]


def of_scene(seed: int, planes: int, *, noisy: bool) -> Given:
    """A scene of the benchmark with its exact outlines, or those of its masks, each in one piece."""
    scene = perspective_scene(seed, planes, study="invariance")
    assert isinstance(scene.camera, rp.PinholeCamera)
    image = [[np.array(ring) for ring in rings] for rings in scene.image_rings]
    if noisy:
        camera = scene.camera
        assert camera.width is not None and camera.height is not None
        masks = [binary_mask(rings, camera.width, camera.height) for rings in image]
        image = [[np.array(ring) for ring in rp.ImageRegion.from_mask(mask).rings] for mask in masks]
    return Given(scene.camera, image, [list(rings) for rings in scene.regions], lambda matrix: matrix)


def permuted(given: Given) -> Given:
    return given._replace(image=given.image[::-1], world=given.world[::-1])


def turned_rings(given: Given) -> Given:
    """Rings that begin elsewhere and turn the other way."""

    def turned(regions: list[Rings], by: int) -> list[Rings]:
        return [[np.roll(ring, by, axis=0)[::-1] for ring in rings] for rings in regions]

    return given._replace(image=turned(given.image, 3), world=turned(given.world, 1))


def moved(given: Given) -> Given:
    def back(matrix: Array) -> Array:
        shifted = matrix.copy()
        shifted[:3, 3] += matrix[:3, :3] @ FAR
        return shifted

    return given._replace(world=[[ring + FAR for ring in rings] for rings in given.world], back=back)


def scaled(given: Given) -> Given:
    def back(matrix: Array) -> Array:
        return np.block([[matrix[:3, :3], matrix[:3, 3:] / 1000.0], [matrix[3:]]])

    return given._replace(world=[[1000.0 * ring for ring in rings] for rings in given.world], back=back)


def mirrored(given: Given) -> Given:
    """Image and world in a mirror, the camera's center with them."""
    camera, mirror = given.camera, np.diag([-1.0, 1.0, 1.0, 1.0])
    assert camera.width is not None
    last = camera.width - 1.0
    other = rp.PinholeCamera(
        camera.fx, camera.fy, last - camera.cx, camera.cy, width=camera.width, height=camera.height
    )
    image = [[np.array([last, 0.0]) + ring * [-1.0, 1.0] for ring in rings] for rings in given.image]
    world = [[ring * [-1.0, 1.0, 1.0] for ring in rings] for rings in given.world]
    return Given(other, image, world, lambda matrix: mirror @ matrix @ mirror)


CHANGES = (permuted, turned_rings, moved, scaled, mirrored)


def solved(given: Given) -> rp.PoseEstimate:
    images = [rp.ImageRegion.from_polygon(rings) for rings in given.image]
    worlds = [rp.WorldRegion.from_polygon(rings) for rings in given.world]
    return rp.estimate_pose(given.camera, images, worlds, solver=rp.Solver(driver="native"))


def codes(estimate: rp.PoseEstimate) -> list[str]:
    return sorted(warning.code for warning in estimate.warnings)


def answers(given: Given, estimate: rp.PoseEstimate) -> Iterator[rp.Pose]:
    """All poses, led back to the original problem; poses of a symmetric shape come in any order."""
    for pose in (estimate.pose, *(other.pose for other in estimate.diagnostics.alternatives)):
        matrix = given.back(pose.matrix)
        yield rp.Pose.from_parts(matrix[:3, :3], matrix[:3, 3])


def apart(a: rp.Pose, b: rp.Pose) -> Array:
    """The left increment from one to the other, (6,), with the way of the camera in its axes."""
    turn = a.rotation * b.rotation.inv()
    return np.concatenate([turn.as_rotvec(), a.translation - turn.apply(np.array(b.translation))])


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize(("seed", "planes"), [(1, 1), (2, 1), (3, 2), (4, 3), (5, 3)])
def test_exact_data_give_the_same_pose(change: Callable[[Given], Given], seed: int, planes: int) -> None:
    given = of_scene(seed, planes, noisy=False)
    other = change(given)
    first, second = solved(given), solved(other)
    assert codes(first) == codes(second)
    ways = [apart(pose, first.pose) for pose in answers(other, second)]
    way = min(ways, key=np.linalg.norm)
    distance = np.linalg.norm(first.pose.translation)
    rounding = ROUNDING * np.abs(other.world[0][0]).max() / (1000.0 if change is scaled else 1.0)
    assert np.linalg.norm(way[:3]) < EXACT
    assert np.linalg.norm(way[3:]) < EXACT * distance + rounding


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize(("seed", "planes"), [(12, 2), (13, 3), (15, 1), (16, 1), (18, 2)])
def test_noisy_data_give_the_same_pose_within_a_hundredth_of_its_sigma(
    change: Callable[[Given], Given], seed: int, planes: int
) -> None:
    given = of_scene(seed, planes, noisy=True)
    other = change(given)
    first, second = solved(given), solved(other)
    assert codes(first) == codes(second)
    root = np.linalg.cholesky(first.covariance)
    sigmas = [np.linalg.norm(np.linalg.solve(root, apart(pose, first.pose))) for pose in answers(other, second)]
    assert min(sigmas) < SHARE
