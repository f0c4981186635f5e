"""Beams of a scan that gave no return: which they are, and what regions before the sky become by them."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import regionpose as rp
from numpy.typing import NDArray
from regionpose.scene.estimate import estimate_scene
from regionpose.scene.loading import load_scene
from scene_files import write_scene
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from benchmarks.synthetic.lidar import LidarScan, SpinningLidar, lidar_scan

Array = NDArray[np.float64]

LIDAR = SpinningLidar(beams=64, azimuth_step_deg=0.4)
GRID = (64, 900)
STEP = np.radians(0.4)
SHAPE = np.array([[0.0, 0.0], [1.6, 0.0], [1.6, 0.6], [0.7, 0.6], [0.7, 1.7], [0.0, 1.7]])
CAMERA = rp.PinholeCamera(700.0, 700.0, 479.5, 319.5, width=960, height=640)
AHEAD = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
POSE = rp.Pose.from_parts(
    Rotation.from_euler("xyz", [3.0, -5.0, 2.0], degrees=True).as_matrix() @ AHEAD, [0.1, 0.3, 0.2]
)


@cache
def boards() -> list[Array]:
    """Three L-shaped boards before a scanner at the origin, turned apart and tilted, x ahead and z up."""
    turns = [[12.0, -20.0, 35.0], [-8.0, 25.0, -30.0], [30.0, 15.0, 10.0]]
    places = [[7.0, 2.2, 0.2], [6.0, -1.3, -0.4], [8.0, 0.4, 1.6]]
    upright = np.column_stack([np.zeros(6), SHAPE - SHAPE.mean(axis=0)])
    rotations = Rotation.from_euler("xyz", turns, degrees=True)
    return [rotation.apply(upright) + place for rotation, place in zip(rotations, places, strict=True)]


@cache
def whole() -> LidarScan:
    """All returns, ring by ring; -1 of a backdrop 30 m away."""
    return lidar_scan([[board] for board in boards()], np.zeros(3), np.random.default_rng(2), LIDAR, up=(0.0, 0.0, 1.0))


def before_the_sky(ground: bool) -> NDArray[np.intp]:
    """Indices of the boards' returns, and with the ground of what lies low behind them."""
    scan = whole()
    kept: NDArray[np.intp] = np.flatnonzero((scan.regions >= 0) | (ground & (scan.points[:, 2] < -3.0)))
    return kept


def estimated(kept: NDArray[np.intp], absent: Array | None) -> rp.PoseEstimate:
    points, labels = whole().points[kept], whole().regions[kept]
    worlds = [
        rp.WorldRegion.from_scan(points, np.flatnonzero(labels == board), sensor_origin=[0, 0, 0], absent_beams=absent)
        for board in range(3)
    ]
    images = [rp.ImageRegion.from_polygon(CAMERA.project(POSE.transform(board))) for board in boards()]
    return rp.estimate_pose(CAMERA, images, worlds)


def errors(pose: rp.Pose) -> tuple[float, float]:
    """Degrees, and meters between the camera's places."""
    turn = np.degrees((pose.rotation * POSE.rotation.inv()).magnitude())
    return float(turn), float(np.linalg.norm(pose.camera_center - POSE.camera_center))


def farthest(beams: Array, kept: NDArray[np.intp]) -> float:
    """The largest angle from beams (k, 3) to the nearest beam of the scan that isn't kept, rad."""
    others = np.delete(whole().points, kept, axis=0)
    ways = others / np.linalg.norm(others, axis=1, keepdims=True)
    return float(np.max(cKDTree(ways).query(beams)[0]))


@pytest.mark.parametrize("transposed", [False, True])
def test_cells_of_an_organized_scan_without_a_point_are_beams(transposed: bool) -> None:
    kept = before_the_sky(ground=False)
    row, column = np.divmod(kept, GRID[1])
    shape, cells = (GRID[::-1], column * GRID[0] + row) if transposed else (GRID, kept)
    beams = rp.regions.absent_beams(whole().points[kept], [0, 0, 0], grid_shape=shape, grid_indices=cells)
    assert len(beams) == GRID[0] * GRID[1] - len(kept)
    np.testing.assert_allclose(np.linalg.norm(beams, axis=1), 1.0)
    assert farthest(beams, kept) < 0.1 * STEP


