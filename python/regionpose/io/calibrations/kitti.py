"""KITTI calibrations: cameras of the object, odometry and raw data, and the lidar's pose."""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path

import numpy as np

from regionpose.cameras import Camera, PinholeCamera
from regionpose.io.calibrations.text import CalibrationText
from regionpose.validation.arrays import Array

PROJECTION = re.compile(r"(P\d|P_rect_\d\d)\s*:", re.MULTILINE)
RAW = re.compile(r"K_(\d\d)")
DEFAULTS = ("P2", "P_rect_02")

CAMERAS_FILE = "calib_cam_to_cam.txt"
"""Where the raw data have their cameras, beside the lidar's calib_velo_to_cam.txt."""

Entries = dict[str, tuple[int, list[str]]]
"""Line number (from 1) and words of each `name: words` line."""

ROTATION_TOLERANCE = 1e-3
"""Largest entry of R R^T - 1 of a rotation written with 7 digits or more, with room for files that round harder."""


def describes(source: CalibrationText) -> bool:
    """Whether a line holds a projection matrix under one of KITTI's names."""
    return PROJECTION.search(source.text) is not None


def describes_lidar(source: CalibrationText) -> bool:
    """Whether there are lines R: and T: of a sensor's place, as in calib_velo_to_cam.txt."""
    lidar = {text.partition(":")[0].strip(): len(text.partition(":")[2].split()) for text in source.lines}
    return lidar.get("R") == 9 and lidar.get("T") == 3


def read_camera(source: CalibrationText, name: str | None) -> Camera:
    """The camera whose projection matrix (rectified photos), or matrix K (photos as they were taken), is `name`."""
    entries = _entries(source)
    names = _cameras(source, entries)
    builders = {key: partial(_raw if RAW.fullmatch(key) else _rectified, source, entries, key) for key in names}
    return source.camera(builders, name, _default(names))


def load_lidar_pose(
    path: str | Path, name: str | None = None, *, cameras: str | Path | None = None
) -> tuple[Array, Array]:
    """Rotation (3, 3) and translation (3,), in meters, of the lidar's points into the camera `name` of KITTI files.

    `x_camera = rotation x_lidar + translation` for the camera that `load_camera(path, name)` gives. For a rectified
    camera that is `P [R0_rect 0; 0 1] [Tr; 0 1] x`: the rotation is that of `R0_rect Tr`, made exactly orthonormal, and
    the translation has the camera's own offset `K^-1 P[:, 3]` added. `Tr_velo_to_cam` (object data) or `Tr` (odometry,
    where R0_rect is contained in it) must be in the file.

    Raw data have the lidar's place in calib_velo_to_cam.txt and the cameras in calib_cam_to_cam.txt: `path` is the
    first, `cameras` the second, which stands beside it when left out. There a rectified camera turns by R_rect_00, and
    `K_02` is the camera of photos as they were taken, at R_02 and T_02.

    Raises
    ------
    CalibrationError
        For files without these, on counts that are wrong, and where `name` is not in them.
    """
    source = CalibrationText.read(path)
    if not describes(source) and describes_lidar(source):
        return _raw_lidar_pose(source, name, cameras)
    if not describes(source):
        raise source.error("projection matrices", "none", "P0 to P3 of a KITTI calibration")
    entries = _entries(source)
    names = _projections(entries)
    if any(RAW.fullmatch(key) for key in entries):
        raise source.error("lidar's pose", "the cameras of raw data", "calib_velo_to_cam.txt, which holds it")
    chosen = source.choice(names, name, _default(names))
    pose = _matrix(source, entries, "Tr_velo_to_cam" if "Tr_velo_to_cam" in entries else "Tr", (3, 4))
    if "R0_rect" in entries:
        pose = _matrix(source, entries, "R0_rect", (3, 3)) @ pose
    return _rotation(source, pose[:, :3]), pose[:, 3] + _offset(source, entries, chosen)


