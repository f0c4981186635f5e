"""Solve the scene that ships with the project, from its masks and from the lidar's points, and draw the result.

python -m regionpose.demo [--out DIR] [--force]
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from regionpose.demo import scene
from regionpose.overlay import overlay_regions, save_png
from regionpose.regions import ImageRegion, WorldRegion
from regionpose.solver import PoseEstimate, estimate_pose

PICTURES = {"model": "overlay-model.png", "points": "overlay-points.png"}
"""The picture of each way to know the regions in the world."""


def main() -> int:
    """Print and draw both solutions; 2 where the pictures exist and `--force` is not given."""
    parser = argparse.ArgumentParser(prog="python -m regionpose.demo", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("demo"), help="folder of the pictures (default: demo)")
    parser.add_argument("--force", action="store_true", help="write over the pictures of an earlier run")
    arguments = parser.parse_args()
    existing = [name for name in PICTURES.values() if (arguments.out / name).exists()]
    if existing and not arguments.force:
        print(f"{arguments.out / existing[0]} exists; give --force or another --out", file=sys.stderr)
        return 2
    arguments.out.mkdir(parents=True, exist_ok=True)

    demo = scene.load()
    print(f"a photo of {demo.camera.width} x {demo.camera.height} px, a lidar cloud of {len(demo.points):,} points, ")
    print(f"regions in both: {', '.join(region.name for region in demo.regions)}")
    image_regions = [ImageRegion.from_mask(demo.labels == region.label) for region in demo.regions]
    worlds = {
        "model": ("their known outlines", [WorldRegion.from_polygon(region.rings) for region in demo.regions]),
        "points": (
            "outlines found around the lidar's points",
            [WorldRegion.from_points(demo.points[region.point_indices]) for region in demo.regions],
        ),
    }
    for key, (what, world_regions) in worlds.items():
        start = time.perf_counter()
        estimate = estimate_pose(demo.camera, image_regions, world_regions)
        print(f"\nfrom the masks and {what} ({1e3 * (time.perf_counter() - start):.0f} ms):")
        report(estimate, demo)
        labels = [
            f"{region.name} {100 * error:.1f} %"
            for region, error in zip(demo.regions, estimate.region_overlap_errors, strict=True)
        ]
        picture = overlay_regions(demo.image, demo.camera, estimate.pose, image_regions, world_regions, labels)
        print(f"  picture                {save_png(arguments.out / PICTURES[key], picture, overwrite=True)}")
    return 0


def report(estimate: PoseEstimate, demo: scene.DemoScene) -> None:
    """Print a pose, its uncertainty and its error; angles about and lengths along the camera's axes."""
    turn = Rotation.from_matrix(estimate.pose.rotation.as_matrix() @ demo.rotation.T).as_rotvec(degrees=True)
    shift = 1e3 * (estimate.pose.translation - demo.translation)
    print(f"  rotation vector        {triple(estimate.pose.rotation.as_rotvec(degrees=True))} deg, camera_from_lidar")
    print(f"  translation            {triple(estimate.pose.translation)} m")
    print(f"  standard deviations    {triple(estimate.rotation_sigma_deg)} deg")
    print(f"                         {triple(1e3 * estimate.translation_sigma)} mm")
    print(f"  error against truth    {triple(turn)} deg, {np.linalg.norm(turn):.3f} in all")
    print(f"                         {triple(shift)} mm, {np.linalg.norm(shift):.1f} in all")
    print(f"  overlap error          {100 * estimate.overlap_error:.2f} %")
    for warning in estimate.warnings:
        print(f"  warning                {warning}")


def triple(values: np.ndarray) -> str:
    """Three numbers in columns."""
    return "  ".join(f"{value:9.3f}" for value in values)


if __name__ == "__main__":
    sys.exit(main())
