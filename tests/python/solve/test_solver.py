"""Drivers, systems and integrations agree; batches are the same as one by one, on any threads and in a fork."""

from __future__ import annotations

import multiprocessing
from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest
import regionpose as rp
from numpy.typing import NDArray
from regionpose.solve.batch import PoseProblem
from regionpose.solve.options import System

from benchmarks.synthetic import SyntheticScene, omnidirectional_scene, perspective_scene, pose_errors

Array = NDArray[np.float64]

DRIVERS = 1e-7
"""Rotation (rad) and translation (m): both drivers end at a relative change of 1e-12."""

SAME_MOMENTS = 1e-8
"""Boundary and mesh sums of the same moments on the plane differ by rounding."""

SPHERE_MESH = 1e-6
"""A mesh's quadrature on the sphere, its pieces small."""

SYSTEMS = 3e-4
"""Rotation (rad) and translation (m): contours and pixels see the edge of a coverage differently."""

SCENE_TIMEOUT_S = 60
"""A forked child needs a second; one that waits for a lock of its parent needs for ever."""


def problem_of(scene: SyntheticScene, coverage: bool = False) -> PoseProblem:
    """Masks and world polygons of a scene."""
    masks = scene.coverages() if coverage else scene.masks()
    images = [rp.ImageRegion.from_mask(mask) for mask in masks]
    return scene.camera, images, [rp.WorldRegion.from_polygon(rings) for rings in scene.regions]


def poses_of(estimate: rp.PoseEstimate) -> list[rp.Pose]:
    """The best pose and those that fit as well."""
    return [estimate.pose, *(alternative.pose for alternative in estimate.diagnostics.alternatives)]


def apart(a: rp.Pose, b: rp.Pose, anchor: Array) -> float:
    """Larger of the angle (rad) and the distance (m) of a world point between two poses."""
    angle = float((a.rotation * b.rotation.inv()).magnitude())
    return max(angle, float(np.linalg.norm(a.transform(anchor) - b.transform(anchor))))


@pytest.mark.parametrize("planes", [1, 3])
@pytest.mark.parametrize("seed", range(25))
def test_both_drivers_end_at_the_same_poses(seed: int, planes: int) -> None:
    """Each pose of the one, alternatives of a symmetric shape included, is a pose of the other; one of them is true."""
    scene = perspective_scene(seed, planes, world="arbitrary", study="drivers")
    problem = problem_of(scene)
    scipy, native = (rp.estimate_pose(*problem, solver=rp.Solver(driver=driver)) for driver in ("scipy", "native"))
    assert len(scipy.diagnostics.alternatives) == len(native.diagnostics.alternatives)
    for pose in poses_of(scipy):
        assert min(apart(pose, other, scene.anchor) for other in poses_of(native)) < DRIVERS
    truth = rp.Pose.from_parts(scene.rotation, scene.translation)
    assert min(apart(pose, truth, scene.anchor) for pose in poses_of(native)) < np.radians(1.0)


@pytest.mark.parametrize("seed", [3, 5])
@pytest.mark.parametrize("draw", [perspective_scene, omnidirectional_scene])
def test_systems_and_integrations_agree(draw: object, seed: int) -> None:
    scene: SyntheticScene = draw(seed, 3)  # type: ignore[operator]
    problem = problem_of(scene, coverage=True)
    plane, plane_mesh, sphere, sphere_mesh, pixels = (
        rp.estimate_pose(*problem, solver=rp.Solver(system=system, integration=integration, driver="native")).pose  # type: ignore[arg-type]
        for system, integration in (
            ("plane", "boundary"),
            ("plane", "mesh"),
            ("sphere", "boundary"),
            ("sphere", "mesh"),
            ("sphere", "pixels"),
        )
    )
    assert apart(plane, plane_mesh, scene.anchor) < SAME_MOMENTS
    assert apart(sphere, sphere_mesh, scene.anchor) < SPHERE_MESH
    assert apart(plane, sphere, scene.anchor) < SYSTEMS
    assert apart(plane, pixels, scene.anchor) < SYSTEMS


