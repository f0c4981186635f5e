"""Poses read from the files that this and other tools write."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from regionpose.pose import Pose
from regionpose.reading import read_array, read_json

NEEDED = (
    "result.json, a 3 x 4 or 4 x 4 matrix camera_from_world (.txt, .npy), "
    "calib.json of direct_visual_lidar_calibration (T_lidar_camera), or a KITTI calibration with Tr"
)

LIKE_ROTATION = 1e-3
"""Largest entry of R^T R - 1 of a rotation written with few digits, which is then made exact."""


LEAST_NORM = 1e-6
"""Length of a quaternion below which it tells no rotation; written ones have 1."""


def read_pose(path: Path, camera_name: str | None = None) -> Pose:
    """The pose camera_from_world of a file; FileNotFoundError, or ValueError where it holds none."""
    if path.suffix.lower() == ".json":
        return _json_pose(path)
    if path.suffix.lower() == ".npy":
        return _matrix_pose(path, read_array(path))
    return _text_pose(path, camera_name)


def _text_pose(path: Path, camera_name: str | None) -> Pose:
    """The pose of a KITTI calibration, or of a matrix in numbers separated by white space."""
    from regionpose.calibration import load_lidar_pose
    from regionpose.calibration.kitti import describes
    from regionpose.calibration.text import CalibrationText

    source = CalibrationText.read(path, what="pose")
    if describes(source):
        return Pose.from_parts(*load_lidar_pose(path, camera_name))
    rows = (text.partition("#")[0].split() for text in source.lines)
    numbers = [source.number("matrix", word, line) for line, row in enumerate(rows, start=1) for word in row]
    return _matrix_pose(path, np.array(numbers))


def _json_pose(path: Path) -> Pose:
    held = read_json(path)
    held = held if isinstance(held, dict) else {}
    for holder in (held, held.get("results"), held.get("exports")):
        pose = _pose_of(path, holder) if isinstance(holder, dict) else None
        if pose is not None:
            return pose
    raise ValueError(f"{path}: found no camera_from_world and no T_lidar_camera; needed {NEEDED}")


def _pose_of(path: Path, held: dict[str, Any]) -> Pose | None:
    """The pose of an object that holds one."""
    from scipy.spatial.transform import Rotation

    stored = held.get("camera_from_world")
    if isinstance(stored, dict) and "matrix" in stored:
        return _matrix_pose(path, _numbers(path, "camera_from_world.matrix", stored["matrix"]))
    if "T_lidar_camera" not in held:
        return None
    numbers = _numbers(path, "T_lidar_camera", held["T_lidar_camera"])
    if numbers.shape != (7,) or not np.isfinite(numbers).all() or np.linalg.norm(numbers[3:]) < LEAST_NORM:
        raise ValueError(f"{path}: T_lidar_camera: found {numbers.tolist()}; needed [tx, ty, tz, qx, qy, qz, qw]")
    return Pose(Rotation.from_quat(numbers[3:]), numbers[:3]).inverse()


def _numbers(path: Path, item: str, values: object) -> np.ndarray[Any, Any]:
    """The numbers that lists of a file hold."""
    try:
        return np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise ValueError(f"{path}: {item}: found something else than numbers; needed {NEEDED}") from error


def _matrix_pose(path: Path, matrix: np.ndarray[Any, Any]) -> Pose:
    """The pose of [R t], by 12 or 16 numbers in any arrangement of rows."""
    from scipy.spatial.transform import Rotation

    if matrix.size not in {12, 16} or matrix.dtype.kind not in "iuf":
        raise ValueError(f"{path}: found {matrix.size} values of type {matrix.dtype}; needed {NEEDED}")
    if not np.isfinite(matrix).all():
        raise ValueError(f"{path}: found numbers that aren't finite; needed finite ones")
    rows = matrix.reshape(-1, 4).astype(np.float64)
    rotation = rows[:3, :3]
    defect = float(np.abs(rotation.T @ rotation - np.eye(3)).max())
    if defect > LIKE_ROTATION or np.linalg.det(rotation) < 0.0:
        raise ValueError(f"{path}: found |R^T R - 1| = {defect:.1e}; needed a rotation and a translation [R t]")
    return Pose(Rotation.from_matrix(rotation), rows[:3, 3])
