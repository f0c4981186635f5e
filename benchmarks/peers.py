"""Pose from points beside pose from regions on the same scenes: OpenCV's solvePnP and PoseLib, exact and noisy corners.

Points come with correspondences: a few corners of each shape, each known by name in the world and in the image, as
surveyed markers are (the paper's table 1). `regionpose` gets masks without correspondences or a start: binary, as
shares of pixels, and with segmentation error. Shapes without symmetry, perspective camera, arbitrary world frames.
Forward projection: the mean distance in pixels between all corners as the true pose and as the estimate projects them.

    OMP_NUM_THREADS=1 python -m benchmarks.peers [--scenes 100] [--planes 1 3] [--corners 6]
"""

from __future__ import annotations

import argparse
import importlib
import importlib.util
import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import cv2
import numpy as np
import regionpose as rp
from numpy.typing import NDArray

from benchmarks.synthetic import SyntheticScene, perspective_scene, problem_generator, squares_on_mask
from benchmarks.synthetic.measures import rotation_error, translation_error

Array = NDArray[np.float64]
Solver = Callable[[Array, Array, rp.PinholeCamera], tuple[Array, Array] | None]

NOISE_PX = (0.0, 0.5, 1.0, 2.0, 5.0)
"""Standard deviations of a corner's image coordinates: exact, located by a tool, clicked with care, in a hurry."""

RANSAC_THRESHOLD_PX = 20.0
"""PoseLib's bound between a right and a wrong point: no point is wrong here, so four times the largest noise."""

SEGMENTATION_ERROR = 0.05
"""Share of each mask's area that squares along its boundary change in the row of disturbed masks (paper section 3)."""

FAILED = (180.0, float("inf"), float("inf"))
"""Errors that count where a method gives no pose."""


class Measured(NamedTuple):
    """Rotation (deg), translation (m) and forward projection (px) errors and seconds of one answer."""

    rotation: float
    translation: float
    projection: float
    seconds: float


def opencv(flag: int) -> Solver:
    """One of OpenCV's solvers."""

    def solve(world: Array, pixels: Array, camera: rp.PinholeCamera) -> tuple[Array, Array] | None:
        found, turn, shift = cv2.solvePnP(world, pixels, camera.matrix, None, flags=flag)
        return (np.array(cv2.Rodrigues(turn)[0], np.float64), np.array(shift[:, 0], np.float64)) if found else None

    return solve


def with_poselib(world: Array, pixels: Array, camera: rp.PinholeCamera) -> tuple[Array, Array] | None:
    """PoseLib's robust estimate and its refinement."""
    poselib = importlib.import_module("poselib")
    given = {
        "model": "PINHOLE",
        "width": camera.width,
        "height": camera.height,
        "params": [camera.fx, camera.fy, camera.cx, camera.cy],
    }
    pose, _ = poselib.estimate_absolute_pose(pixels, world, given, {"max_reproj_error": RANSAC_THRESHOLD_PX}, {})
    return pose.R, pose.t


def solvers() -> dict[str, Solver]:
    """The point methods that are installed; a message for what is not."""
    found = {
        "cv2 ITERATIVE": opencv(cv2.SOLVEPNP_ITERATIVE),
        "cv2 EPNP": opencv(cv2.SOLVEPNP_EPNP),
        "cv2 SQPNP": opencv(cv2.SOLVEPNP_SQPNP),
    }
    if importlib.util.find_spec("poselib") is None:
        print("poselib isn't installed: left out (pip install poselib)")
    else:
        found["PoseLib"] = with_poselib
    return found


def spread_corners(ring: Array, count: int) -> Array:
    """(count, 3) corners of a ring, each the farthest from those before it, the first from the middle."""
    distances = np.linalg.norm(ring - ring.mean(axis=0), axis=1)
    chosen: list[int] = []
    for _ in range(min(count, len(ring))):
        chosen.append(int(np.argmax(distances)))
        nearest = np.linalg.norm(ring - ring[chosen[-1]], axis=1)
        distances = nearest if len(chosen) == 1 else np.minimum(distances, nearest)
    return ring[chosen]