def test_a_smaller_mesh_is_nearer_to_the_boundary_on_the_sphere_and_any_is_exact_on_the_plane() -> None:
    scene = omnidirectional_scene(3, 2)
    problem = problem_of(scene, coverage=True)

    def apart_from_boundary(system: System, size: float) -> float:
        exact = rp.estimate_pose(*problem, solver=rp.Solver(system=system, driver="native")).pose
        meshed = rp.estimate_pose(
            *problem, solver=rp.Solver(system=system, integration="mesh", mesh_size=size, driver="native")
        ).pose
        return apart(exact, meshed, scene.anchor)

    coarse, middle, fine = (apart_from_boundary("sphere", size) for size in (1.0, 0.5, 0.1))
    assert coarse > 3.0 * middle > 9.0 * fine
    assert fine < SPHERE_MESH
    assert max(apart_from_boundary("plane", size) for size in (1.0, 0.1)) < SAME_MOMENTS


def test_three_planes_are_solved_within_millimeters() -> None:
    errors = []
    for seed in range(10):
        scene = perspective_scene(seed, 3, world="arbitrary")
        pose = rp.estimate_pose(*problem_of(scene), solver=rp.Solver(driver="native")).pose
        truth = scene.rotation, scene.translation
        errors.append(pose_errors(pose.rotation.as_matrix(), pose.translation, *truth, scene.anchor))
    assert np.median([error.rotation_deg for error in errors]) < 0.01
    assert np.median([error.translation_m for error in errors]) < 5e-4


@pytest.fixture(scope="module")
def batch() -> list[PoseProblem]:
    return [problem_of(perspective_scene(seed, 1 + 2 * (seed % 2), world="arbitrary")) for seed in range(6)]


def solved(problems: Iterable[PoseProblem], threads: int | None = None) -> list[rp.PoseEstimate]:
    """The batch's estimates, all of which are there."""
    found = rp.estimate_poses(problems, threads=threads)
    estimates = [estimate for estimate in found if isinstance(estimate, rp.PoseEstimate)]
    assert len(estimates) == len(found)
    return estimates


def assert_same(a: rp.PoseEstimate, b: rp.PoseEstimate) -> None:
    """Equal to the last bit."""
    assert np.array_equal(a.pose.matrix, b.pose.matrix)
    assert np.array_equal(a.covariance, b.covariance)
    assert (
        a.diagnostics.overlap_error == b.diagnostics.overlap_error
        and a.diagnostics.evaluations == b.diagnostics.evaluations
    )
    assert len(a.diagnostics.alternatives) == len(b.diagnostics.alternatives)
    assert [str(warning) for warning in a.warnings] == [str(warning) for warning in b.warnings]


@pytest.mark.parametrize("threads", [None, 1, 2, 5])
def test_a_batch_is_the_same_as_one_by_one(batch: list[PoseProblem], threads: int | None) -> None:
    """In order, to rounding; poses that fit equally well may change places."""
    found = solved(iter(batch), threads)
    for problem, estimate in zip(batch, found, strict=True):
        alone, origin = poses_of(rp.estimate_pose(*problem, solver=rp.Solver(driver="native"))), np.zeros(3)
        assert len(alone) == len(poses_of(estimate))
        assert all(min(apart(pose, other, origin) for other in alone) < DRIVERS for pose in poses_of(estimate))


def test_the_number_of_threads_changes_nothing(batch: list[PoseProblem]) -> None:
    for a, b in zip(solved(batch, 1), solved(batch, 5), strict=True):
        assert_same(a, b)


def test_an_empty_batch_is_empty() -> None:
    assert rp.estimate_poses([]) == []


def test_a_problem_without_a_pose_leaves_the_others(batch: list[PoseProblem]) -> None:
    """One square cannot be seen 75 deg to the left and 75 deg to the right at once."""
    camera = rp.FisheyeCamera(300.0, 300.0, 500.0, 500.0)
    square = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
    sides = [np.array([500.0 + 300.0 * np.radians(angle), 500.0]) for angle in (-75.0, 75.0)]
    images = [rp.ImageRegion.from_polygon(center + 40.0 * (square[:, :2] - 0.5)) for center in sides]
    blind: PoseProblem = camera, images, [rp.WorldRegion.from_polygon(square)] * 2
    before, error, after = rp.estimate_poses([batch[0], blind, batch[1]])
    assert isinstance(error, rp.PoseError) and "no pose shows every world region" in str(error)
    for estimate, expected in zip([before, after], solved(batch[:2]), strict=True):
        assert isinstance(estimate, rp.PoseEstimate)
        assert_same(estimate, expected)
    for driver in ("scipy", "native"):
        with pytest.raises(rp.PoseError, match="no pose shows every world region"):
            rp.estimate_pose(*blind, solver=rp.Solver(driver=driver))


