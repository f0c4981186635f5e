"""Accuracy on synthetic scenes without noise and without a prior: a row for each camera and number of planes.

Translation errors are taken at the first region's centroid. A symmetric shape fits from several poses: the nearest of
the pose and its alternatives counts, and a scene whose answers do not hold the true pose within 1 deg is not solved.

    python benchmarks/accuracy.py [--scenes 200] [--masks binary coverage] [--templates all] [--driver scipy]
"""

from __future__ import annotations

import argparse
from collections.abc import Callable

import numpy as np
import regionpose as rp
from regionpose.evaluation import Scene, fisheye_scene, perspective_scene
from regionpose.evaluation.measures import rotation_error, translation_error

SOLVED_DEG = 1.0
ROWS: list[tuple[str, Callable[..., Scene], int]] = [
    ("pinhole", perspective_scene, 1),
    ("pinhole", perspective_scene, 3),
    ("fisheye", fisheye_scene, 1),
    ("fisheye", fisheye_scene, 3),
]


def errors(scene: Scene, masks: str, driver: rp.solver.Driver) -> tuple[float, float, bool]:
    """Rotation (deg) and translation (metres) error of the nearest answer, and whether there were several."""
    images = scene.masks() if masks == "binary" else scene.coverages()
    estimate = rp.estimate_pose(
        scene.camera,
        [rp.ImageRegion.from_mask(image) for image in images],
        [rp.WorldRegion.from_polygon(rings) for rings in scene.regions],
        driver=driver,
    )
    found = []
    for pose in (estimate.pose, *estimate.alternatives):
        matrix = pose.rotation.as_matrix()
        shift = translation_error(matrix, pose.translation, scene.rotation, scene.translation, scene.anchor)
        found.append((rotation_error(matrix, scene.rotation), shift))
    return *min(found), len(found) > 1


def main() -> None:
    """Print a line a row."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=200)
    parser.add_argument("--masks", nargs="+", choices=["binary", "coverage"], default=["binary", "coverage"])
    parser.add_argument("--templates", choices=["all", "asymmetric", "symmetric"], default="all")
    parser.add_argument("--driver", choices=["scipy", "native"], default="scipy")
    arguments = parser.parse_args()
    print("masks     camera   planes  scenes  solved  ambiguous  rotation deg (95 %)   translation mm (95 %)")
    for masks in arguments.masks:
        for camera, make, planes in ROWS:
            scenes = (
                make(seed, planes, world="arbitrary", templates=arguments.templates) for seed in range(arguments.scenes)
            )
            rows = [errors(scene, masks, arguments.driver) for scene in scenes]
            rotation, translation, ambiguous = (np.array(column) for column in zip(*rows, strict=True))
            print(
                f"{masks:9} {camera:8} {planes:6}  {len(rows):6}  {100 * np.mean(rotation < SOLVED_DEG):5.1f}%"
                f"  {100 * np.mean(ambiguous):8.1f}%  {np.median(rotation):8.4f} ({np.percentile(rotation, 95):.3f})"
                f"      {1e3 * np.median(translation):8.3f} ({1e3 * np.percentile(translation, 95):.2f})",
                flush=True,
            )


if __name__ == "__main__":
    main()
