"""Alignment of a lidar cloud with an image by mutual information on KITTI frames, beside poses from regions.

Intensity: the lidar's reflectance against the gray value (Pandey et al. 2012, AAAI); normals: the direction that a
point's surface faces against the gray value (Taylor and Nieto 2012, normalized). Both measures are maximized over the
six pose parameters by Nelder and Mead's simplex, from the true pose disturbed by a turn and a shift of given size in
random directions: the paper's table 2 doesn't say where its runs started, so the size is this command's. `regionpose`
gets the regions of the frame that has them, no start. Frames that are not there are left out.

    OMP_NUM_THREADS=1 python -m benchmarks.mutual_information [--data ../shared/data] [--starts 10] [--degrees 5]
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import regionpose as rp
from numpy.typing import NDArray
from PIL import Image
from regionpose.cameras import Camera
from scipy.ndimage import gaussian_filter, map_coordinates
from scipy.optimize import minimize
from scipy.spatial import cKDTree

from benchmarks.real_scenes import DEFAULT_DATA, camera_of
from benchmarks.synthetic import overlap_error
from benchmarks.synthetic.measures import rotation_error

Array = NDArray[np.float64]
Feature = Literal["intensity", "normals"]

FRAMES = ("sfnd32", "000001", "000114")

BINS = 32
"""Levels of either value in the joint histogram."""

SMOOTHING_BINS = 1.0
"""Standard deviation of the Gaussian that the joint histogram is smoothed with, in bins (a kernel density)."""

NEIGHBORS = 12
"""Points around each that its normal is fitted to: two or three scan lines of this lidar."""

LEAST_SHARE = 0.3
"""Share of the points seen at the start that must stay in view: with none in view there is no information to lose."""

STEP = np.concatenate([np.full(3, np.radians(2.0)), np.full(3, 0.2)])
"""First step of the simplex along each parameter: 2 degrees and 0.2 m, below the error that it is to undo."""

EVALUATIONS = 1500
"""Evaluations of the measure at the most; a run takes some 500."""

STEP_PRECISION = 1e-3
"""Size of the simplex, in first steps, at which it has converged: 0.002 degrees and 0.2 mm."""


@dataclass(frozen=True)
class Frame:
    """An image (h, w) in gray, a cloud (n, 3) with its reflectances (n,), and the true pose."""

    name: str
    folder: Path
    camera: Camera
    gray: Array
    points: Array
    reflectance: Array
    pose: rp.Pose


def load_frame(folder: Path) -> Frame:
    """The frame of a folder with image.png, points.bin and calib.json."""
    calibration = json.loads((folder / "calib.json").read_text())
    gray = np.asarray(Image.open(folder / "image.png").convert("L"), dtype=np.float64)
    cloud = np.fromfile(folder / "points.bin", dtype=np.float32).reshape(-1, 4).astype(np.float64)
    pose = rp.Pose.from_parts(calibration["R"], calibration["t"])
    return Frame(folder.name, folder, camera_of(calibration), gray, cloud[:, :3], cloud[:, 3], pose)


def pairs_of(frame: Frame) -> list[tuple[rp.ImageRegion, rp.WorldRegion]]:
    """The labeled regions of a frame: polygons of the image, outlines of points."""
    labels = json.loads((frame.folder / "regions.json").read_text())
    return [
        (
            rp.ImageRegion.from_polygon([label["image_polygon"]]),
            rp.WorldRegion.from_points(frame.points[np.load(frame.folder / label["point_indices"])]),
        )
        for label in labels
    ]


def facing_angles(points: Array) -> Array:
    """(n,) angle about the vertical, radians, of the normal of the surface around each point (n, 3), to the sensor."""
    _, neighbors = cKDTree(points).query(points, NEIGHBORS)
    patches = points[neighbors] - points[neighbors].mean(axis=1, keepdims=True)
    normals = np.linalg.eigh(np.einsum("nki,nkj->nij", patches, patches))[1][:, :, 0]
    normals *= -np.sign(np.sum(normals * points, axis=1, keepdims=True))
    angles: Array = np.arctan2(normals[:, 1], normals[:, 0])
    return angles


def levels(values: Array) -> NDArray[np.int64]:
    """Level 0 to `BINS` - 1 of each value, by rank, so that each holds as many: reflectances are mostly small."""
    ranks = np.argsort(np.argsort(values, kind="stable"), kind="stable")
    return ranks * BINS // len(values)


def information(first: NDArray[np.int64], second: NDArray[np.int64], normalized: bool) -> float:
    """Mutual information in nats of two (n,) series of levels; normalized, `(H(a) + H(b)) / H(a, b) - 1`."""
    joint = np.bincount(first * BINS + second, minlength=BINS * BINS).reshape(BINS, BINS).astype(np.float64)
    joint = gaussian_filter(joint, SMOOTHING_BINS, mode="constant")
    joint /= joint.sum()
    together = entropy(joint)
    gain = entropy(joint.sum(axis=0)) + entropy(joint.sum(axis=1)) - together
    return gain / together if normalized else gain


def entropy(shares: Array) -> float:
    """Entropy in nats."""
    positive = shares[shares > 0.0]
    return -float(positive @ np.log(positive))


def disturbed(pose: rp.Pose, degrees: float, meters: float, seed: int) -> rp.Pose:
    """The pose turned and shifted by so much in random directions."""
    directions = np.random.default_rng(seed).normal(size=(2, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return pose.retract(np.concatenate([np.radians(degrees) * directions[0], meters * directions[1]]))


def measure(frame: Frame, feature: Feature) -> Callable[[rp.Pose], tuple[float, int]]:
    """A function of a pose: the mutual information there and the number of points in view."""
    values = levels(frame.reflectance if feature == "intensity" else facing_angles(frame.points))
    height, width = frame.gray.shape
    gray = levels(frame.gray.ravel()).reshape(height, width).astype(np.float64)

    def at(pose: rp.Pose) -> tuple[float, int]:
        points = pose.transform(frame.points)
        ahead = points[:, 2] > 0.0
        pixels = frame.camera.project(points[ahead])
        inside = ((pixels >= 0.0) & (pixels <= (width - 1, height - 1))).all(axis=1)
        if not inside.any():
            return 0.0, 0
        seen = map_coordinates(gray, pixels[inside, ::-1].T, order=1)
        shown = np.rint(seen).astype(np.int64)
        return information(values[ahead][inside], shown, feature == "normals"), int(inside.sum())

    return at


def aligned(at: Callable[[rp.Pose], tuple[float, int]], start: rp.Pose) -> rp.Pose:
    """The pose that Nelder and Mead's simplex reaches from a start."""
    least = LEAST_SHARE * at(start)[1]

    def loss(steps: Array) -> float:
        value, count = at(start.retract(steps * STEP))
        return -value if count >= least else 0.0

    simplex = np.vstack([np.zeros(6), np.eye(6)])
    result = minimize(
        loss,
        np.zeros(6),
        method="Nelder-Mead",
        options={"initial_simplex": simplex, "xatol": STEP_PRECISION, "fatol": np.inf, "maxfev": EVALUATIONS},
    )
    return start.retract(result.x * STEP)


