"""Numbers of poses as files hold them, checked."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from regionpose.geometry.pose import Pose

LIKE_ROTATION = 1e-3
"""Largest entry of R^T R - 1 of a rotation written with few digits, which is then made exact."""

LEAST_NORM = 1e-6
"""Length of a quaternion below which it is no rotation; unit quaternions have 1."""

Array = np.ndarray[Any, Any]
Names = tuple[str, ...]
"""What the photo and the camera are called, where that is known, to choose among poses."""

Read = tuple[Array | Pose, str]
"""A pose or its matrix, and its convention in words."""


def numbers_of(path: Path, item: str, values: object, count: int | None = None) -> Array:
    """The numbers that lists of a file hold, `count` of them in a row where that is given; ValueError otherwise."""
    if isinstance(values, Mapping) and "data" in values:
        values = values["data"]
    try:
        numbers = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise ValueError(f"{path}: {item}: found something else than numbers; needed numbers in lists") from error
    if count is not None and numbers.size != count:
        raise ValueError(f"{path}: {item}: found {numbers.size} numbers; needed {count}")
    if not np.isfinite(numbers).all():
        raise ValueError(f"{path}: {item}: found numbers that aren't finite; needed finite ones")
    return numbers if count is None else numbers.ravel()


def pose_of_matrix(path: Path, matrix: Array, needed: str) -> Pose:
    """The pose of [R t], by 12 or 16 numbers in any arrangement of rows."""
    from scipy.spatial.transform import Rotation

    if matrix.size not in {12, 16} or matrix.dtype.kind not in "iuf":
        raise ValueError(f"{path}: found {matrix.size} values of type {matrix.dtype}; needed {needed}")
    if not np.isfinite(matrix).all():
        raise ValueError(f"{path}: found numbers that aren't finite; needed finite ones")
    rows = matrix.reshape(-1, 4).astype(np.float64)
    rotation = rows[:3, :3]
    defect = float(np.abs(rotation.T @ rotation - np.eye(3)).max())
    if defect > LIKE_ROTATION or np.linalg.det(rotation) < 0.0:
        raise ValueError(f"{path}: found |R^T R - 1| = {defect:.1e}; needed a rotation and a translation [R t]")
    return Pose(Rotation.from_matrix(rotation), rows[:3, 3])


def pose_of_quaternion(path: Path, item: str, xyzw: Array, translation: Array) -> Pose:
    """The pose of a quaternion, which is made a unit one; ValueError for zeros."""
    from scipy.spatial.transform import Rotation

    if np.linalg.norm(xyzw) < LEAST_NORM:
        raise ValueError(f"{path}: {item}: found a quaternion of zeros; needed one of length 1")
    return Pose(Rotation.from_quat(xyzw), translation)


def chosen(path: Path, items: Mapping[str, Any], names: Names, what: str) -> Any:
    """The only item, or the one that is called as the photo or the camera is."""
    found = [items[name] for name in names if name in items]
    if not found and len(items) == 1:
        found = list(items.values())
    if not found:
        listed = ", ".join(list(items)[:20]) + (", ..." if len(items) > 20 else "")
        raise ValueError(f"{path}: {what}: found {len(items)}; needed a name, one of {listed}")
    return found[0]
