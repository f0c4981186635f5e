"""`regionpose calibrate`: one pose from a photo and a cloud, or from a folder of these of one rig."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from regionpose.cli.cameras import SCENE_FILE, camera_scenes, run_cameras, unpaired_photos
from regionpose.cli.console import Progress, print_remarks
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
)
from regionpose.cli.prior_options import Mounts, Near, PriorOptions, Up
from regionpose.cli.recordings import Choice, recording_scene
from regionpose.io.outputs import text_writer

if TYPE_CHECKING:
    from regionpose.scene.folder import FolderOptions
    from regionpose.scene.loading import Scene


def calibrate(
    paths: Annotated[
        list[Path],
        typer.Argument(
            help="Folder of photos and clouds, a pair having one name; a bag of ROS or an MCAP file; or a photo and a"
            " cloud.",
            metavar="FOLDER | BAG | PHOTO CLOUD",
        ),
    ],
    camera: Annotated[
        Path | None,
        typer.Option(
            "--camera",
            help=f"{CAMERA_HELP}  [default: that of the pairs' scene files, calib.yaml in the folder, or the bag's]",
            show_default=False,
        ),
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
    near: Near = None,
    up: Up = None,
    mount: Mounts = None,
    photos: Annotated[
        str | None,
        typer.Option(
            "--photos", metavar="TOPIC", help="Photos of a bag.  [default: its only ones]", show_default=False
        ),
    ] = None,
    clouds: Annotated[
        str | None,
        typer.Option(
            "--clouds", metavar="TOPIC", help="Clouds of a bag.  [default: its only ones]", show_default=False
        ),
    ] = None,
    times: Annotated[
        str | None,
        typer.Option(
            "--times", help="Seconds from a bag's beginning at which to take photos, as 3.5,20.", show_default=False
        ),
    ] = None,
    frames: Annotated[
        int | None,
        typer.Option(
            "--frames",
            min=1,
            help="How many photos of a bag to take, those without motion and with many edges.  [default: 5]",
            show_default=False,
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="Folder for the files.  [default: FOLDER-result or PHOTO-result, beside it]"),
    ] = None,
    force: Force = False,
    as_json: AsJson = False,
    strict: Strict = False,
    segmenter: SegmenterName = None,
    quiet: Quiet = False,
) -> None:
    """Estimate a camera's pose in the frame of a scanner, from photos and clouds of one rig.

    Needs neither regions nor a start: the edges of the clouds are laid on those of the photos at all poses that --near,
    --up and --mount leave, and the odds of the best over chance and over the others give the verdict. Several photos
    are surer and more precise than one.

    Of a folder, every photo 0001.png with a cloud 0001.pcd beside it is a frame. Regions, where there are some, are in
    0001.yaml (keys of a scene file), in 0001.json (labelme or COCO) or in masks 0001-NAME.png. Without world_regions in
    0001.yaml, they are matched with the planes of the cloud. Writes what `regionpose estimate` writes, and the
    scene.yaml that it runs.

    A folder without photos whose folders have some is one of several cameras: front/0001.png, front/calib.yaml, and
    the cloud 0001.pcd or clouds/0001.pcd for all cameras. Each camera has a pose and a folder of results.

    Of a bag, a few photos are taken, spread over all that it shows, each with the cloud nearest to it in time.

    \b
    Examples:
      regionpose calibrate photo.png scan.pcd --camera calib.yaml --up z
      regionpose calibrate drive --camera calib.yaml --up z --mount front
      regionpose calibrate drive --camera calib.yaml --coco annotations.json --out result
      regionpose calibrate drive.mcap --photos /camera/image_raw --up z --mount front
      regionpose calibrate rig --up z --mount front=front --mount left=left
      regionpose calibrate drive --json --quiet | jq .camera_from_world.matrix
    """
    from regionpose.io.bags.place import is_bag
    from regionpose.scene.folder import camera_folders

    if len(paths) > 2:
        raise ValueError(f"found {len(paths)} paths; needed a folder, a bag, or a photo and a cloud")
    # The photo first.
    paths = list(_photo_and_cloud(*paths)) if len(paths) == 2 else paths
    choice = Choice(photos, clouds, times, frames)
    is_recording = len(paths) == 1 and is_bag(paths[0])
    choice.check(paths[0], is_recording=is_recording)
    first = paths[0].resolve()
    result = out or paths[0].parent / f"{first.name if first.is_dir() else first.stem}-result"
    prior_options = PriorOptions.of(near, up, mount or (), sensor_origin)
    folders = camera_folders(paths[0]) if len(paths) == 1 and not is_recording else []
    named = {"name": camera_name, "model": camera_model, "rectified": rectified}
    options = replace(_options(camera, named, prior_options.origin, coco), columns=names_of(columns))
    if folders:
        prior_options.check([folder.name for folder in folders])
        priors = {folder.name: prior_options.prior(folder.name) for folder in folders}
        scenes = camera_scenes(paths[0], folders, result, options, priors, quiet=quiet)
        scenes = {name: asking(scene, segmenter) for name, scene in scenes.items()}
        run_cameras(scenes, result, force=force, as_json=as_json, quiet=quiet, strict=strict)
        return
    prior_options.check([])
    options = replace(options, prior=prior_options.prior())
    scene, remarks = _scene(paths, result / SCENE_FILE, options, choice if is_recording else None, quiet=quiet)
    print_remarks(remarks, quiet)
    run_scene(
        asking(scene, segmenter),
        result,
        force=force,
        as_json=as_json,
        quiet=quiet,
        strict=strict,
        extra={SCENE_FILE: text_writer(scene.document.content.decode())},
    )


def _scene(
    paths: Sequence[Path], path: Path, options: FolderOptions, choice: Choice | None, *, quiet: bool
) -> tuple[Scene, list[str]]:
    """The scene at `path` of a recording, if there is a choice of its photos, a folder, or a photo and a cloud; and
    remarks.
    """
    from regionpose.scene.folder import folder_scene, pair_scene

    with Progress(quiet) as progress:
        if choice is not None:
            return recording_scene(paths[0], path, options, choice, progress)
        if len(paths) == 1:
            progress.begin("pairs of the folder")
            scene, alone = folder_scene(paths[0], path, options)
            return scene, unpaired_photos(alone)
        progress.begin("files")
        return pair_scene(paths[0], paths[1], path, options), []


def _photo_and_cloud(first: Path, second: Path) -> tuple[Path, Path]:
    """Which of two files is the photo; ValueError where that isn't clear."""
    from regionpose.io.reading import IMAGE_SUFFIXES

    for path in (first, second):
        if not path.exists() and "#" not in str(path):
            raise FileNotFoundError(f"{path}: found nothing; needed a photo and a cloud")
    pictures = [path.suffix.lower() in IMAGE_SUFFIXES for path in (first, second)]
    if pictures[0] and pictures[1]:
        raise ValueError(f"{second}: found a second photo; needed a cloud")
    return (second, first) if pictures[1] else (first, second)


def _options(
    camera: Path | None, words: dict[str, str | bool | None], origin: list[float] | None, coco: Path | None
) -> FolderOptions:
    """The options for all pairs; ValueError for camera options without a camera."""
    from regionpose.scene.folder import FolderOptions

    options = {key: value for key, value in words.items() if value}
    if camera is None:
        if options:
            option = (
                next(iter(options)) if "rectified" in options and len(options) == 1 else f"camera-{next(iter(options))}"
            )
            raise ValueError(f"--{option}: found it without --camera; needed both")
        return FolderOptions(None, origin, coco)
    return FolderOptions({"file": str(camera), **options} if options else str(camera), origin, coco)
