"""Clicks that grow the wrong thing: one square of a chessboard in the photo, the whole board in the cloud.

Both are alike in shape and differ in scale only, so that a pose far away from the board fits as well as the true one.
Of each frame of acfr_fisheye some places of the board are clicked in the photo, and the board's middle in the cloud;
the scene file says what a user would know: up, and that the camera is on the scanner's side. Where there are no such
frames this says so and ends.

A line each: the share of the board that the click grew, the errors, the verdict, its confidence by the regions alone
and with edges, and how well photo and cloud agree (log odds). Then how many poses were wrong
(beyond 5 deg or half a meter) and how many of those were trusted.

    python -m benchmarks.chessboards [--data ../shared/data] [--clicks 6] [--near]
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import regionpose as rp
from numpy.typing import NDArray
from regionpose.io.yaml_text import to_yaml
from regionpose.scene.bundle import Truth, truth_errors
from regionpose.scene.estimate import SceneEstimate, estimate_scene
from regionpose.scene.loading import load_scene

from benchmarks.real_scenes import DEFAULT_DATA, RIG, camera_item, cloud_file, cloud_of, world_item

Array = NDArray[np.float64]

WRONG_DEG, WRONG_M = 5.0, 0.5
"""A pose beyond either is another one."""


class Click(NamedTuple):
    """What came of a click."""

    grown: float
    rotation: float
    center: float
    level: str
    before: float
    after: float
    log_odds: float

    @property
    def is_wrong(self) -> bool:
        """Whether the pose is another one than the true one."""
        return not (self.rotation < WRONG_DEG and self.center < WRONG_M)


def places(quad: Array, count: int) -> Array:
    """Pixels (n, 2) spread over a quadrilateral (4, 2), as a low-discrepancy sequence has them."""
    share = 0.15 + 0.7 * ((0.5 + np.arange(count)[:, None] * [0.7548776662, 0.5698402910]) % 1.0)
    u, v = share.T[..., None]
    return np.asarray((1 - u) * (1 - v) * quad[0] + u * (1 - v) * quad[1] + u * v * quad[2] + (1 - u) * v * quad[3])


def clicked(folder: Path, out: Path, pixel: Array, near: bool) -> SceneEstimate:
    """The estimate of a scene file that clicks a pixel of a frame's photo and the board in its cloud."""
    calibration = json.loads((folder / "calib.json").read_text())
    (board,) = json.loads((folder / "regions.json").read_text())
    scene: dict[str, Any] = {"camera": camera_item(calibration), "image": str(folder / "image.png")}
    scene |= {"cloud": str(cloud_file(folder)), "sensor_origin": [0.0, 0.0, 0.0]}
    world = world_item(board, folder, "clicks", cloud_of(folder))
    image = {"seed": [float(value) for value in pixel]}
    scene["regions"] = [{"name": "board", "image": image, "world": {**(world or {}), "viewpoint": [0.0, 0.0, 0.0]}}]
    scene["prior"] = {"up": [0.0, 0.0, 1.0]} | ({} if near else {"camera_near": None})
    path = out / f"{folder.name}.yaml"
    path.write_text(to_yaml(scene), encoding="utf-8")
    return estimate_scene(load_scene(path))


def clicks_of(folder: Path, out: Path, count: int, near: bool) -> Iterator[Click | str]:
    """What came of each click on a frame, or why nothing did."""
    calibration = json.loads((folder / "calib.json").read_text())
    (board,) = json.loads((folder / "regions.json").read_text())
    area = rp.ImageRegion.from_polygon(board["image_polygon"]).area
    truth = Truth(rp.Pose.from_parts(calibration["R"], calibration["t"]))
    for pixel in places(np.array(board["image_quad"]), count):
        try:
            run = clicked(folder, out, pixel, near)
        except (rp.PoseError, ValueError) as error:
            yield str(error).splitlines()[0]
            continue
        errors, found = truth_errors(run.estimate.pose, truth), run.estimate.diagnostics.edges
        assert found is not None and found.regions_only is not None
        after, before = run.estimate.confidence, found.regions_only.estimate.confidence
        grown = run.sides.image_regions[0].area / area
        (alignment,) = found.alignments
        level, odds = run.estimate.status.value, alignment.log_odds
        yield Click(grown, errors["rotation_deg"], errors["camera_center_m"], level, before, after, odds)


def main() -> None:
    """Print what comes of the clicks."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=DEFAULT_DATA, help="folder of real scenes")
    parser.add_argument("--clicks", type=int, default=6, help="clicks on each frame")
    parser.add_argument("--near", action="store_true", help="let the camera be near the scanner, as scene files do")
    given = parser.parse_args()
    folders = sorted(path for path in (given.data / RIG).glob("pose*") if (path / "regions.json").exists())
    if not folders:
        print(f"no frames in {given.data / RIG}: nothing to click on")
        return
    found: list[Click] = []
    print("frame    grown   error deg       m   verdict   confidence before, after  log odds")
    with tempfile.TemporaryDirectory() as out:
        for folder in folders:
            for click in clicks_of(folder, Path(out), given.clicks, given.near):
                if isinstance(click, str):
                    print(f"{folder.name}  refused: {click}")
                    continue
                found.append(click)
                grown, rotation, center, level, before, after, odds = click
                print(
                    f"{folder.name}  {grown:6.3f}  {rotation:9.2f}  {center:6.2f}   {level:8}"
                    f"  {before:17.3f}  {after:5.3f}  {odds:8.1f}",
                    flush=True,
                )
    wrong = [click for click in found if click.is_wrong]
    trusted = sum(click.level == "trusted" for click in wrong)
    print(f"{len(found)} poses, {len(wrong)} wrong, {trusted} of these trusted")


if __name__ == "__main__":
    main()
