"""Images with their cameras and poses, as commands are given them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, TypeVar

from regionpose.fusion.colors import PosedImage
from regionpose.io.calibrations import load_camera
from regionpose.io.calibrations.poses import PoseSource, read_pose_file
from regionpose.scene.input_checks import check_camera, check_photo_name
from regionpose.scene.sensors import read_picture

Item = TypeVar("Item")


class ViewFiles(NamedTuple):
    """The files of one image, and which of the calibration's cameras took it."""

    image: Path
    camera: Path
    pose: Path
    camera_name: str | None
    camera_model: str | None = None
    rectified: bool = False


def view_files(
    images: Sequence[Path],
    cameras: Sequence[Path],
    poses: Sequence[Path],
    names: Sequence[str],
    model: str | None = None,
    rectified: bool = False,
) -> list[ViewFiles]:
    """The files of each image; one camera, and one name, may be that of all, `model` and `rectified` are those of all.

    ValueError for other counts.
    """
    if len(poses) != len(images):
        raise ValueError(f"--pose: found {len(poses)} for {len(images)} images; needed one for each, in their order")
    named: Sequence[str | None] = names or [None]
    chosen = zip(
        images, _one_each("--camera", cameras, images), poses, _one_each("--camera-name", named, images), strict=True
    )
    return [ViewFiles(*files, model, rectified) for files in chosen]


def _one_each(option: str, given: Sequence[Item], images: Sequence[Path]) -> Sequence[Item]:
    if len(given) not in {1, len(images)}:
        raise ValueError(f"{option}: found {len(given)} for {len(images)} images; needed one for all, or one for each")
    return given if len(given) == len(images) else list(given) * len(images)


def read_view(files: ViewFiles, remarks: list[str] | None = None) -> PosedImage:
    """The image, its camera, and its pose; remarks about them are added to `remarks`."""
    camera = load_camera(files.camera, files.camera_name, model=files.camera_model, rectified=files.rectified)
    picture = read_picture(files.image)
    size = (picture.shape[1], picture.shape[0])
    remark = camera.other_size(*size)
    if remark is not None:
        raise ValueError(f"{files.image}: {remark}, as in {files.camera}")
    pose = read_pose_file(files.pose, PoseSource(files.camera_name, files.camera, files.image.name))
    if remarks is not None:
        warnings = (*check_camera(camera, size[::-1]), *check_photo_name(camera, files.image.name))
        remarks += [f"warning: {files.camera}: {warning}" for warning in warnings]
        remarks += [f"pose: {files.pose}: {pose.remark}"] if pose.remark else []
    return PosedImage(camera, picture, pose.pose)
