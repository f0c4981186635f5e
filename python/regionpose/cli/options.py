"""Options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from regionpose.scene.loading import Scene

Force = Annotated[bool, typer.Option("--force", help="Replace files that are there.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print the result as JSON on standard output.")]
Strict = Annotated[bool, typer.Option("--strict", help="Exit with code 1 when the pose has warnings.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No progress on standard error.")]
CAMERA_HELP = "Calibration: OpenCV, ROS camera_info, Kalibr, COLMAP, KITTI, Metashape and others."
POSE_HELP = "result.json, a matrix camera_from_world (.txt, .npy), or a pose of KITTI, Kalibr, tf, nuScenes and others."
CameraPath = Annotated[Path, typer.Option("--camera", help=CAMERA_HELP, show_default=False)]
CameraName = Annotated[
    str | None, typer.Option("--camera-name", help="Which camera, where the calibration holds several.")
]
CameraModel = Annotated[
    str | None,
    typer.Option(
        "--camera-model",
        help="pinhole, fisheye, unified, fov, ocam or equirectangular, where the calibration doesn't name it.",
        show_default=False,
    ),
]
Columns = Annotated[
    str | None,
    typer.Option(
        "--columns",
        help="Names of the columns of a .bin, .npy or text cloud, as x,y,z,intensity,_ (_ leaves one out).",
        show_default=False,
    ),
]
Rectified = Annotated[
    bool, typer.Option("--rectified", help="The photo was rectified: its camera has P of camera_info, no distortion.")
]
SegmenterName = Annotated[
    str | None,
    typer.Option(
        "--segmenter",
        metavar="MODULE:CALLABLE",
        help="Segmenter that proposes the masks; they are grown without it.",
        show_default=False,
    ),
]
PosePath = Annotated[Path, typer.Option("--pose", help=POSE_HELP, show_default=False)]
CameraPaths = Annotated[
    list[Path],
    typer.Option("--camera", help=f"{CAMERA_HELP} One for all images, or one for each.", show_default=False),
]
CameraNames = Annotated[
    list[str] | None,
    typer.Option(
        "--camera-name",
        help="Which camera, where the calibration holds several; one for all images, or one for each.",
        show_default=False,
    ),
]
PosePaths = Annotated[
    list[Path], typer.Option("--pose", help=f"{POSE_HELP} One for each image, in order.", show_default=False)
]


def scene_with(path: Path, segmenter: str | None) -> Scene:
    """The scene of a file, whose seeds in photos ask the segmenter that is named, if one is."""
    from regionpose.scene.loading import load_scene

    return asking(load_scene(path), segmenter)


def asking(scene: Scene, segmenter: str | None) -> Scene:
    """The scene, whose seeds in photos ask the segmenter that is named, if one is."""
    from dataclasses import replace

    if segmenter is None:
        return scene

    from regionpose.segment.segmenters import load_segmenter

    return replace(scene, segmenter=load_segmenter(segmenter))


def names_of(columns: str | None) -> list[str] | None:
    """The names of columns that `--columns` gives, with commas between."""
    return None if columns is None else [name.strip() for name in columns.split(",")]


def numbers_of(option: str, text: str | None, count: int, needed: str) -> tuple[float, ...]:
    """The `count` numbers that an option gives, with commas between; ValueError that names it otherwise."""
    if text is None:
        raise ValueError(f"{option}: found nothing; needed {needed}")
    try:
        numbers = tuple(float(word) for word in text.split(","))
    except ValueError as error:
        raise ValueError(f"{option}: found {text!r}; needed {needed}") from error
    if len(numbers) != count:
        raise ValueError(f"{option}: found {len(numbers)} numbers; needed {needed}")
    return numbers
