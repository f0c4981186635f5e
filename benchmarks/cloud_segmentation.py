"""Growing of patches, and the outlines of scanned patches with and without the correction for sparse sampling.

Synthetic: a region 4 to 6 m off, as a scanner beside the camera samples it, before a wall 1 m behind. Seeds are the
median of the region's points. Areas and overlaps of outlines are taken in the plane; poses come from exact coverage
masks, an ambiguous shape's nearest answer counts, and errors of the position are taken at the region.
Real: the labeled faces of the scenes below --data, where there are any; boards are 0.61 m x 0.85 m.

    python -m benchmarks.cloud_segmentation [--scenes 100] [--data ../shared/data]
"""

from __future__ import annotations

import argparse
import json
import warnings
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import regionpose as rp
import shapely
from numpy.typing import NDArray
from regionpose.regions.outline import SparseSamplingWarning

from benchmarks.real_scenes import DEFAULT_DATA, camera_of, cloud_of
from benchmarks.synthetic import SpinningLidar, SyntheticScene, lidar_points, perspective_scene
from benchmarks.synthetic.measures import rotation_error, translation_error
from benchmarks.synthetic.planar import PlaneFrame

Array = NDArray[np.float64]

Indices = NDArray[np.intp]

LIDARS = {
    "64 rings": SpinningLidar(64, -13.4, 13.4, 0.17, 0.02),
    "16 rings, 2 deg": SpinningLidar(16, -15.0, 15.0, 0.2, 0.01),
    "dense": SpinningLidar(200, -20.0, 20.0, 0.2, 0.003),
}
WALL_BEHIND_M = 1.0
WALL_HALF_WIDTH_M = 2.0
LEAST_POINTS = 20
BOARD_M = (0.61, 0.85)


class Overlap(NamedTuple):
    """Agreement of two sets of points."""

    iou: float
    precision: float
    recall: float


def overlap_of_points(found: Indices, true: Indices) -> Overlap:
    """IoU, precision and recall of found indices."""
    both = len(np.intersect1d(found, true))
    return Overlap(both / len(np.union1d(found, true)), both / max(1, len(found)), both / len(true))


def overlap_of_outlines(region: rp.WorldRegion, rings: list[Array]) -> tuple[float, float]:
    """IoU with the true rings, in the true plane, and the relative error of the area."""
    frame = PlaneFrame.of_region(rings)
    true = frame.polygon(rings)
    flat = [frame.flat(ring) for ring in region.rings]
    found = shapely.make_valid(shapely.Polygon(flat[0], flat[1:]))
    return true.intersection(found).area / true.union(found).area, found.area / true.area - 1.0


def scan(scene: SyntheticScene, lidar: SpinningLidar, rng: np.random.Generator) -> tuple[Array, int]:
    """Points of a scene's first region, then those of the wall that it doesn't hide, and the number of the former."""
    rings = scene.regions[0]
    position = -scene.rotation.T @ scene.translation
    frame = PlaneFrame.of_region(rings)
    center = rings[0].mean(axis=0)
    look = (center - position) / np.linalg.norm(center - position)
    up = np.array([0.0, -1.0, 0.0]) + look[1] * look
    corners = WALL_HALF_WIDTH_M * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    wall = center + WALL_BEHIND_M * look + corners @ np.array([up / np.linalg.norm(up), np.cross(up, look)])
    near, far = (lidar_points(surface, position, rng, lidar, up) for surface in (rings, [wall]))
    normal = np.cross(frame.axes[:, 0], frame.axes[:, 1])
    beams = far - position
    crossing = position + (((frame.origin - position) @ normal) / (beams @ normal))[:, None] * beams
    hidden = shapely.contains_xy(frame.polygon(rings), *frame.flat(crossing).T)
    return np.concatenate([near, far[~hidden]]), len(near)


def pose_error(scene: SyntheticScene, region: rp.WorldRegion) -> tuple[float, float]:
    """Rotation (deg) and translation error (meters) of the nearest answer with the exact image region."""
    estimate = rp.estimate_pose(scene.camera, [rp.ImageRegion.from_mask(scene.coverages()[0])], [region])
    answers = []
    for pose in (estimate.pose, *(answer.pose for answer in estimate.diagnostics.alternatives)):
        matrix = pose.rotation.as_matrix()
        shift = translation_error(matrix, pose.translation, scene.rotation, scene.translation, scene.anchor)
        answers.append((rotation_error(matrix, scene.rotation), shift))
    return min(answers)


def nearest_to_median(points: Array) -> int:
    """Index of the point nearest to the median of all: the median itself may lie in a hole."""
    return int(np.argmin(((points - np.median(points, axis=0)) ** 2).sum(axis=1)))


