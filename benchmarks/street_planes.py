"""Pairs that `world_regions: planes` finds on real frames, where the photo's faces are drawn and the planes are not.

The scenes are folders as of `benchmarks/picking.py`. Each is a scene file whose image regions are the drawn faces with
their hidden edges, and whose world regions are all planes of the cloud; the camera is known to be upright. The right
plane of a face is the one that holds most of its labeled points, if it holds half of them; "pure" is the share of such
a plane's points that are labeled. A line each: faces, those with a right plane, pairs found, those that are right, the
error of the pose, and its warnings. With --no-edges the pairs follow from the regions alone.

    python -m benchmarks.street_planes [--data ../shared/data] [--only natural kitti] [--no-edges]
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from regionpose.geometry.pose import Pose
from regionpose.io.yaml_text import to_yaml
from regionpose.scene.estimate import estimate_scene
from regionpose.scene.exposure import SceneData, scene_sides
from regionpose.scene.loading import load_scene
from regionpose.scene.models import PLANES

from benchmarks.picking import frames
from benchmarks.real_scenes import DEFAULT_DATA, camera_item, cloud_file, errors_of, scanner_of

UP_SIGMA_DEG = 5.0
"""Of a camera that is upright in its vehicle."""

LEAST_HELD = 0.5
"""Share of a face's labeled points that its plane holds."""


class Right(NamedTuple):
    """The plane of a face, and the share of the plane's points that are labeled as the face's."""

    plane: str
    pure: float


def scene_file(folder: Path, out: Path, edges: bool) -> Path:
    """Write the scene file of a frame; `edges`: whether those of photo and cloud may be used."""
    calibration = json.loads((folder / "calib.json").read_text())
    faces = json.loads((folder / "regions.json").read_text())
    scene = {
        "camera": camera_item(calibration),
        "image": str(folder / "image.png"),
        "cloud": str(cloud_file(folder)),
        "sensor_origin": scanner_of(folder, calibration),
        "image_regions": [
            {
                "name": face["name"],
                "image": {"polygon": face["image_polygon"], "hidden_edges": face.get("hidden_edges", [])},
            }
            for face in faces
        ],
        "world_regions": PLANES,
        "prior": {"up": [0.0, 0.0, 1.0], "up_sigma_deg": UP_SIGMA_DEG},
        "solver": {"edges": edges},
    }
    path = out / "scene.yaml"
    path.write_text(to_yaml(scene), encoding="utf-8")
    return path


def right_planes(folder: Path, sides: SceneData) -> dict[str, Right]:
    """The right planes of the faces that have one, by the faces' names."""
    found: dict[str, Right] = {}
    named = zip(sides.unpaired.world_names, sides.unpaired.world_sides, strict=True)
    planes = {name: side.indices for name, side in named if side.indices is not None}
    for face in json.loads((folder / "regions.json").read_text()):
        labels: NDArray[np.int64] = np.load(folder / face["point_indices"])
        held = {name: len(np.intersect1d(indices, labels)) for name, indices in planes.items()}
        name = max(held, key=lambda each: held[each])
        if held[name] >= LEAST_HELD * len(labels):
            found[face["name"]] = Right(name, held[name] / len(planes[name]))
    return found


def line_of(folder: Path, path: Path) -> tuple[str, NDArray[np.int64]]:
    """A frame's line, and its numbers of faces, those with a right plane, pairs and right pairs."""
    scene = load_scene(path)
    sides = scene_sides(scene)
    right = right_planes(folder, sides)
    pure = " ".join(f"{each.pure:.2f}" for each in right.values())
    pairs: tuple[tuple[str, str], ...] = ()
    try:
        run = estimate_scene(scene)
        calibration: dict[str, Any] = json.loads((folder / "calib.json").read_text())
        truth = Pose.from_parts(calibration["R"], calibration["t"])
        errors = errors_of(run.estimate.pose, run.estimate.covariance, truth)
        pairs = () if run.sides.matching is None else run.sides.matching.pairs
        codes = " ".join(dict.fromkeys(warning.code for warning in run.estimate.warnings))
        said = f"{errors.rotation:7.2f} deg {errors.center:6.2f} m  {codes or 'trusted'}"
    except ValueError as error:
        said = f"no pose: {str(error)[:60]}"
    met = sum(face in right and right[face].plane == plane for face, plane in pairs)
    counts = np.array([len(sides.unpaired.image_names), len(right), len(pairs), met])
    planes = len(sides.unpaired.world_names)
    shown = f"{planes:3} planes, {counts[0]} faces, {counts[1]} have one (pure {pure}), {counts[2]} pairs, {met} right"
    return f"{shown}  {said}", counts


def main() -> None:
    """Print a line for each frame, and the sums."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=DEFAULT_DATA)
    parser.add_argument("--only", nargs="+", default=["kitti", "natural"], help="kinds of scenes")
    parser.add_argument("--no-edges", action="store_true", help="match by the regions alone")
    options = parser.parse_args()
    total = np.zeros(4, dtype=np.int64)
    for folder in frames(options.data.resolve(), options.only):
        with tempfile.TemporaryDirectory() as place:
            line, counts = line_of(folder, scene_file(folder, Path(place), not options.no_edges))
        total += counts
        print(f"{'/'.join(folder.parts[-2:]):24} {line}", flush=True)
    print(f"{total[0]} faces, {total[1]} have a plane; {total[2]} pairs found, {total[3]} right")


if __name__ == "__main__":
    main()
