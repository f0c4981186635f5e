"""`regionpose project`: where the cloud's points fall in the image."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from regionpose.cli.console import Progress, print_json, print_remarks
from regionpose.cli.options import (
    AsJson,
    CameraModel,
    CameraName,
    CameraPath,
    Columns,
    Force,
    PosePath,
    Quiet,
    Rectified,
    names_of,
)
from regionpose.io.outputs import refuse_existing, write_file

if TYPE_CHECKING:
    from regionpose.fusion.colors import PosedImage
    from regionpose.io.clouds import Cloud

CSV_HEADER = "index,x_px,y_px,depth_m"


def project(
    cloud: Annotated[Path, typer.Argument(help="Point cloud: PLY, PCD, LAS, E57, KITTI .bin, text, ...")],
    image: Annotated[Path, typer.Argument(help="Image of the camera.")],
    camera: CameraPath,
    pose: PosePath,
    out: Annotated[Path, typer.Option("--out", "-o", help="PNG (picture by depth) or CSV (pixels) to write.")] = Path(
        "projected.png"
    ),
    camera_name: CameraName = None,
    camera_model: CameraModel = None,
    columns: Columns = None,
    rectified: Rectified = False,
    force: Force = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Project a cloud into an image with a known pose.

    A PNG shows the points that the camera sees over the image, colored by their distance. A CSV lists, for each point
    inside the image, hidden ones too, its index in the cloud's file, its pixel (an integer is a pixel's center) and its
    distance along the optical axis.

    \b
    Examples:
      regionpose project cloud.ply image.jpg --camera camera_info.yaml --pose result/result.json --out depth.png
      regionpose project 000042.bin 000042.png --camera 000042.txt --pose 000042.txt --out pixels.csv
    """
    kind = out.suffix.lower()
    if kind not in {".png", ".csv"}:
        raise ValueError(f"{out}: found the ending {kind!r}; needed .png or .csv")
    refuse_existing([out], force)
    from regionpose.cli.views import ViewFiles, read_view

    remarks: list[str] = []
    with Progress(quiet) as progress:
        points = progress.read_cloud(cloud, names_of(columns))
        view = read_view(ViewFiles(image, camera, pose, camera_name, camera_model, rectified), remarks)
        progress.begin("projection")
        rows = _rows_inside(points, view)
        write_file(out, lambda path: _write(path, rows, points, view), force=force)
    print_remarks(remarks, quiet)
    if as_json:
        print_json({"out": str(out), "points": len(points), "points_inside": len(rows)})
    else:
        typer.echo(f"{len(rows)} of {len(points)} points inside the image; written: {out}")


def _rows_inside(cloud: Cloud, view: PosedImage) -> list[tuple[int, float, float, float]]:
    """Index in the file, pixel and depth of each point inside the image."""
    import numpy as np

    in_camera = view.pose.transform(cloud.points)
    pixels = view.camera.project(in_camera)
    height, width = np.shape(view.image)[:2]
    with np.errstate(invalid="ignore"):
        inside = np.flatnonzero(((pixels >= -0.5) & (pixels < [width - 0.5, height - 0.5])).all(axis=1))
    numbers = cloud.to_file_indices(inside).tolist()
    return [
        (number, float(pixels[k, 0]), float(pixels[k, 1]), float(in_camera[k, 2]))
        for number, k in zip(numbers, inside, strict=True)
    ]


def _write(path: Path, rows: list[tuple[int, float, float, float]], cloud: Cloud, view: PosedImage) -> None:
    if path.suffix.lower() == ".csv":
        lines = [f"{index},{x:.4f},{y:.4f},{depth:.6f}" for index, x, y, depth in rows]
        path.write_text("\n".join([CSV_HEADER, *lines, ""]), encoding="utf-8")
        return
    from regionpose.io.png import save_png
    from regionpose.viz.overlays import overlay_depth

    save_png(path, overlay_depth(view.camera, view.image, cloud.points, view.pose))
