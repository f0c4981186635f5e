"""Time of a pose from nothing against OpenCV's iterative PnP on the same points, in one run.

Three regions of 100 vertices each; regionpose sees contours without correspondences or a start, one thread, by the
batch; OpenCV sees the 300 vertices with their exact correspondences.

    python benchmarks/speed.py [--scenes 40] [--rounds 15]
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable

import cv2
import numpy as np
import regionpose as rp
from numpy.typing import NDArray
from regionpose.evaluation import perspective_scene

Array = NDArray[np.float64]
VERTICES = 100
REGIONS = 3


def resampled(ring: Array) -> Array:
    """The ring as `VERTICES` vertices at equal distances along it."""
    following = np.roll(ring, -1, axis=0)
    lengths = np.linalg.norm(following - ring, axis=1)
    ends = np.concatenate([[0.0], np.cumsum(lengths)])
    along = np.linspace(0.0, ends[-1], VERTICES, endpoint=False)
    edge = np.searchsorted(ends, along, side="right") - 1
    share = ((along - ends[edge]) / lengths[edge])[:, None]
    return np.asarray(ring[edge] * (1.0 - share) + following[edge] * share)


def seconds(run: Callable[[], object]) -> float:
    """Wall time of one call."""
    start = time.perf_counter()
    run()
    return time.perf_counter() - start


def main() -> None:
    """Print both times and their ratio, the median over rounds that alternate between the two."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=40)
    parser.add_argument("--rounds", type=int, default=15)
    arguments = parser.parse_args()

    problems, points = [], []
    for seed in range(arguments.scenes):
        scene = perspective_scene(seed, REGIONS, world="arbitrary")
        world = [resampled(rings[0]) for rings in scene.regions]
        image = [scene.camera.project(ring @ scene.rotation.T + scene.translation) for ring in world]
        image_regions = [rp.ImageRegion.from_polygon([ring]) for ring in image]
        problems.append((scene.camera, image_regions, [rp.WorldRegion.from_polygon([ring]) for ring in world]))
        points.append((np.concatenate(world), np.concatenate(image), scene.camera.matrix))

    cv2.setNumThreads(1)

    def run_opencv() -> None:
        for world_points, pixels, matrix in points:
            cv2.solvePnP(world_points, pixels, matrix, None, flags=cv2.SOLVEPNP_ITERATIVE)

    ours, theirs = [], []
    for _ in range(arguments.rounds):
        theirs.append(seconds(run_opencv) / arguments.scenes)
        ours.append(seconds(lambda: rp.estimate_poses(problems, threads=1)) / arguments.scenes)
    ratio = statistics.median(a / b for a, b in zip(ours, theirs, strict=True))
    print(f"regionpose {rp.__version__}, {REGIONS} regions x {VERTICES} vertices, no start, one thread:")
    print(f"  {1e3 * statistics.median(ours):.3f} ms a pose")
    print(f"cv2 {cv2.__version__} solvePnP ITERATIVE, the same {REGIONS * VERTICES} points with correspondences:")
    print(f"  {1e3 * statistics.median(theirs):.3f} ms a pose")
    print(f"ratio of the two, median over {arguments.rounds} rounds: {ratio:.1f}")


if __name__ == "__main__":
    main()
