"""Scene files of real frames, where they are beside the checkout."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from regionpose import Pose
from regionpose.scene import estimate_scene, load_scene

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"


def kitti_scene(folder: Path, frame: str) -> tuple[dict[str, Any], Pose, list[dict[str, Any]]]:
    """A frame's scene without regions, its true pose, and its regions as they are drawn."""
    source = DATA / frame
    if not source.exists():
        pytest.skip(f"needs {frame} of the real scenes beside the checkout")
    held = json.loads((source / "calib.json").read_text(encoding="utf-8"))
    matrix = held["K"]
    camera = {"model": "pinhole", "fx": matrix[0][0], "fy": matrix[1][1], "cx": matrix[0][2], "cy": matrix[1][2]}
    for name in ("image.png", "points.bin"):
        (folder / name).symlink_to(source / name)
    values = {"camera": camera, "image": "image.png", "cloud": "points.bin", "prior": {"up": [0, 0, 1]}}
    regions = json.loads((source / "regions.json").read_text(encoding="utf-8"))
    return values, Pose.from_parts(held["R"], held["t"]), regions["regions"] if isinstance(regions, dict) else regions


def test_unpaired_polygons_find_their_planes(tmp_path: Path) -> None:
    values, truth, regions = kitti_scene(tmp_path, "kitti/sfnd32")
    values["image_regions"] = [{"name": r["name"], "image": {"polygon": r["image_polygon"]}} for r in regions]
    values["world_regions"] = "planes"
    path = tmp_path / "scene.yaml"
    path.write_text(yaml.safe_dump(values), encoding="utf-8")
    run = estimate_scene(load_scene(path))
    assert run.sides.matching is not None and len(run.sides.matching.pairs) == 2
    assert np.degrees((run.estimate.pose.rotation * truth.rotation.inv()).magnitude()) < 2.0
    assert np.linalg.norm(run.estimate.pose.camera_center - truth.camera_center) < 0.3