@pytest.mark.parametrize("numbered", [False, True])
def test_rings_lack_beams_between_their_returns(numbered: bool) -> None:
    kept = before_the_sky(ground=True)
    options: dict[str, Any] = {"rings": kept // GRID[1]} if numbered else {}
    beams = rp.regions.absent_beams(whole().points[kept], [0, 0, 0], **options)
    # Rings that saw nothing but the sky say nothing, the others almost all.
    seen = np.unique(kept // GRID[1])
    lacking = len(seen) * GRID[1] - len(kept)
    assert 0.8 * lacking < len(beams) <= lacking
    # Across a gap at which a turn ends, a beam lies between its ring and the next.
    assert farthest(beams, kept) < 1.1 * STEP


def test_scanners_may_be_tilted_where_they_have_a_grid() -> None:
    kept, turn = before_the_sky(ground=False), Rotation.from_euler("xyz", [20.0, -30.0, 70.0], degrees=True)
    beams = rp.regions.absent_beams(turn.apply(whole().points[kept]), [0, 0, 0], grid_shape=GRID, grid_indices=kept)
    assert len(beams) == GRID[0] * GRID[1] - len(kept)
    assert farthest(turn.inv().apply(beams), kept) < 0.1 * STEP


def test_what_is_in_no_order_lacks_no_beam() -> None:
    kept = np.random.default_rng(0).permutation(before_the_sky(ground=True))
    assert len(rp.regions.absent_beams(whole().points[kept], [0, 0, 0])) == 0
    # A depth camera's rows are no rings.
    x, y = np.meshgrid(np.linspace(-0.5, 0.5, 64), np.linspace(-0.4, 0.4, 48))
    ways = np.stack([x.ravel(), y.ravel(), np.ones(x.size)], axis=1)
    seen = np.delete(np.arange(x.size), np.arange(1000, 1100))
    depths = 2.0 * ways[seen]
    assert len(rp.regions.absent_beams(depths, [0, 0, 0], grid_shape=(48, 64), grid_indices=seen)) == 0
    assert len(rp.regions.absent_beams([[1.0, 0.0, 0.0]], [0, 0, 0])) == 0
    assert len(rp.regions.absent_beams(whole().points, [0, 0, 0])) == 0, "of a scan that lacks none"


@pytest.mark.parametrize("ground", [False, True])
def test_boards_before_the_sky_are_known_by_beams_without_a_return(ground: bool) -> None:
    kept = before_the_sky(ground)
    points = whole().points[kept]
    options: dict[str, Any] = {} if ground else {"grid_shape": GRID, "grid_indices": kept}
    estimate = estimated(kept, rp.regions.absent_beams(points, [0, 0, 0], **options))
    turn, shift = errors(estimate.pose)
    # With all that lies behind them: 0.14 deg, 19 mm.
    assert turn < 0.2 and shift < 0.03


@pytest.mark.parametrize("ground", [False, True])
def test_where_beams_cannot_be_told_the_outline_counts(ground: bool) -> None:
    estimate = estimated(before_the_sky(ground), None)
    turn, shift = errors(estimate.pose)
    assert (turn < 0.5 and shift < 0.06) or "weak-geometry" in {warning.code for warning in estimate.warnings}
    way = estimate.pose.local_coordinates(POSE)
    assert way @ np.linalg.solve(estimate.covariance, way) < 22.5, "as of 999 of 1000 poses"


def test_a_surface_too_far_for_a_return_is_not_passed() -> None:
    """A floor that goes on: what it would send back from farther away than its farthest returns came."""
    from regionpose.regions.absent_beams import absent_places, scan_reach
    from regionpose.regions.plane_samples import plane_samples

    ways = LIDAR.directions((0.0, 0.0, 1.0), 0.0)
    down = ways[ways[:, 2] < -0.01]
    floor = down * (-1.5 / down[:, 2:])
    near = np.linalg.norm(floor, axis=1) < 12.0
    plane = plane_samples(floor[near], [0, 0, 0])
    places = absent_places(down[~near], floor[near], scan_reach(floor[near], np.zeros(3)), plane, np.zeros(3))
    assert len(places) == 0 and (~near).sum() > 1000
    # A wall of the scan sends returns from 60 m, as this floor would from where it is met as steeply.
    bright = absent_places(down[~near], floor[near], 60.0, plane, np.zeros(3))
    ranges = np.linalg.norm(plane.origin + bright @ plane.axes[:2], axis=1)
    assert len(bright) > 0 and ranges.max() < (1.5 * 60.0**2) ** (1 / 3) + 0.01


def test_a_scene_counts_them(tmp_path: Path) -> None:
    cells = np.zeros((GRID[0] * GRID[1], 3))
    kept = before_the_sky(ground=False)
    cells[kept] = whole().points[kept]
    np.save(tmp_path / "scan.npy", cells.reshape(*GRID, 3))
    np.save(tmp_path / "labels.npy", np.where(np.isin(np.arange(len(cells)), kept), whole().regions, -1) + 1)
    regions = [
        {
            "name": f"board{number}",
            "image": {"polygon": CAMERA.project(POSE.transform(board)).tolist()},
            "world": {"points": "labels.npy", "label": number},
        }
        for number, board in enumerate(boards(), start=1)
    ]
    camera = {"model": "pinhole", "fx": 700.0, "fy": 700.0, "cx": 479.5, "cy": 319.5, "width": 960, "height": 640}
    values = {
        "camera": camera,
        "image": "image.png",
        "cloud": "scan.npy",
        "sensor_origin": [0, 0, 0],
        "regions": regions,
    }
    path = write_scene(tmp_path, values)
    from PIL import Image

    Image.fromarray(np.full((640, 960, 3), 128, dtype=np.uint8)).save(tmp_path / "image.png")
    turn, shift = errors(estimate_scene(load_scene(path)).estimate.pose)
    assert turn < 0.2 and shift < 0.03


def test_bad_beams_are_refused() -> None:
    points = whole().points[:100]
    with pytest.raises(ValueError, match=r"rings has shape \(3,\)"):
        rp.regions.absent_beams(points, [0, 0, 0], rings=[1, 2, 3])
    with pytest.raises(ValueError, match=r"grid_indices has shape"):
        rp.regions.absent_beams(points, [0, 0, 0], grid_shape=(10, 10), grid_indices=[[1]])
    with pytest.raises(ValueError, match="99"):
        rp.regions.absent_beams(points, [0, 0, 0], grid_shape=(5, 5), grid_indices=np.arange(100))
    with pytest.raises(ValueError, match="absent_beams direction 1 is zero"):
        ways = np.eye(3)[:2] * [[1.0], [0.0]]
        rp.WorldRegion.from_scan(points, [0, 1, 2], sensor_origin=[0, 0, 0], absent_beams=ways)