def region_overlap(frame: Frame, pose: rp.Pose) -> float:
    """The paper's delta of the frame's regions together, a fraction; NaN for a frame without, infinite out of view."""
    if not (frame.folder / "regions.json").exists():
        return float("nan")
    deltas, areas = [], []
    for image, world in pairs_of(frame):
        rings = [frame.camera.project(pose.transform(ring)) for ring in world.rings]
        if not np.isfinite(np.concatenate(rings)).all():
            return float("inf")
        deltas.append(overlap_error(rings, image.rings))
        areas.append(image.area)
    return float(np.average(deltas, weights=areas))


def errors(frame: Frame, pose: rp.Pose) -> tuple[float, float, float]:
    """Rotation (deg), translation (m) and overlap error of a pose."""
    turn = rotation_error(pose.rotation.as_matrix(), frame.pose.rotation.as_matrix())
    shift = float(np.linalg.norm(pose.translation - frame.pose.translation))
    return turn, shift, region_overlap(frame, pose)


def line(frame: Frame, what: str, poses: Sequence[rp.Pose]) -> str:
    """Median (least to greatest) of the errors of some poses."""
    turn, shift, overlap = np.array([errors(frame, pose) for pose in poses]).T
    delta = "" if np.isnan(overlap).any() else f"{100 * np.median(overlap):8.1f} %"
    return (
        f"{frame.name:8} {what:34} {np.median(turn):7.2f} ({turn.min():.2f} to {turn.max():.2f}) deg"
        f"  {np.median(shift):7.3f} ({shift.min():.3f} to {shift.max():.3f}) m  {delta}"
    )


def print_regions(frame: Frame) -> None:
    """The lines of the true pose and of `regionpose`, which has no start: its first answer, and the nearest."""
    print(line(frame, "true pose", [frame.pose]))
    images, worlds = (list(side) for side in zip(*pairs_of(frame), strict=True))
    estimate = rp.estimate_pose(frame.camera, images, worlds)
    answers = [estimate.pose, *(answer.pose for answer in estimate.diagnostics.alternatives)]
    print(line(frame, "regionpose, no start", answers[:1]))
    nearest = min(answers, key=lambda pose: errors(frame, pose)[0])
    print(line(frame, f"regionpose, nearest of {len(answers)}", [nearest]))


def main() -> None:
    """Print the lines of each frame."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=DEFAULT_DATA)
    parser.add_argument("--starts", type=int, default=10)
    parser.add_argument("--degrees", type=float, default=5.0)
    parser.add_argument("--meters", type=float, default=0.5)
    arguments = parser.parse_args()
    folders = [arguments.data / "kitti" / name for name in FRAMES]
    for missing in (folder for folder in folders if not folder.exists()):
        print(f"no frame {missing}: left out")
    for frame in (load_frame(folder) for folder in folders if folder.exists()):
        if (frame.folder / "regions.json").exists():
            print_regions(frame)
        starts = [disturbed(frame.pose, arguments.degrees, arguments.meters, seed) for seed in range(arguments.starts)]
        print(line(frame, f"{arguments.starts} starts", starts))
        for feature in ("intensity", "normals"):
            at = measure(frame, feature)
            print(line(frame, f"mutual information, {feature}", [aligned(at, start) for start in starts]), flush=True)


if __name__ == "__main__":
    main()
