"""KITTI calibrations: rectified cameras of the object, odometry and raw data, and the lidar's pose."""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path

import numpy as np

from regionpose.calibration.text import CalibrationText
from regionpose.cameras import Camera, PinholeCamera
from regionpose.cameras.base import Array

PROJECTION = re.compile(r"(P\d|P_rect_\d\d)\s*:", re.MULTILINE)
DEFAULTS = ("P2", "P_rect_02")

ROTATION_TOLERANCE = 1e-3
"""Largest entry of R R^T - 1 of a rotation written with 7 digits or more, with room for files that round harder."""


def describes(source: CalibrationText) -> bool:
    """Whether a line holds a projection matrix under one of KITTI's names."""
    return PROJECTION.search(source.text) is not None


def read_camera(source: CalibrationText, name: str | None) -> Camera:
    """The rectified camera whose projection matrix is called `name`."""
    entries = _entries(source)
    names = _projections(entries)
    builders = {key: partial(_camera, source, entries, key) for key in names}
    return source.camera(builders, name, _default(names))


def load_lidar_pose(path: str | Path, name: str | None = None) -> tuple[Array, Array]:
    """Rotation (3, 3) and translation (3,), in meters, of the lidar's points into the camera `name` of a KITTI file.

    `x_camera = rotation x_lidar + translation` for the rectified camera that `load_camera(path, name)` gives, by
    `P [R0_rect 0; 0 1] [Tr; 0 1] x`: the rotation is that of `R0_rect Tr`, made exactly orthonormal, and the
    translation has the camera's own offset `K^-1 P[:, 3]` added. `Tr_velo_to_cam` (object data) or `Tr` (odometry,
    where R0_rect is contained in it) must be in the file. CalibrationError otherwise, and on counts that are wrong.
    """
    source = CalibrationText.read(path)
    if not describes(source):
        raise source.error("projection matrices", "none", "P0 to P3 of a KITTI calibration")
    entries = _entries(source)
    names = _projections(entries)
    projection = _matrix(source, entries, source.choice(names, name, _default(names)), (3, 4))
    pose = _matrix(source, entries, "Tr_velo_to_cam" if "Tr_velo_to_cam" in entries else "Tr", (3, 4))
    if "R0_rect" in entries:
        pose = _matrix(source, entries, "R0_rect", (3, 3)) @ pose
    try:
        offset = np.linalg.solve(projection[:, :3], projection[:, 3])
    except np.linalg.LinAlgError as error:
        raise source.error("projection matrix", "one that is singular", "a camera's") from error
    return _rotation(source, pose[:, :3]), pose[:, 3] + offset


def _entries(source: CalibrationText) -> dict[str, tuple[int, list[str]]]:
    """Line number (from 1) and words of each `name: words` line."""
    entries: dict[str, tuple[int, list[str]]] = {}
    for line, text in enumerate(source.lines, start=1):
        key, colon, rest = text.partition(":")
        if colon and key.strip() in entries:
            raise source.error(key.strip(), "a second line of this name", "one", line)
        if colon:
            entries[key.strip()] = (line, rest.split())
    return entries


def _projections(entries: dict[str, tuple[int, list[str]]]) -> list[str]:
    return [key for key in entries if PROJECTION.fullmatch(f"{key}:")]


def _default(names: list[str]) -> str | None:
    return next((name for name in DEFAULTS if name in names), None)


def _camera(source: CalibrationText, entries: dict[str, tuple[int, list[str]]], name: str) -> Camera:
    projection = _matrix(source, entries, name, (3, 4))
    width, height = None, None
    size = name.replace("P_rect", "S_rect")
    if size != name and size in entries:
        line, words = entries[size]
        source.numbers(size, words, 2, line)
        width, height = (source.whole_number(size, word, line) for word in words)
    return PinholeCamera.from_matrix(projection[:, :3], distortion=(), width=width, height=height)


def _matrix(
    source: CalibrationText, entries: dict[str, tuple[int, list[str]]], name: str, shape: tuple[int, int]
) -> Array:
    """The matrix called `name`, row by row."""
    if name not in entries:
        raise source.error(name, "no such line", f"{shape[0] * shape[1]} numbers")
    line, words = entries[name]
    return np.reshape(source.numbers(name, words, shape[0] * shape[1], line), shape)


def _rotation(source: CalibrationText, matrix: Array) -> Array:
    """The rotation nearest to `matrix`."""
    deviation = float(np.abs(matrix @ matrix.T - np.eye(3)).max())
    if deviation > ROTATION_TOLERANCE or np.linalg.det(matrix) < 0.0:
        raise source.error("lidar rotation", f"a matrix {deviation:.1e} off orthonormal", "a rotation")
    left, _, right = np.linalg.svd(matrix)
    return np.asarray(left @ right)
