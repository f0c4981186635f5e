"""How well edges of photo and cloud separate right poses from wrong ones, on frames with ground truth.

Of each frame, a folder with calib.json, a photo and a cloud, the agreement of photo and cloud is measured at the true
pose and at poses that are turned by 8 to 180 degrees, most of them moved by a meter or two, too. Where there are no
frames this says so and ends.

A line each: edges in view, the fraction of them that lie on edges of the photo at the true pose, the logarithm of the
odds, the least and the largest of the wrong poses', and seconds for the first pose and a further one. Then the AUC: the
share of pairs of a right and a wrong pose that the odds order rightly, ties counting half; and what
`UNINFORMATIVE_PRIOR` of `regionpose.alignment.odds` is taken from: how many true poses have odds below 1.

    python -m benchmarks.agreement [--data ../shared/data] [--wrong 12]
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import regionpose as rp
from numpy.typing import NDArray
from PIL import Image
from regionpose.cameras import Camera
from scipy.spatial.transform import Rotation

from benchmarks.real_scenes import DEFAULT_DATA, camera_of, scan_of

Array = NDArray[np.float64]

LEAST_TURN_DEG = 8.0
"""Beyond what the check takes for the same pose, and what a pose may be wrong by."""


LEAST_POINTS = 1000
"""Clouds of fewer are the places on a board, no scan."""


class RealFrame(NamedTuple):
    """A photo, its camera, a cloud and the true pose."""

    name: str
    image: NDArray[np.uint8]
    camera: Camera
    cloud: rp.Cloud
    pose: rp.Pose

    @property
    def frame(self) -> rp.Frame:
        """Photo and cloud, without regions."""
        return rp.Frame(image=self.image, points=self.cloud.points, intensity=self.cloud.intensity)


def frames(data: Path) -> Iterator[RealFrame]:
    """The frames of a folder that have a photo and a cloud."""
    for path in sorted(data.glob("*/*/calib.json")):
        folder, calibration = path.parent, json.loads(path.read_text())
        if "cameras" in calibration:
            cloud = scan_of(folder)
            for name, held in calibration["cameras"].items():
                yield frame(f"{folder.parent.name}/{name}", folder / held["image"], held, cloud)
        elif (folder / "points.npy").exists() or (folder / "points.bin").exists():
            cloud = scan_of(folder)
            if len(cloud.points) > LEAST_POINTS:
                yield frame(f"{folder.parent.name}/{folder.name}", folder / "image.png", calibration, cloud)


def frame(name: str, image: Path, calibration: dict[str, Any], cloud: rp.Cloud) -> RealFrame:
    """One photo with its cloud."""
    pixels = np.asarray(Image.open(image).convert("RGB"))
    return RealFrame(
        name, pixels, camera_of(calibration), cloud, rp.Pose.from_parts(calibration["R"], calibration["t"])
    )


def wrong_poses(pose: rp.Pose, count: int, seed: int) -> Iterator[rp.Pose]:
    """Poses turned about the vertical or any axis, half of them by up to 40 degrees, and moved but for a third."""
    rng = np.random.default_rng(seed)
    for number in range(count):
        axis = rng.normal(size=3) if number % 3 else np.array([0.0, 1.0, 0.0])
        angle = np.radians(rng.uniform(LEAST_TURN_DEG, 180.0 if number % 2 else 40.0))
        rotation = Rotation.from_rotvec(angle * axis / np.linalg.norm(axis)) * pose.rotation
        center = pose.camera_center + rng.normal(size=3) * (0.0 if number < count // 3 else 1.5)
        yield rp.Pose(rotation, -rotation.apply(center))


def area_under_curve(right: Array, wrong: Array) -> float:
    """The share of pairs in which the right one has the higher odds, ties counting half."""
    return float(np.mean((right[:, None] > wrong) + 0.5 * (right[:, None] == wrong)))


def main() -> None:
    """Print the odds of right and wrong poses."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=DEFAULT_DATA, help="folder of frames")
    parser.add_argument("--wrong", type=int, default=12, help="wrong poses of each frame")
    given = parser.parse_args()
    right: list[float] = []
    wrong: list[float] = []
    print("frame                     edges  agree  log odds  wrong from     to   first, further pose (s)")
    for number, held in enumerate(frames(given.data)):
        start = time.perf_counter()
        photo_cloud = held.frame
        true = rp.check_alignment(held.camera, photo_cloud, held.pose)
        middle = time.perf_counter()
        again = rp.check_alignment(held.camera, photo_cloud, held.pose)
        assert again.log_odds == true.log_odds
        seconds = (middle - start, time.perf_counter() - middle)
        poses = wrong_poses(held.pose, given.wrong, number)
        odds = [rp.check_alignment(held.camera, photo_cloud, pose).log_odds for pose in poses]
        print(
            f"{held.name:24} {len(true.places):6}  {true.edge_fraction:5.2f}  {true.log_odds:8.2f}"
            f"  {min(odds):10.2f}  {max(odds):5.2f}   {seconds[0]:.2f}, {seconds[1]:.2f}",
            flush=True,
        )
        right.append(true.log_odds)
        wrong += odds
    if not right:
        print(f"no frames in {given.data}: nothing to measure")
        return
    summary(np.array(right), np.array(wrong))


def summary(right: Array, wrong: Array) -> None:
    """Print the AUC, and what the constants are taken from."""
    print(f"AUC {area_under_curve(right, wrong):.3f} of {len(right)} right and {len(wrong)} wrong poses")
    print(f"log odds of right poses: {np.sum(right < 0.0)} below 0, {np.sum(right < -1.0)} below -1")
    print(
        f"of wrong poses: {np.mean(wrong < 0.0):.2f} below 0; largest {np.round(np.sort(wrong)[::-1][:5], 1).tolist()}"
    )


if __name__ == "__main__":
    main()
