"""`regionpose fuse`: the image's colours on the cloud."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from regionpose.cli.console import Progress, say_json
from regionpose.cli.options import AsJson, CameraName, CameraPath, Force, PosePath, Quiet
from regionpose.cli.outputs import refuse_existing, write_file

if TYPE_CHECKING:
    from regionpose.cameras import Camera
    from regionpose.clouds import Cloud
    from regionpose.pose import Pose
    from regionpose.scene.sensors import Picture


def fuse(
    cloud: Annotated[Path, typer.Argument(help="Point cloud: PLY, PCD, LAS, E57, KITTI .bin, text, ...")],
    image: Annotated[Path, typer.Argument(help="Image of the camera.")],
    camera: CameraPath,
    pose: PosePath,
    out: Annotated[Path, typer.Option("--out", "-o", help="PLY file to write.")] = Path("coloured.ply"),
    camera_name: CameraName = None,
    force: Force = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Colour a cloud with an image and a known pose.

    Points that the camera doesn't see, or that others hide, keep their colour, or are black; the field `visible` tells.

    \b
    Examples:
      regionpose fuse cloud.ply image.jpg --camera camera_info.yaml --pose result/result.json --out coloured.ply
      regionpose fuse 000042.bin 000042.png --camera 000042.txt --pose 000042.txt --json
    """
    refuse_existing([out], force)
    from regionpose.clouds import write_ply
    from regionpose.scene.colours import coloured_cloud

    with Progress(quiet) as progress:
        progress.begin("read files")
        sensors = read_sensors(cloud, image, camera, pose, camera_name)
        progress.begin("colours")
        coloured, visible = coloured_cloud(*sensors)
        write_file(out, lambda path: write_ply(path, coloured), force=force)
    total, seen = len(coloured), int(visible.sum())
    if as_json:
        say_json({"out": str(out), "points": total, "visible_points": seen})
    else:
        typer.echo(f"{seen} of {total} points coloured; written: {out}")


def read_sensors(
    cloud: Path, image: Path, camera: Path, pose: Path, camera_name: str | None
) -> tuple[Cloud, Picture, Camera, Pose]:
    """Cloud, picture, camera, and the pose for points about the cloud's local origin."""
    from regionpose.calibration import load_camera
    from regionpose.cli.poses import read_pose
    from regionpose.clouds import read_cloud
    from regionpose.pose import Pose
    from regionpose.scene.sensors import read_picture

    known_camera = load_camera(camera, camera_name)
    picture = read_picture(image)
    size = known_camera.width, known_camera.height
    if None not in size and size != (picture.shape[1], picture.shape[0]):
        found = f"{picture.shape[1]} x {picture.shape[0]}"
        raise ValueError(f"{image}: found {found} pixels; needed {size[0]} x {size[1]}, as in {camera}")
    points = read_cloud(cloud)
    world = read_pose(pose, camera_name)
    return (
        points,
        picture,
        known_camera,
        Pose(world.rotation, world.translation + world.rotation.as_matrix() @ points.origin),
    )