def synthetic_row(seed: int, lidar: SpinningLidar) -> list[float] | None:
    """IoU of the points; IoU and area error of the outline without and with correction; pose errors of those two and
    of the true region. None where the lidar hits the region too rarely.
    """
    scene = perspective_scene(seed)
    points, count = scan(scene, lidar, np.random.default_rng(seed))
    if count < LEAST_POINTS:
        return None
    try:
        found = rp.segment.grow_plane(points, nearest_to_median(points[:count]))
    except ValueError:
        found = np.empty(0, dtype=np.intp)
    row = [overlap_of_points(found, np.arange(count)).iou]
    for correct in (False, True):
        region = rp.WorldRegion.from_points(points[:count], correct_sampling=correct)
        row += [*overlap_of_outlines(region, scene.regions[0]), *pose_error(scene, region)]
    return [*row, *pose_error(scene, rp.WorldRegion.from_polygon(scene.regions[0]))]


def print_synthetic(scenes: int) -> None:
    """Print two lines a lidar."""
    print("synthetic           points        outline   IoU     area bias   spread  rotation deg  translation mm")
    for name, lidar in LIDARS.items():
        rows = [row for seed in range(scenes) if (row := synthetic_row(seed, lidar)) is not None]
        table = np.array(rows)
        grown = f"{table[:, 0].mean():.3f} of {len(rows):3}"
        for label, column in (("plain", 1), ("corrected", 5)):
            iou, bias, turn, shift = table[:, column : column + 4].T
            print(
                f"{name:18}  {grown:12}  {label:9} {iou.mean():.3f}   {100 * bias.mean():+6.1f} %"
                f"    {100 * bias.std():5.1f} %  {np.median(turn):9.3f}   {1e3 * np.median(shift):9.1f}"
            )
        turn, shift = table[:, 9:].T
        print(
            f"{name:18}  {grown:12}  {'true':9} 1.000   {0.0:+6.1f} %    {0.0:5.1f} %"
            f"  {np.median(turn):9.3f}   {1e3 * np.median(shift):9.1f}",
            flush=True,
        )


def labeled_faces(data: Path) -> Iterator[tuple[Path, dict[str, Any], dict[str, Any]]]:
    """(folder, region, calibration) of the labeled faces."""
    for path in sorted(data.glob("*/*/regions.json")):
        calibration = json.loads((path.parent / "calib.json").read_text())
        for region in json.loads(path.read_text()):
            if region.get("point_indices"):
                yield path.parent, region, calibration


@lru_cache(maxsize=1)
def planes_of(folder: Path) -> list[Indices]:
    """All planes of a scene's cloud, found once for its labeled faces."""
    return rp.segment.find_planes(cloud_of(folder))


def real_pose_error(region: rp.WorldRegion, labels: dict[str, Any], calibration: dict[str, Any]) -> tuple[float, float]:
    """Rotation (deg) and translation error (meters, at the region) of the nearest answer."""
    image = rp.ImageRegion.from_polygon([labels["image_polygon"]])
    estimate = rp.estimate_pose(camera_of(calibration), [image], [region])
    rotation, translation = np.array(calibration["R"]), np.array(calibration["t"])
    middle = region.rings[0].mean(axis=0)
    answers = []
    for pose in (estimate.pose, *(answer.pose for answer in estimate.diagnostics.alternatives)):
        matrix = pose.rotation.as_matrix()
        shift = translation_error(matrix, pose.translation, rotation, translation, middle)
        answers.append((rotation_error(matrix, rotation), shift))
    return min(answers)


def print_real(data: Path) -> None:
    """Print a line a labeled face."""
    faces = list(labeled_faces(data))
    if not faces:
        print(f"no labeled faces below {data}: only synthetic scenes are measured")
        return
    print(
        "real                                        IoU  precision recall   area error  rotation deg  translation mm"
        "  planes"
    )
    print(
        "                                                           plain / corrected   plain / corrected, each     IoU"
    )
    for folder, labels, calibration in faces:
        cloud = cloud_of(folder)
        true = np.load(folder / labels["point_indices"])
        overlap = overlap_of_points(rp.segment.grow_plane(cloud, np.median(cloud[true], axis=0)), true)
        found = max(overlap_of_points(members, true).iou for members in planes_of(folder))
        areas, errors = [], []
        for correct in (False, True):
            region = rp.WorldRegion.from_points(cloud[true], correct_sampling=correct)
            is_board = folder.parent.name == "acfr_fisheye"
            areas.append(f"{100 * (region.area / np.prod(BOARD_M) - 1):+6.1f} %" if is_board else "       ")
            errors.append(real_pose_error(region, labels, calibration))
        (turn, shift), (corrected_turn, corrected_shift) = errors
        print(
            f"{folder.parent.name}/{folder.name} {labels['name']}".ljust(42)
            + f"{overlap.iou:.3f}  {overlap.precision:.3f}  {overlap.recall:.3f}  {' / '.join(areas)}"
            f"  {turn:6.2f} / {corrected_turn:5.2f}  {1e3 * shift:7.1f} / {1e3 * corrected_shift:6.1f}"
            f"   {found:.3f}",
            flush=True,
        )


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=100)
    parser.add_argument("--data", type=Path, default=DEFAULT_DATA)
    arguments = parser.parse_args()
    warnings.simplefilter("ignore", SparseSamplingWarning)
    print_synthetic(arguments.scenes)
    print_real(arguments.data)


if __name__ == "__main__":
    main()
