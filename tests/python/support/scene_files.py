"""A small scene on disk, whose pose is known: two L-shaped plates seen by a pinhole camera."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from regionpose import PinholeCamera, Pose
from regionpose.io.yaml_text import to_yaml
from scipy.spatial.transform import Rotation

WIDTH, HEIGHT = 320, 240
CAMERA = PinholeCamera(300.0, 300.0, 159.5, 119.5, width=WIDTH, height=HEIGHT)
POSE = Pose(Rotation.from_euler("xyz", [8.0, -12.0, 3.0], degrees=True), np.array([0.1, -0.2, 4.0]))

SHAPE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 0.4], [0.4, 0.4], [0.4, 1.0], [0.0, 1.0]])
PLATES: dict[str, NDArray[np.float64]] = {
    "floor": np.column_stack([SHAPE - [1.2, 0.3], np.zeros(6)]),
    "wall": np.column_stack([SHAPE[:, 0] * 0.8 + 0.1, SHAPE[:, 1] - 0.5, 0.7 * SHAPE[:, 0]]),
}


def scene_values(shift: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> dict[str, Any]:
    """The scene's values, the world moved by `shift` (meters)."""
    regions = [
        {
            "name": name,
            "image": {"polygon": CAMERA.project(POSE.transform(plate)).tolist()},
            "world": {"polygon": (plate + shift).tolist()},
        }
        for name, plate in PLATES.items()
    ]
    camera = {"model": "pinhole", "fx": 300.0, "fy": 300.0, "cx": 159.5, "cy": 119.5, "width": WIDTH, "height": HEIGHT}
    # Of so few pixels, a center that is off by what it is by default would weigh more than all else.
    solver = {"center_sigma_px": 0.0}
    return {"camera": camera, "image": "image.png", "regions": regions, "solver": solver}


def write_scene(folder: Path, values: dict[str, Any] | None = None, name: str = "scene.yaml") -> Path:
    """The path of a scene file and its image, written to `folder`."""
    Image.fromarray(np.full((HEIGHT, WIDTH, 3), 128, dtype=np.uint8)).save(folder / "image.png")
    path = folder / name
    path.write_text(to_yaml(values or scene_values()), encoding="utf-8")
    return path
