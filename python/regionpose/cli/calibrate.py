"""`regionpose calibrate`: one pose from a folder of photos and clouds of one rig."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from regionpose.cli.console import Progress
from regionpose.cli.estimate import run_scene
from regionpose.cli.options import (
    CAMERA_HELP,
    AsJson,
    CameraModel,
    CameraName,
    Columns,
    Force,
    Quiet,
    Rectified,
    SegmenterName,
    Strict,
    asking,
    names_of,
    numbers_of,
)
from regionpose.outputs import text_writer

if TYPE_CHECKING:
    from regionpose.scene.folder import FolderOptions

SCENE_FILE = "scene.yaml"


def calibrate(
    folder: Annotated[Path, typer.Argument(help="Folder of photos and clouds, a pair having one name.")],
    camera: Annotated[
        Path | None,
        typer.Option("--camera", help=f"{CAMERA_HELP}  [default: the pairs' scene files say it]", show_default=False),
    ] = None,
    camera_name: CameraName = None,
    camera_model: CameraModel = None,
    columns: Columns = None,
    rectified: Rectified = False,
    coco: Annotated[
        Path | None, typer.Option("--coco", help="COCO file with the regions of all photos.", show_default=False)
    ] = None,
    sensor_origin: Annotated[
        str | None,
        typer.Option(
            "--sensor-origin", help="x,y,z (meters) where the scanner stood in each cloud.", show_default=False
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="Folder for the files.  [default: FOLDER-result, beside it]"),
    ] = None,
    force: Force = False,
    as_json: AsJson = False,
    strict: Strict = False,
    segmenter: SegmenterName = None,
    quiet: Quiet = False,
) -> None:
    """Estimate one pose from a folder of photos and clouds.

    The camera and the scanner are fixed to each other; the pose is the camera's in the scanner's frame.
    Every photo 0001.png with a cloud 0001.pcd beside it is a frame. Its regions are in 0001.yaml (keys of a scene
    file), in 0001.json (labelme or COCO) or in masks 0001-NAME.png. Without world_regions in 0001.yaml, they are
    matched with the planes of the cloud. Writes what `regionpose estimate` writes, and the scene.yaml that it runs.

    \b
    Examples:
      regionpose calibrate drive --camera calib.yaml
      regionpose calibrate drive --camera calib.yaml --coco annotations.json --out result
      regionpose calibrate drive --json --quiet | jq .camera_from_world.matrix
    """
    from regionpose.scene.folder import folder_scene

    result = out or folder.parent / f"{folder.resolve().name}-result"
    origin = None if sensor_origin is None else list(numbers_of("--sensor-origin", sensor_origin, 3, "x,y,z"))
    with Progress(quiet) as progress:
        progress.begin("pairs of the folder")
        chosen = {"name": camera_name, "model": camera_model, "rectified": rectified}
        options = replace(_options(camera, chosen, origin, coco), columns=names_of(columns))
        scene, alone = folder_scene(folder, result / SCENE_FILE, options)
    if alone and not quiet:
        typer.echo(f"left out, no cloud of the name: {', '.join(photo.name for photo in alone)}", err=True)
    run_scene(
        asking(scene, segmenter),
        result,
        force=force,
        as_json=as_json,
        quiet=quiet,
        strict=strict,
        extra={SCENE_FILE: text_writer(scene.document.content.decode())},
    )


def _options(
    camera: Path | None, words: dict[str, str | bool | None], origin: list[float] | None, coco: Path | None
) -> FolderOptions:
    """What the command line says of all pairs; ValueError for words about a camera that isn't given."""
    from regionpose.scene.folder import FolderOptions

    said = {key: value for key, value in words.items() if value}
    if camera is None:
        if said:
            option = next(iter(said)) if "rectified" in said and len(said) == 1 else f"camera-{next(iter(said))}"
            raise ValueError(f"--{option}: found it without --camera; needed both")
        return FolderOptions(None, origin, coco)
    return FolderOptions({"file": str(camera), **said} if said else str(camera), origin, coco)
