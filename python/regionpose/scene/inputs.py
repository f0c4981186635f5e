"""What a run was made from: the files that a scene reads, and the packages that a result depends on."""

from __future__ import annotations

import platform
import sys
from hashlib import file_digest, sha256
from importlib import metadata
from pathlib import Path
from typing import Any

from regionpose.io.bags.messages import digest
from regionpose.io.bags.place import bag_place
from regionpose.scene.loading import Scene, named_regions
from regionpose.scene.models import CameraFile, ImageMask, WorldMesh, WorldPoints
from regionpose.scene.paths import relative

PACKAGES = ("regionpose", "numpy", "scipy", "scikit-image", "shapely", "pydantic", "pillow")


def input_values(scene: Scene, folder: Path) -> list[dict[str, Any]]:
    """Roles, path (as a file in `folder` names it), size and SHA-256 of every file that a scene reads."""
    content = scene.document.content
    path = relative(scene.path, folder)
    own = {"roles": ["scene"], "path": path, "bytes": len(content), "sha256": sha256(content).hexdigest()}
    roles: dict[str, list[str]] = {}
    for role, name in named_files(scene).items():
        roles.setdefault(name, []).append(role)
    roles_of_files = [(scene.file(name), role) for name, role in roles.items()]
    return [own] + [{"roles": role, "path": relative(file, folder), **_content(file)} for file, role in roles_of_files]


def _content(path: Path) -> dict[str, Any]:
    """Size and SHA-256 of a file, or of the messages of a bag that a path names."""
    place = bag_place(path)
    size, digested = (path.stat().st_size, file_hash(path)) if place is None else digest(place)
    return {"bytes": size, "sha256": digested}


def named_files(scene: Scene) -> dict[str, str]:
    """The files that a scene names, by their role."""
    model = scene.model
    camera = model.camera.file if isinstance(model.camera, CameraFile) else model.camera
    files = {"camera": camera} if isinstance(camera, str) else {}
    for frame in scene.frames:
        files |= _frame_files(frame, f" of {frame.name}" if frame.name else "")
    return files


def _frame_files(scene: Scene, tail: str) -> dict[str, str]:
    """Those of one photo and its cloud, by their role."""
    files = {f"image{tail}": scene.image}
    if scene.cloud is not None:
        files[f"cloud{tail}"] = scene.cloud.file
    for region in named_regions(scene):
        whose = f"of {region.name}{tail}"
        if isinstance(region.image, ImageMask):
            files[f"mask {whose}"] = region.image.mask
            if region.image.unknown is not None:
                files[f"unknown pixels {whose}"] = region.image.unknown
        if isinstance(region.world, WorldPoints) and isinstance(region.world.points, str):
            files[f"points {whose}"] = region.world.points
        if isinstance(region.world, WorldMesh):
            files[f"mesh {whose}"] = region.world.mesh
    return files


def file_hash(path: Path) -> str:
    """SHA-256 of a file, hexadecimal."""
    with path.open("rb") as file:
        return file_digest(file, "sha256").hexdigest()


def versions() -> dict[str, str]:
    """Versions of Python and of the packages that a result depends on."""
    found = {"python": platform.python_version(), "platform": sys.platform}
    for package in PACKAGES:
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            found[package] = "unknown"
    return found