def test_problems_that_are_refused_leave_the_others(batch: list[PoseProblem]) -> None:
    """Whatever is wrong with a problem stands in its place, and the others are solved as without it."""
    camera, images, worlds = batch[1]
    narrow = rp.FisheyeCamera(100.0, 100.0, 500.0, 500.0)
    beyond = rp.ImageRegion.from_polygon(np.array([[900.0, 500.0], [990.0, 500.0], [950.0, 560.0]]))
    small = rp.ImageRegion.from_mask(np.pad(np.ones((20, 20), dtype=np.bool_), 30))
    sized = rp.PinholeCamera(300.0, 300.0, 159.5, 119.5, width=320, height=240)
    refused: dict[str, Any] = {
        "3 observed and 2 world": (camera, images, worlds[:2]),
        "image region 0": (narrow, [beyond], worlds[:1]),
        "mask of image region 0: found 80 x 80 pixels": (sized, [small], worlds[:1]),
        "region 0 is a NoneType; needed a ImageRegion": (camera, [None], worlds[:1]),
        "region 1 is a str; needed a WorldRegion": (camera, images[:2], [worlds[0], "wall"]),
        "found a NoneType; needed a list of WorldRegions": (camera, images, None),
        "camera is a NoneType": (None, images, worlds),
        "0": (camera, [], []),
    }
    found = rp.estimate_poses([batch[0], *refused.values(), batch[2]])
    for error, needed in zip(found[1:-1], refused, strict=True):
        assert isinstance(error, rp.PoseError) and needed in str(error)
    for estimate, expected in zip([found[0], found[-1]], solved([batch[0], batch[2]]), strict=True):
        assert isinstance(estimate, rp.PoseEstimate)
        assert_same(estimate, expected)


def test_the_error_names_what_is_no_problem(batch: list[PoseProblem]) -> None:
    camera, images, _ = batch[1]
    with pytest.raises(ValueError, match="problem 1: found 2 items; needed"):
        rp.estimate_poses([batch[0], (camera, images)])  # type: ignore[list-item]
    with pytest.raises(ValueError, match="threads is 0; it needs to be at least 1"):
        rp.estimate_poses(batch[:1], threads=0)


def solve_in_child(problem: PoseProblem) -> Array:
    """The batch's answer in another process."""
    return solved([problem], 2)[0].pose.matrix


def test_a_forked_child_solves_after_its_parent(batch: list[PoseProblem]) -> None:
    expected = [estimate.pose.matrix for estimate in solved(batch[:2], 2)]
    with multiprocessing.get_context("fork").Pool(2) as pool:
        found = pool.map_async(solve_in_child, batch[:2]).get(SCENE_TIMEOUT_S)
    assert all(np.array_equal(a, b) for a, b in zip(found, expected, strict=True))


def test_the_calibrations_errors_are_what_they_add_to_a_covariance() -> None:
    problem, solver = problem_of(omnidirectional_scene(3, 3)), rp.Solver(driver="native")
    known = rp.Solver(driver="native", focal_sigma_percent=0.0, center_sigma_px=0.0)
    ordinary, exact = (rp.estimate_pose(*problem[:3], solver=each) for each in (solver, known))
    added = solver.calibration_covariance(ordinary.diagnostics.focal_shift, ordinary.diagnostics.pixel_angle_rad)
    assert np.allclose(ordinary.covariance - exact.covariance, added, rtol=1e-9, atol=1e-15)
    # The camera has 504 px in a radian about its axis.
    assert 1 / 600 < ordinary.diagnostics.pixel_angle_rad < 1 / 500
