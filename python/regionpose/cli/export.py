"""`regionpose export`: a pose in the files of another tool."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from regionpose.cli.console import print_remarks
from regionpose.cli.options import CAMERA_HELP, CameraModel, CameraName, Force, Rectified
from regionpose.io.outputs import text_writer, write_files

if TYPE_CHECKING:
    from regionpose.cameras import Camera


class FormatName(StrEnum):
    """The formats."""

    tf2 = "tf2"
    urdf = "urdf"
    autoware = "autoware"
    opencv = "opencv"
    colmap = "colmap"
    nerfstudio = "nerfstudio"
    kalibr = "kalibr"
    nuscenes = "nuscenes"
    meshlab = "meshlab"


FORMAT_HELP = "tf2, urdf, autoware, opencv, colmap, nerfstudio, kalibr, nuscenes or meshlab."


def export(
    pose: Annotated[Path, typer.Argument(help="result.json, or another file that holds a pose.")],
    name: Annotated[FormatName, typer.Option("--format", help=FORMAT_HELP, show_default=False, metavar="NAME")],
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Folder for the files; printed without it.", show_default=False)
    ] = None,
    camera: Annotated[Path | None, typer.Option("--camera", help=CAMERA_HELP, show_default=False)] = None,
    camera_name: CameraName = None,
    camera_model: CameraModel = None,
    rectified: Rectified = False,
    image: Annotated[
        str | None, typer.Option("--image", help="The photo's name, written as it is given.", show_default=False)
    ] = None,
    world_frame: Annotated[str, typer.Option("--world-frame", help="Name of the cloud's frame.")] = "lidar",
    camera_frame: Annotated[str, typer.Option("--camera-frame", help="Name of the camera's frame.")] = "camera",
    body: Annotated[
        bool, typer.Option("--body", help="ROS: camera frame x forward, y left, z up, not the optical one.")
    ] = False,
    force: Force = False,
) -> None:
    """Write a pose as other tools read it.

    Camera and photo are result.json's unless they are given. The photo's path is relative to --out, or to the
    working folder where files are printed. ROS' frames are the optical one (x right, y down, z forward) unless --body;
    Autoware's are always body frames.

    \b
    Examples:
      regionpose export result/result.json --format tf2 --world-frame velodyne --camera-frame camera_optical
      regionpose export result/result.json --format colmap --out sparse
      regionpose export pose.txt --format opencv --camera camera_info.yaml
    """
    from regionpose.io.calibrations.poses import PoseSource, read_pose_file
    from regionpose.io.exports import ExportedView, exported
    from regionpose.io.exports.view import checked_frame

    result = _result_values(pose)
    placed = read_pose_file(pose, PoseSource(camera_name, camera, image))
    print_remarks([f"pose: {pose}: {placed.remark}"] if placed.remark else [], quiet=False)
    view = ExportedView(
        placed.pose,
        _camera(result, camera, camera_name, camera_model, rectified),
        image or _image(pose, result, out),
        checked_frame("--world-frame", world_frame),
        checked_frame("--camera-frame", camera_frame),
        body,
    )
    files = exported(view, name.value)
    if out is None:
        typer.echo("".join(f"# {file}\n{text}" if len(files) > 1 else text for file, text in files.items()), nl=False)
    else:
        written = write_files(out, {file: text_writer(text) for file, text in files.items()}, force=force)
        typer.echo(f"written: {', '.join(str(path) for path in written)}")


def _result_values(path: Path) -> dict[str, Any]:
    """What a result.json holds; nothing for another file."""
    from regionpose.io.reading import read_json

    result = read_json(path) if path.suffix.lower() == ".json" else {}
    return result if isinstance(result, dict) else {}


def _image(path: Path, result: dict[str, Any], out: Path | None) -> str | None:
    """The path of the result's photo, for a file in the folder `out` or the working one; None where it has none."""
    from regionpose.scene.paths import relative

    name = result.get("image")
    return relative(path.parent / name, out or Path()) if isinstance(name, str) else None


def _camera(
    result: dict[str, Any], path: Path | None, name: str | None, model: str | None, rectified: bool
) -> Camera | None:
    """The camera that is given, or the result's."""
    from regionpose.io.calibrations import load_camera
    from regionpose.io.exports.view import camera_of_values

    if path is not None:
        return load_camera(path, name, model=model, rectified=rectified)
    values = result.get("camera")
    return camera_of_values(values) if isinstance(values, dict) else None