def _raw_lidar_pose(source: CalibrationText, name: str | None, cameras: str | Path | None) -> tuple[Array, Array]:
    """The same of raw data, of whose two files `source` holds the lidar's place."""
    beside = source.path.parent / CAMERAS_FILE if cameras is None else Path(cameras)
    if not beside.exists():
        needed = f"{beside}: the lidar's place is that of camera 00, which is turned by R_rect_00 of that file"
        raise source.error(CAMERAS_FILE, "no such file", needed)
    companion = CalibrationText.read(beside)
    lidar, entries = _entries(source), _entries(companion)
    names = _cameras(companion, entries)
    chosen = companion.choice(names, name, _default(names))
    rotation, translation = (
        _matrix(source, lidar, "R", (3, 3)),
        _matrix(source, lidar, "T", (3, 1))[:, 0],
    )
    raw = RAW.fullmatch(chosen)
    turn = _matrix(companion, entries, "R_rect_00" if raw is None else f"R_{raw[1]}", (3, 3))
    offset = (
        _offset(companion, entries, chosen) if raw is None else _matrix(companion, entries, f"T_{raw[1]}", (3, 1))[:, 0]
    )
    return _rotation(source, turn @ rotation), turn @ translation + offset


def _offset(source: CalibrationText, entries: Entries, name: str) -> Array:
    """A rectified camera's own offset, `K^-1 P[:, 3]`."""
    projection = _matrix(source, entries, name, (3, 4))
    try:
        return np.asarray(np.linalg.solve(projection[:, :3], projection[:, 3]))
    except np.linalg.LinAlgError as error:
        raise source.error("projection matrix", "one that is singular", "a camera's") from error


def _entries(source: CalibrationText) -> Entries:
    """Line number (from 1) and words of each `name: words` line."""
    entries: Entries = {}
    for line, text in enumerate(source.lines, start=1):
        key, colon, rest = text.partition(":")
        if colon and key.strip() in entries:
            raise source.error(key.strip(), "a second line of this name", "one", line)
        if colon:
            entries[key.strip()] = (line, rest.split())
    return entries


def _projections(entries: Entries) -> list[str]:
    return [key for key in entries if PROJECTION.fullmatch(f"{key}:")]


def _cameras(source: CalibrationText, entries: Entries) -> list[str]:
    """Names of the cameras: of rectified photos, then of photos as they were taken unless the former are selected."""
    return [*_projections(entries), *(key for key in entries if RAW.fullmatch(key) and not source.rectified)]


def _default(names: list[str]) -> str | None:
    return next((name for name in DEFAULTS if name in names), None)


def _rectified(source: CalibrationText, entries: Entries, name: str) -> Camera:
    projection = _matrix(source, entries, name, (3, 4))
    width, height = _size(source, entries, name.replace("P_rect", "S_rect"))
    return PinholeCamera.from_matrix(projection[:, :3], distortion=(), width=width, height=height)


def _raw(source: CalibrationText, entries: Entries, name: str) -> Camera:
    distortion = name.replace("K_", "D_")
    if distortion not in entries:
        raise source.error(distortion, "no such line", "5 numbers")
    line, words = entries[distortion]
    width, height = _size(source, entries, name.replace("K_", "S_"))
    return PinholeCamera.from_matrix(
        _matrix(source, entries, name, (3, 3)),
        distortion=source.numbers(distortion, words, 5, line),
        width=width,
        height=height,
    )


def _size(source: CalibrationText, entries: Entries, name: str) -> tuple[int | None, int | None]:
    """Width and height in the line `name`, None where there is none."""
    if not name.startswith("S_") or name not in entries:
        return None, None
    line, words = entries[name]
    source.numbers(name, words, 2, line)
    width, height = (source.whole_number(name, word, line) for word in words)
    return width, height


def _matrix(source: CalibrationText, entries: Entries, name: str, shape: tuple[int, int]) -> Array:
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
