"""The scene that is being picked as plain values: of its file, and of single regions."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from regionpose.app.parts import ImagePart, Picked, WorldPart
from regionpose.io.yaml_text import to_yaml
from regionpose.scene.document import Document
from regionpose.scene.loading import Scene, model_of
from regionpose.scene.loading import scene_of as checked_scene_of

HEADING = "# Written by `regionpose pick`; `regionpose estimate` on it gives the pose.\n"


def scene_of(path: Path, values: dict[str, Any]) -> Scene:
    """The scene that a file with these values would hold; SceneError where it would hold none."""
    document = Document(path, values, None)
    return Scene(document, model_of(document))


def check_scene(path: Path, values: dict[str, Any]) -> None:
    """Check that a file with these values can be read again; SceneError that names what is missing otherwise."""
    checked_scene_of(Document(path, values, None))


def region_values(picked: Picked, path: Path) -> dict[str, Any]:
    """The scene file's values of a region with the sides that it has, for a file at `path`."""
    values: dict[str, Any] = {"name": picked.name}
    if picked.image is not None:
        values["image"] = image_values(picked.image.chosen, path)
    if picked.world is not None:
        values["world"] = world_values(picked.world.chosen, path)
    return values


def image_values(part: ImagePart, path: Path) -> dict[str, Any]:
    """The scene file's values of a side in the photo, for a file at `path`."""
    return {"mask": mask_name(part, path), **part.written} if part.picked else dict(part.written)


def world_values(part: WorldPart, path: Path) -> dict[str, Any]:
    """The scene file's values of a side in the cloud, for a file at `path`."""
    return {**part.written, "points": points_name(part, path)} if part.picked else dict(part.written)


def points_name(part: WorldPart, path: Path) -> str:
    """The name of the file of picked points, beside the scene file."""
    return f"{path.stem}-points-{_digest(np.asarray(part.written['points'], dtype=np.int64).tobytes())}.npy"


def mask_name(part: ImagePart, path: Path) -> str:
    """The name of the file of a picked mask, beside the scene file."""
    return f"{path.stem}-mask-{_digest(part.levels.tobytes())}.png"


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:12]


def region_lists(regions: Sequence[Picked], path: Path) -> dict[str, Any]:
    """The scene file's lists of regions: the pairs, and those of either side alone, where there are any."""
    pairs = [region_values(picked, path) for picked in regions if picked.is_paired]
    lists: dict[str, Any] = {"regions": pairs} if pairs else {}
    for key, side in (("image_regions", "image"), ("world_regions", "world")):
        alone = [picked for picked in regions if not picked.is_paired and getattr(picked, side) is not None]
        if alone:
            lists[key] = [region_values(picked, path) for picked in alone]
    return lists


def scene_text(values: dict[str, Any]) -> str:
    """The values as the text of a scene file."""
    return HEADING + to_yaml(values)
