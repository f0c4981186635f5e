"""Errors on real scenes with ground truth, one line a scene: the nearest answer to the truth, and which one that was.

The scenes are folders with calib.json, regions.json and points.npy or points.bin; where there are none this says so
and ends.
A single rectangle fits from several poses, so the truth may be any of the answers.

    python benchmarks/real_scenes.py [--data ../shared/data] [--points]
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import regionpose as rp
from numpy.typing import NDArray
from regionpose.cameras import Camera
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]
DEFAULT_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


def camera_of(calibration: dict[str, Any]) -> Camera:
    """The camera of a calib.json."""
    size = {"width": calibration["width"], "height": calibration["height"]}
    if calibration["model"] == "pinhole":
        return rp.PinholeCamera.from_matrix(calibration["K"], calibration["D"], **size)
    if calibration["model"] == "opencv_fisheye":
        return rp.FisheyeCamera.from_matrix(calibration["K"], calibration["D"], **size)
    return rp.OcamCamera(
        calibration["taylor_coefficient"],
        calibration["distortion_center_xy"],
        calibration["stretch_matrix"],
        **size,
    )


def cloud_of(folder: Path) -> Array:
    """Points (n, 3) of a scene."""
    if (folder / "points.npy").exists():
        return np.load(folder / "points.npy")[:, :3].astype(np.float64)
    return np.fromfile(folder / "points.bin", dtype=np.float32).reshape(-1, 4)[:, :3].astype(np.float64)


def pairs_of(folder: Path, from_points: bool) -> Iterator[tuple[rp.ImageRegion, rp.WorldRegion]]:
    """The regions of a scene; `from_points` outlines the points even where the known rectangle is given."""
    cloud = cloud_of(folder)
    for region in json.loads((folder / "regions.json").read_text()):
        image = rp.ImageRegion.from_polygon([region["image_polygon"]])
        if region.get("rectangle3d") and not (from_points and region.get("point_indices")):
            yield image, rp.WorldRegion.from_polygon([region["rectangle3d"]])
        else:
            indices = np.load(folder / region["point_indices"])
            yield image, rp.WorldRegion.from_points(cloud[indices])


def line(name: str, calibration: dict[str, Any], pairs: list[tuple[rp.ImageRegion, rp.WorldRegion]]) -> str:
    """The estimate's errors as a line."""
    images, worlds = (list(side) for side in zip(*pairs, strict=True))
    estimate = rp.estimate_pose(camera_of(calibration), images, worlds)
    rotation, translation = np.array(calibration["R"]), np.array(calibration["t"])
    middle = np.mean([ring.mean(axis=0) for world in worlds for ring in world.rings], axis=0)
    answers = []
    for place, pose in enumerate((estimate.pose, *estimate.alternatives)):
        turn = np.degrees(Rotation.from_matrix(pose.rotation.as_matrix() @ rotation.T).magnitude())
        at_regions = np.linalg.norm(pose.transform(middle) - (rotation @ middle + translation))
        answers.append((turn, at_regions, np.linalg.norm(pose.translation - translation), place))
    turn, at_regions, shift, place = min(answers)
    codes = " ".join(warning.code for warning in estimate.warnings)
    return (
        f"{name:34} {turn:7.3f} deg  {1e3 * at_regions:8.2f} mm at the regions  {1e3 * shift:8.2f} mm  "
        f"answer {place + 1} of {len(answers)}  delta {100 * estimate.overlap_error:5.1f} %  {codes}"
    )


def main() -> None:
    """Print a line a scene, then the ACFR boards as one problem."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=DEFAULT_DATA)
    parser.add_argument("--points", action="store_true", help="outline the cloud's points even where a board is known")
    arguments = parser.parse_args()
    folders = sorted(path.parent for path in arguments.data.glob("*/*/regions.json"))
    if not folders:
        print(f"no scenes below {arguments.data}: nothing to measure")
        return
    boards: list[tuple[rp.ImageRegion, rp.WorldRegion]] = []
    for folder in folders:
        calibration = json.loads((folder / "calib.json").read_text())
        pairs = list(pairs_of(folder, arguments.points))
        print(line(str(folder.relative_to(arguments.data)), calibration, pairs), flush=True)
        if folder.parent.name == "acfr_fisheye":
            boards += pairs
            rig = calibration
    if boards:
        print(line("acfr_fisheye, six boards at once", rig, boards))


if __name__ == "__main__":
    main()
