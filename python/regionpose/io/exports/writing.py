"""A pose written as another tool reads it."""

from __future__ import annotations

from pathlib import Path

from regionpose.cameras import Camera
from regionpose.geometry.pose import Pose
from regionpose.io.exports.formats import exported
from regionpose.io.exports.view import ExportedView
from regionpose.io.outputs import text_writer, write_files
from regionpose.validation.arguments import checked_arguments


@checked_arguments
def write_pose(
    folder: str | Path,
    pose: Pose,
    tool: str,
    *,
    camera: Camera | None = None,
    image: str | None = None,
    world_frame: str = "lidar",
    camera_frame: str = "camera",
    body: bool = False,
    force: bool = False,
) -> list[Path]:
    """Write a pose, and the camera where the format holds one, as another tool reads it; return the files.

    Parameters
    ----------
    folder : str or Path
        Made where it isn't there.
    pose : Pose
        `camera_from_world`, meters.
    tool : str
        The format: autoware, colmap, kalibr, meshlab, nerfstudio, nuscenes, opencv, tf2 or urdf.
    camera : Camera, optional
        Of the photo; some formats need it, with its size.
    image : str, optional
        The photo's name, written as it is given.
    world_frame, camera_frame : str
        Names of the frames, in formats that have such.
    body : bool
        Of ROS: the camera frame has x forward, y left, z up, and is not the optical one; Autoware's always is so.
    force : bool
        Replace files that are there.

    Raises
    ------
    ValueError
        For an unknown format, or where it needs what isn't given.
    FileExistsError
        Without `force`, for files that are there.

    """
    view = ExportedView(pose, camera, image, world_frame, camera_frame, body)
    files = exported(view, tool)
    return write_files(Path(folder), {name: text_writer(text) for name, text in files.items()}, force=force)