def measured(scene: SyntheticScene, answer: tuple[Array, Array] | None, seconds: float) -> Measured:
    """The errors of a pose (rotation matrix, translation)."""
    if answer is None:
        return Measured(*FAILED, seconds)
    corners = np.concatenate([ring for rings in scene.regions for ring in rings])
    true, found = (
        scene.camera.project(corners @ rotation.T + translation)
        for rotation, translation in ((scene.rotation, scene.translation), answer)
    )
    shift = translation_error(*answer, scene.rotation, scene.translation, scene.anchor)
    projection = float(np.linalg.norm(found - true, axis=1).mean())
    turn = rotation_error(answer[0], scene.rotation)
    return Measured(turn, shift, projection if np.isfinite(projection) else float("inf"), seconds)


def timed(run: Callable[[], Any]) -> tuple[Any, float]:
    """What a call returns and its processor time in seconds."""
    begin = time.process_time()
    result = run()
    return result, time.process_time() - begin


def from_points(scene: SyntheticScene, seed: int, solve: Solver, noise_px: float, count: int) -> Measured:
    """The errors of a pose from a few corners of each region, each with its image disturbed."""
    world = np.concatenate([spread_corners(rings[0], count) for rings in scene.regions])
    pixels = scene.camera.project(world @ scene.rotation.T + scene.translation)
    # The same draw for each method and, scaled, for each level of noise.
    pixels = pixels + noise_px * problem_generator(seed, "corners").standard_normal(pixels.shape)
    camera = scene.camera
    assert isinstance(camera, rp.PinholeCamera)
    answer, seconds = timed(lambda: solve(world, pixels, camera))
    return measured(scene, answer, seconds)


def disturbed_masks(scene: SyntheticScene, seed: int) -> list[NDArray[np.bool_]]:
    """The masks with segmentation error."""
    rng = problem_generator(seed, "masks")
    return [squares_on_mask(mask, SEGMENTATION_ERROR, rng) for mask in scene.masks()]


def from_regions(scene: SyntheticScene, images: Sequence[Array] | Sequence[NDArray[np.bool_]]) -> Measured:
    """The errors of `regionpose` from masks, its first answer."""

    def run() -> rp.PoseEstimate:
        seen = [rp.ImageRegion.from_mask(image) for image in images]
        return rp.estimate_pose(scene.camera, seen, [rp.WorldRegion.from_polygon(rings) for rings in scene.regions])

    estimate, seconds = timed(run)
    return measured(scene, (estimate.pose.rotation.as_matrix(), estimate.pose.translation), seconds)


def line(planes: int, method: str, noise: str, rows: list[Measured]) -> str:
    """Medians (95 %) over the scenes."""
    rotation, translation, projection, seconds = np.array(rows).T
    return (
        f"{planes:6}  {method:16} {noise:>8}  {np.median(rotation):9.4f} ({np.percentile(rotation, 95):8.3f})"
        f"  {1e3 * np.median(translation):8.2f} ({1e3 * np.percentile(translation, 95):8.1f})"
        f"  {np.median(projection):7.3f} ({np.percentile(projection, 95):7.2f})  {1e3 * np.median(seconds):8.3f}"
    )


def main() -> None:
    """Print a line for each method and noise."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=100)
    parser.add_argument("--planes", type=int, nargs="+", default=[1, 3])
    parser.add_argument("--corners", type=int, default=6, help="corners of each region that the point methods know")
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    known = solvers()
    print(f"points: {arguments.corners} corners a region WITH correspondences; regions: masks WITHOUT, and no start")
    print("planes  method              noise         rotation deg         translation mm      projection px        ms")
    for planes in arguments.planes:
        scenes = [
            perspective_scene(seed, planes, world="arbitrary", templates="asymmetric")
            for seed in range(arguments.scenes)
        ]
        for noise_px in NOISE_PX:
            for name, solve in known.items():
                rows = [
                    from_points(scene, seed, solve, noise_px, arguments.corners) for seed, scene in enumerate(scenes)
                ]
                print(line(planes, name, f"{noise_px:g} px", rows), flush=True)
        rows = [from_regions(scene, scene.masks()) for scene in scenes]
        print(line(planes, "regionpose", "binary", rows), flush=True)
        rows = [from_regions(scene, scene.coverages()) for scene in scenes]
        print(line(planes, "regionpose", "coverage", rows), flush=True)
        rows = [from_regions(scene, disturbed_masks(scene, seed)) for seed, scene in enumerate(scenes)]
        print(line(planes, "regionpose", f"{100 * SEGMENTATION_ERROR:g} % off", rows), flush=True)


if __name__ == "__main__":
    main()
