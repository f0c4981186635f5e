"""Regions of a scan: what its beams know of places inside and outside, and the poses that follow."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
import regionpose as rp
import shapely
from numpy.typing import NDArray
from regionpose import _core
from regionpose.solve.core_inputs import observed_regions

from benchmarks.synthetic.lidar import LidarScan, SpinningLidar, lidar_scan
from benchmarks.synthetic.masks import project_region
from benchmarks.synthetic.planar import PlaneFrame
from benchmarks.synthetic.setups import perspective_setup
from benchmarks.synthetic.studies.conditions import Condition, Scan
from benchmarks.synthetic.studies.problems import draw_problem

Array = NDArray[np.float64]

# A board of 2 x 1.4 m, 6 m before a scanner at the origin that turns about the y axis.
BOARD = np.array([[-1.0, -0.7, 6.0], [1.0, -0.7, 6.2], [1.0, 0.7, 6.2], [-1.0, 0.7, 6.0]])


def board_scan(rings: Array = BOARD, noise: float = 0.0, beams: int = 64) -> LidarScan:
    lidar = SpinningLidar(beams=beams, range_noise_m=noise)
    return lidar_scan([[rings]], np.zeros(3), np.random.default_rng(1), lidar)


def board_region(scan: LidarScan, **options: object) -> rp.WorldRegion:
    members = np.flatnonzero(scan.regions == 0)
    return rp.WorldRegion.from_scan(scan.points, members, **options)  # type: ignore[arg-type]


def inside_board(places: Array) -> NDArray[np.bool_]:
    frame = PlaneFrame.of_region([BOARD])
    flat = frame.flat(places)
    within: NDArray[np.bool_] = shapely.contains_xy(frame.polygon([BOARD]), flat[:, 0], flat[:, 1])
    return within


def test_beams_that_passed_the_plane_are_outside() -> None:
    samples = board_region(board_scan(), sensor_origin=[0, 0, 0]).samples
    assert samples is not None
    inside, outside = samples
    assert len(inside) > 50
    assert len(outside) > 50
    assert inside_board(inside).all()
    assert not inside_board(outside).any()
    frame = PlaneFrame.of_region([BOARD])
    heights = np.concatenate(samples) @ np.cross(*frame.axes.T) - frame.origin @ np.cross(*frame.axes.T)
    assert np.abs(heights).max() < 1e-9


def test_range_noise_moves_no_sample_across_the_edge() -> None:
    samples = board_region(board_scan(noise=0.02), sensor_origin=[0, 0, 0]).samples
    assert samples is not None
    assert inside_board(samples[0]).all()
    assert not inside_board(samples[1]).any()


def test_a_beam_that_ended_before_the_plane_says_nothing() -> None:
    scan = board_scan()
    # A post beside the board, and before its plane, where beams went by before.
    beside = (scan.regions < 0) & (np.abs(scan.points[:, 0] / scan.points[:, 2] - 0.2) < 0.02)
    beside &= scan.points[:, 2] > 0.0
    scan.points[beside] *= 3.0 / scan.points[beside, 2:]
    samples = board_region(scan, sensor_origin=[0, 0, 0]).samples
    assert samples is not None
    assert not (np.abs(samples[1][:, 0] / samples[1][:, 2] - 0.2) < 0.019).any()


def wall_scan() -> tuple[Array, NDArray[np.intp]]:
    """A wall of 4 x 3 m in steps of 5 cm, of which 2 x 1.5 m in the middle are the members."""
    x, y = np.meshgrid(np.arange(-2.0, 2.0, 0.05), np.arange(-1.5, 1.5, 0.05))
    points = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 5.0)])
    return points, np.flatnonzero(in_middle(points))


def in_middle(places: Array) -> NDArray[np.bool_]:
    middle: NDArray[np.bool_] = np.abs(places[:, :2] / [1.01, 0.76]).max(axis=1) < 1.0
    return middle


def test_returns_on_the_plane_are_outside_unless_the_region_extends() -> None:
    points, members = wall_scan()
    samples = rp.WorldRegion.from_scan(points, members).samples
    assert samples is not None
    assert in_middle(samples[0]).all()
    assert not in_middle(samples[1]).any()
    assert rp.WorldRegion.from_scan(points, members, extends=True).samples is None


def test_without_the_scanner_an_outline_knows_more_than_neighbors_on_one_side() -> None:
    points, members = wall_scan()
    beside = in_middle(points) | (points[:, 0] > 0.5)
    kept = points[beside]
    region = rp.WorldRegion.from_scan(kept, np.flatnonzero(in_middle(kept)))
    assert region.samples is None
    assert region.area == pytest.approx(rp.WorldRegion.from_points(points[members]).area)


def test_a_gap_ends_what_extends() -> None:
    points, members = wall_scan()
    gap = (points[:, 0] > 1.01) & (points[:, 0] < 1.5)
    apart = points[~gap & (np.abs(points[:, 1]) < 0.76)]
    kept = np.flatnonzero(in_middle(apart))
    samples = rp.WorldRegion.from_scan(apart, kept, sensor_origin=[0, 0, 0], extends=True).samples
    assert len(members) == len(kept)
    assert samples is not None
    assert (samples[1][:, 0] >= 1.49).all()


def test_a_patch_alone_is_its_outline() -> None:
    points, members = wall_scan()
    region = rp.WorldRegion.from_scan(points[members], np.arange(len(members)))
    assert region.samples is None
    assert region.area == pytest.approx(rp.WorldRegion.from_points(points[members]).area)


@pytest.mark.slow
def test_many_samples_leave_those_at_the_edges() -> None:
    x, y = np.meshgrid(np.arange(-2.0, 2.0, 0.005), np.arange(-1.5, 1.5, 0.005))
    points = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 5.0)])
    samples = rp.WorldRegion.from_scan(points, np.flatnonzero(points[:, 0] < 0.001)).samples
    assert samples is not None
    assert len(np.concatenate(samples)) <= 1000
    near = np.abs(np.concatenate(samples)[:, 0]) < 0.01
    assert near.sum() > 100


def test_what_a_region_encloses_counts_where_its_image_has_a_hole() -> None:
    x, y = np.meshgrid(np.arange(-2.0, 2.0, 0.05), np.arange(-1.5, 1.5, 0.05))
    wall = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 5.0)])
    window = (np.abs(wall[:, :2] / [0.31, 0.41]).max(axis=1) < 1.0) & in_middle(wall)
    wall[window] *= 1.2
    samples = rp.WorldRegion.from_scan(wall, np.flatnonzero(in_middle(wall) & ~window), sensor_origin=[0, 0, 0]).samples
    camera = rp.PinholeCamera(800.0, 800.0, 500.0, 400.0)
    outline = np.array([[-1.0, -0.75, 5.0], [1.0, -0.75, 5.0], [1.0, 0.75, 5.0], [-1.0, 0.75, 5.0]])
    assert samples is not None
    region = rp.WorldRegion.from_samples(*samples)
    assert region.core.samples is not None
    inside, outside, enclosed = region.core.samples
    assert in_middle(enclosed).all() and not in_middle(outside).any()
    assert len(enclosed) > 20 and len(samples[0]) == len(inside)
    # The same places to the last bit: which of a row along a side are heard depends on rounding.
    cores = [region.core.with_samples(inside, outside, within) for within in (enclosed, enclosed[:0])]
    image = rp.ImageRegion.from_polygon(camera.project(outline))
    with_them, alone = (rp.estimate_pose(camera, [image], [rp.WorldRegion(core, ())]) for core in cores)
    apart = alone.pose.local_coordinates(with_them.pose)
    assert apart @ np.linalg.solve(alone.covariance, apart) < 0.01**2
    np.testing.assert_allclose(np.diag(with_them.covariance), np.diag(alone.covariance), rtol=1e-2)


def test_samples_survive_pickling_and_viewpoints() -> None:
    region = board_region(board_scan(), sensor_origin=[0, 0, 0]).with_viewpoint([0, 0, 0])
    again = pickle.loads(pickle.dumps(region))
    assert region.samples is not None
    for given, kept in zip(region.samples, again.samples, strict=True):
        np.testing.assert_allclose(kept, given, atol=1e-12)
    assert "samples" in repr(region)


def test_from_samples_takes_what_is_known() -> None:
    scan = board_scan()
    known = board_region(scan, sensor_origin=[0, 0, 0]).samples
    assert known is not None
    region = rp.WorldRegion.from_samples(*known)
    assert region.samples is not None
    for given, kept in zip(known, region.samples, strict=True):
        np.testing.assert_allclose(kept, given, atol=1e-9)


def test_wrong_input_is_named() -> None:
    points, members = wall_scan()
    with pytest.raises(ValueError, match=r"member 0 is 99999; needed an index from 0 to 4799"):
        rp.WorldRegion.from_scan(points, [99999, 1, 2])
    with pytest.raises(ValueError, match=r"members has shape \(2, 2\) and type int64; needed indices \(k,\)"):
        rp.WorldRegion.from_scan(points, [[0, 1], [2, 3]])
    with pytest.raises(ValueError, match=r"points has shape \(4800, 2\); needed \(n, 3\)"):
        rp.WorldRegion.from_scan(points[:, :2], members)
    with pytest.raises(ValueError, match=r"sensor_origin is \[0, 0\]; needed 3 coordinates of at most"):
        rp.WorldRegion.from_scan(points, members, sensor_origin=[0, 0])
    with pytest.raises(ValueError, match="outside has shape"):
        rp.WorldRegion.from_samples(points[members], np.empty((0, 3)))
    with pytest.raises(ValueError, match="an outside sample is number 0"):
        rp.WorldRegion.from_samples(points[members], [[0.0, 0.0, 9.0]])


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::regionpose.regions.outline.SparseSamplingWarning")
@pytest.mark.parametrize("beams", [32, 64])
def test_samples_give_a_better_pose_than_the_outline(beams: int) -> None:
    errors: dict[Scan, list[float]] = {"outline": [], "samples": []}
    for scan, found in errors.items():
        for seed in range(4):
            condition = Condition(planes=3, templates="asymmetric", lidar_beams=beams, range_noise_m=0.01, scan=scan)
            problem = draw_problem(perspective_setup(), condition, seed)
            estimate = rp.estimate_pose(problem.camera, problem.image_regions, problem.world_regions)
            turn = estimate.pose.rotation.as_matrix() @ problem.scene.rotation.T
            found.append(float(np.degrees(np.arccos(np.clip((np.trace(turn) - 1.0) / 2.0, -1.0, 1.0)))))
    assert np.median(errors["samples"]) < 0.5 * np.median(errors["outline"])


def test_batches_use_samples_too() -> None:
    condition = Condition(planes=3, templates="asymmetric", lidar_beams=32, range_noise_m=0.01, scan="samples")
    problem = draw_problem(perspective_setup(), condition, 0)
    sides = (problem.camera, problem.image_regions, problem.world_regions)
    alone = rp.estimate_pose(*sides, solver=rp.Solver(driver="native"))
    (together,) = rp.estimate_poses([sides])
    assert isinstance(together, rp.PoseEstimate)
    np.testing.assert_allclose(together.pose.translation, alone.pose.translation, atol=1e-12)
    assert alone.diagnostics.termination == "posterior_mean"


@pytest.mark.parametrize("seed", [0, 2])
def test_what_a_scanner_did_not_see_counts_as_half_wrong(seed: int) -> None:
    """The upper parts of three regions lie above the scanner's view; all labels agree with the pose."""
    drawn = Condition(
        planes=3, templates="asymmetric", lidar_beams=64, range_noise_m=0.01, scan="samples", cut="scanner"
    )
    problem = draw_problem(perspective_setup(), drawn, seed)
    observed = observed_regions(problem.camera, problem.image_regions, "boundary")
    worlds = [world.core for world in problem.world_regions]
    estimate = _core.Problem(observed, worlds, system="plane", integration="boundary").estimate()
    assert estimate is not None and estimate.outlier_fraction == 0.0
    rotation, translation = estimate.best.rotation, estimate.best.translation
    unseen = []
    for image, world in zip(problem.image_regions, problem.world_regions, strict=True):
        projected = project_region(problem.camera, rotation, translation, world.rings, 0.1)
        whole, seen = (shapely.Polygon(rings[0], rings[1:]).buffer(0) for rings in (image.rings, projected))
        unseen.append(whole.difference(seen).area / whole.area)
    assert max(unseen) > 0.3
    assert estimate.evidence[1] == pytest.approx(0.5 * np.mean(unseen), rel=0.05)
