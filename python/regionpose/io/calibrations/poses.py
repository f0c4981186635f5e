"""Poses read from the files that this and other tools write.

No direction and no order of a quaternion is guessed: it is what the tool that writes the file defines, and stated in
the `convention` of the pose; a file of none of them is refused.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from regionpose.geometry.pose import Pose
from regionpose.io.calibrations import opencalib
from regionpose.io.calibrations.colmap import describes_images, image_pose
from regionpose.io.calibrations.kitti import describes as describes_kitti
from regionpose.io.calibrations.kitti import describes_lidar, load_lidar_pose
from regionpose.io.calibrations.pose_records import RECORDS, PoseRecord, is_unordered
from regionpose.io.calibrations.pose_values import pose_of_matrix
from regionpose.io.calibrations.text import CalibrationText
from regionpose.io.calibrations.yaml_items import parsed
from regionpose.io.reading import read_array, read_json
from regionpose.io.yaml_text import MappingNode, Node, ScalarNode, SequenceNode

NEEDED = (
    "result.json, a 3 x 4 or 4 x 4 matrix camera_from_world (.txt with blanks or commas, .npy), a KITTI calibration"
    " with Tr, KITTI's calib_velo_to_cam.txt, OpenCalib's calib.txt with T, COLMAP's images.txt, or YAML or JSON with"
    " one of: " + ", ".join(record.label for record in RECORDS)
)

RESULT = RECORDS[0].label
MATRIX = "matrix"
"""The kind of a file that holds 12 or 16 numbers and nothing else."""

Array = np.ndarray[Any, Any]


@dataclass(frozen=True)
class PoseSource:
    """Further sources of a pose: the camera's name, its calibration file and its photo, None where it is not."""

    camera_name: str | None = None
    camera_file: Path | None = None
    image: str | None = None


@dataclass(frozen=True, eq=False)
class PoseFile:
    """The pose `camera_from_world` of a file, what wrote it, and its convention in words: frames, direction, order."""

    pose: Pose
    kind: str
    convention: str

    @property
    def remark(self) -> str | None:
        """What a reader of another tool's pose is to know of it; None for this tool's own files and for matrices."""
        return None if self.kind in {MATRIX, RESULT} else f"{self.kind}: {self.convention}"


def read_pose(path: str | Path, source: PoseSource | None = None) -> Pose:
    """The pose `camera_from_world` of a file of this or another tool (docs/reference/calibrations.md).

    Parameters
    ----------
    path : str or Path
        Of the file.
    source : PoseSource, optional
        Which of several poses: the camera's name, its calibration file, or its photo.

    Raises
    ------
    FileNotFoundError
        Where it is missing.
    ValueError
        Where it holds no pose, several to choose from, or one whose direction or order of numbers it does not state.
    """
    return read_pose_file(Path(path), source).pose


def read_pose_file(path: Path, source: PoseSource | None = None) -> PoseFile:
    """The pose of a file, and what it is.

    FileNotFoundError, or ValueError where it holds none, several to choose from, or one whose direction or order of
    numbers it does not state.
    """
    source = source or PoseSource()
    suffix = path.suffix.lower()
    if suffix == ".npy":
        return _matrix(path, read_array(path))
    if suffix == ".json":
        return _record(path, read_json(path), source)
    return _text(path, source)


def _text(path: Path, source: PoseSource) -> PoseFile:
    """The pose of a text: KITTI's, OpenCalib's or COLMAP's, numbers alone, or YAML."""
    text = CalibrationText.read(path, what="pose")
    if describes_kitti(text):
        parts = load_lidar_pose(path, source.camera_name)
        return PoseFile(Pose.from_parts(*parts), "KITTI calibration", "takes the lidar's points to the camera")
    if describes_lidar(text):
        cameras = source.camera_file
        beside = cameras if cameras is not None and describes_kitti(CalibrationText.read(cameras)) else None
        parts = load_lidar_pose(path, source.camera_name, cameras=beside)
        convention = "takes the lidar's points to the camera, by the cameras of calib_cam_to_cam.txt"
        return PoseFile(Pose.from_parts(*parts), "KITTI calib_velo_to_cam.txt", convention)
    if opencalib.describes_text(text):
        pose = pose_of_matrix(path, opencalib.text_pose(text), NEEDED)
        return PoseFile(pose, "OpenCalib calib.txt", "T takes the lidar's points to the camera")
    if describes_images(text):
        pose = image_pose(text, source.image or source.camera_name)
        return PoseFile(pose, "COLMAP images.txt", "takes points of COLMAP's world to the camera, quaternion w x y z")
    return _numbers(path, text) if _is_numeric(text) else _yaml(path, text, source)


def _is_numeric(text: CalibrationText) -> bool:
    """Whether the first word that is no comment is a number."""
    words = next((words for line in text.lines if (words := _words(line))), [])
    try:
        float(words[0])
    except (ValueError, IndexError):
        return False
    return True


def _words(line: str) -> list[str]:
    return line.partition("#")[0].translate(str.maketrans(",;[]()", "      ")).split()


def _numbers(path: Path, text: CalibrationText) -> PoseFile:
    rows = enumerate((_words(line) for line in text.lines), start=1)
    return _matrix(path, np.array([text.number("matrix", word, line) for line, row in rows for word in row]))


def _matrix(path: Path, matrix: Array) -> PoseFile:
    convention = "takes points of the world to the camera: x right, y down, z forward"
    return PoseFile(pose_of_matrix(path, matrix, NEEDED), MATRIX, convention)


def _yaml(path: Path, text: CalibrationText, source: PoseSource) -> PoseFile:
    root = parsed(text)
    return _record(path, None if root is None else _plain(root.node), source)


def _plain(node: Node) -> Any:
    """Mappings, lists and words of a node; aliases, which unfold without end, are refused where they are read."""
    visited: set[int] = set()

    def value(one: Node) -> Any:
        if isinstance(one, ScalarNode):
            return str(one.value)
        if id(one) in visited:
            return None
        visited.add(id(one))
        if isinstance(one, SequenceNode):
            return [value(child) for child in one.value]
        assert isinstance(one, MappingNode)
        return {str(key.value): value(child) for key, child in one.value}

    return value(node)


def _record(path: Path, value: Any, source: PoseSource) -> PoseFile:
    """The pose of a value of YAML or JSON: of the first kind that describes it."""
    for record in RECORDS:
        found = _holder(record, value)
        if found is not None:
            names = (source.image, source.camera_name)
            matrix, convention = record.read(path, found, tuple(name for name in names if name is not None))
            pose = matrix if isinstance(matrix, Pose) else pose_of_matrix(path, matrix, NEEDED)
            return PoseFile(pose, record.label, convention)
    if is_unordered(value):
        raise ValueError(
            f"{path}: extrinsics.rotation: found four numbers of a quaternion, but not whether w is the first of them"
            " or the last; needed the matrix camera_from_lidar, 3 x 4, as text, or T_lidar_camera: [x, y, z, qx, qy,"
            " qz, qw]"
        )
    raise ValueError(f"{path}: found {_described(value)}; needed {NEEDED}")


def _holder(record: PoseRecord, value: Any) -> Any:
    """The value itself, or what it holds right inside, that a kind describes; None where none does."""
    inside = list(value.values()) if isinstance(value, dict) else []
    return next((one for one in [value, *inside] if record.describes(one)), None)


def _described(value: Any) -> str:
    if isinstance(value, dict):
        names = [str(name) for name in list(value)[:8]]
        return f"no pose of a known kind, but the items {', '.join(names)}" if names else "nothing"
    return f"no pose of a known kind, but a {type(value).__name__}"
