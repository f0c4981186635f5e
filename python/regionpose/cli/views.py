"""Images with their cameras and poses, as commands are given them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, TypeVar

from regionpose.calibration import load_camera
from regionpose.cli.poses import read_pose
from regionpose.pictures.colors import PosedImage
from regionpose.scene.sensors import read_picture

Item = TypeVar("Item")


class ViewFiles(NamedTuple):
    """The files of one image, and which of the calibration's cameras took it."""

    image: Path
    camera: Path
    pose: Path
    camera_name: str | None
    camera_model: str | None = None


def view_files(
    images: Sequence[Path],
    cameras: Sequence[Path],
    poses: Sequence[Path],
    names: Sequence[str],
    model: str | None = None,
) -> list[ViewFiles]:
    """The files of each image; one camera, and one name, may be that of all,
    `model` is that of all. ValueError for other counts.
    """
    if len(poses) != len(images):
        raise ValueError(f"--pose: found {len(poses)} for {len(images)} images; needed one for each, in their order")
    named: Sequence[str | None] = names or [None]
    chosen = zip(
        images, _one_each("--camera", cameras, images), poses, _one_each("--camera-name", named, images), strict=True
    )
    return [ViewFiles(*files, model) for files in chosen]


def _one_each(option: str, given: Sequence[Item], images: Sequence[Path]) -> Sequence[Item]:
    if len(given) not in {1, len(images)}:
        raise ValueError(f"{option}: found {len(given)} for {len(images)} images; needed one for all, or one for each")
    return given if len(given) == len(images) else list(given) * len(images)


def read_view(files: ViewFiles) -> PosedImage:
    """The image, its camera, and its pose."""
    camera, picture = load_camera(files.camera, files.camera_name, model=files.camera_model), read_picture(files.image)
    remark = camera.other_size(picture.shape[1], picture.shape[0])
    if remark is not None:
        raise ValueError(f"{files.image}: {remark}, as in {files.camera}")
    return PosedImage(picture, camera, read_pose(files.pose, files.camera_name))
