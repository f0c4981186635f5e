"""`regionpose fuse`: the colors of images on the cloud."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from regionpose.cli.console import Progress, print_json, print_remarks
from regionpose.cli.options import (
    AsJson,
    CameraModel,
    CameraNames,
    CameraPaths,
    Columns,
    Force,
    PosePaths,
    Quiet,
    Rectified,
    names_of,
)
from regionpose.io.outputs import refuse_existing, write_file


def fuse(
    cloud: Annotated[Path, typer.Argument(help="Point cloud: PLY, PCD, LAS, E57, KITTI .bin, text, ...")],
    images: Annotated[list[Path], typer.Argument(help="Image of the camera, or several.")],
    camera: CameraPaths,
    pose: PosePaths,
    out: Annotated[Path, typer.Option("--out", "-o", help="PLY file to write.")] = Path("colored.ply"),
    camera_name: CameraNames = None,
    camera_model: CameraModel = None,
    columns: Columns = None,
    rectified: Rectified = False,
    force: Force = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Color a cloud with images and their known poses.

    Where several images show a point, the nearer ones have more weight. Points that no camera sees, because they are
    outside its image or others hide them, keep their color, or are black; their field `visible` is 0.

    \b
    Examples:
      regionpose fuse cloud.ply image.jpg --camera camera_info.yaml --pose result/result.json --out colored.ply
      regionpose fuse 000042.bin 000042.png --camera 000042.txt --pose 000042.txt --json
      regionpose fuse cloud.ply a.jpg b.jpg --camera camera_info.yaml --pose a.json --pose b.json
      regionpose fuse cloud.ply l.jpg r.jpg --camera l.yaml --camera r.yaml --pose l.json --pose r.json
    """
    refuse_existing([out], force)
    from regionpose.cli.views import read_view, view_files
    from regionpose.fusion.colors import colored_cloud
    from regionpose.io.clouds import write_ply

    files = view_files(images, camera, pose, camera_name or [], camera_model, rectified)
    remarks: list[str] = []
    with Progress(quiet) as progress:
        points = progress.read_cloud(cloud, names_of(columns))
        views = (read_view(each, remarks) for each in progress.each(files, "colors of images"))
        colored, visible = colored_cloud(views, points)
        progress.begin("write cloud")
        write_file(out, lambda path: write_ply(path, colored), force=force)
    print_remarks(list(dict.fromkeys(remarks)), quiet)
    total, visible_count = len(colored), int(visible.sum())
    if as_json:
        print_json({"out": str(out), "images": len(files), "points": total, "visible_points": visible_count})
    else:
        typer.echo(f"{visible_count} of {total} points colored; written: {out}")
