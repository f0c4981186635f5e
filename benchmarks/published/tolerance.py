"""How far off the published start may be turned in its plane, which the paper puts at 60 to 80 deg (its figure 9).

The world's up direction is handed to the start (the paper's `R_u`) turned by each angle, to the left and right in turn,
so that the start is off by just that; shapes without symmetry, binary masks, the mesh scheme. At 0 deg stands what one
plane's two tilts, which look nearly alike, leave of it.

    OMP_NUM_THREADS=1 python -m benchmarks.published.tolerance [--scenes 20] [--planes 1 3] [--start parallel]
"""

from __future__ import annotations

import argparse
from collections.abc import Callable

import numpy as np
import regionpose as rp
from scipy.spatial.transform import Rotation

from benchmarks import published
from benchmarks.synthetic import SyntheticScene, omnidirectional_scene, perspective_scene
from benchmarks.synthetic.measures import SOLVED_ROTATION_DEG, rotation_error

ANGLES_DEG = (0, 20, 45, 60, 70, 80, 90, 100, 120, 150)
MAKERS: dict[published.System, Callable[..., SyntheticScene]] = {
    "plane": perspective_scene,
    "sphere": omnidirectional_scene,
}


def is_reached(system: published.System, seed: int, planes: int, angle_deg: float, start: published.Start) -> bool:
    """Whether the true rotation of a scene is reached from a start that is turned by so much."""
    scene = MAKERS[system](seed, planes, templates="asymmetric")
    turn = Rotation.from_euler("z", angle_deg if seed % 2 else -angle_deg, degrees=True).as_matrix()
    up = scene.rotation.T @ turn @ np.array([0.0, -1.0, 0.0])
    images = [rp.ImageRegion.from_mask(mask) for mask in scene.masks()]
    pose, _ = published.estimate(
        scene.camera, images, scene.regions, system=system, integration="mesh", up=up, start=start
    )
    return rotation_error(pose.rotation.as_matrix(), scene.rotation) < SOLVED_ROTATION_DEG


def main() -> None:
    """Print the solved share, a row for each system and number of planes and a column for each angle."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=20)
    parser.add_argument("--planes", type=int, nargs="+", default=[1, 3])
    parser.add_argument("--start", choices=["parallel", "turned"], default="parallel")
    arguments = parser.parse_args()
    print(f"rotation < {SOLVED_ROTATION_DEG:g} deg, % of {arguments.scenes} scenes, by in-plane error of the start")
    print("system  planes " + "".join(f"{angle:5} deg" for angle in ANGLES_DEG))
    for system in MAKERS:
        for planes in arguments.planes:
            print(f"{system:7} {planes:6} ", end="", flush=True)
            for angle in ANGLES_DEG:
                reached = [is_reached(system, seed, planes, angle, arguments.start) for seed in range(arguments.scenes)]
                print(f"{100 * np.mean(reached):9.0f}", end="", flush=True)
            print()


if __name__ == "__main__":
    main()
