"""Reading E57 through pye57 (extra `e57`)."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from regionpose.io.clouds.cloud import Cloud, Scalars
from regionpose.io.clouds.columns import COORDINATES, cloud_of_columns
from regionpose.io.clouds.errors import CloudError, cloud_error
from regionpose.io.clouds.pieces import PIECE_POINTS
from regionpose.io.reading import unfolding_error
from regionpose.progress import Progress, part
from regionpose.validation.arrays import Array
from regionpose.validation.extras import load_extra

CARTESIAN = ("cartesianX", "cartesianY", "cartesianZ")
SPHERICAL = ("sphericalRange", "sphericalAzimuth", "sphericalElevation")
INVALID = ("cartesianInvalidState", "sphericalInvalidState")
COLORS = {"colorRed": "red", "colorGreen": "green", "colorBlue": "blue"}
OTHERS = {"intensity": "intensity", "rowIndex": "row", "columnIndex": "column", "timeStamp": "time"}

SCAN = "scan"
"""The field that numbers the scans of a file with several, from 0."""

MOST_CELLS = 100
"""Cells of a grid for each point that is there: fewer returns than one in a hundred are no scan's. A convention, which
bounds what a damaged index makes of a grid."""


def read_e57(path: Path, *, progress: Progress | None = None) -> Cloud:
    """The cloud of an E57 file: all its scans in the file's frame, each by its own pose.

    Points marked invalid are dropped. Colors and intensity are kept where every scan has them. A single scan's
    pose is where the scanner stood, unless it is the identity, which merged scans have too.
    """
    pye57 = load_extra("pye57", "e57", f"{path}: E57")
    try:
        # pye57.E57 would try to delete a file that does not open.
        image = pye57.libe57.ImageFile(str(path), "r")
        try:
            scans, places = _scans(pye57, image, path, progress)
        finally:
            image.close()
    except CloudError:
        raise
    # Damage shows as the library's own errors, each of its own type.
    except Exception as error:
        raise cloud_error(path, "scans", f"{type(error).__name__}: {error}", "a whole E57 file") from error
    cloud = _joined(path, scans)
    return cloud if len(places) > 1 or places[0] is None else cloud.scanned_from(places[0])


def _scans(
    pye57: Any, image: Any, path: Path, progress: Progress | None
) -> tuple[list[dict[str, Scalars]], list[Array | None]]:
    """The columns of each scan of an open file, and where its scanner stood; CloudError for more than is likely."""
    nodes = [image.root()["data3D"][index] for index in range(len(image.root()["data3D"]))]
    headers = [pye57.ScanHeader(node) for node in nodes]
    values = sum(int(header.point_count) * len(header.point_fields) for header in headers)
    wrong = unfolding_error(path, values * np.dtype(np.float64).itemsize)
    if wrong is not None:
        raise CloudError(f"{path}: scans: {wrong}")
    headers_with_progress = zip(headers, _parts(headers, progress), strict=True)
    return [_scan(pye57, image, header, fraction) for header, fraction in headers_with_progress], [
        _place(header) for header in headers
    ]


def _joined(path: Path, scans: list[dict[str, Scalars]]) -> Cloud:
    """The cloud of all scans: the columns that they share, and which scan a point is of where there are several."""
    if not scans:
        raise cloud_error(path, "scans", "none", "at least 1")
    if len(scans) > 1:
        scans = [scan | {SCAN: np.full(len(scan["x"]), index)} for index, scan in enumerate(scans)]
    shared = [name for name in scans[0] if all(name in scan for scan in scans)]
    shape, cells = _grid(scans[0]) if len(scans) == 1 else (None, None)
    columns = {name: np.concatenate([scan[name] for scan in scans]) for name in shared}
    return cloud_of_columns(path, columns, grid_shape=shape, grid_indices=cells)


def _grid(scan: dict[str, Scalars]) -> tuple[tuple[int, int] | None, Scalars | None]:
    """Rows and columns of a scan's grid and the cell of each point, by its indices of rows and columns; None without,
    and where several returns share a cell.
    """
    if "row" not in scan or "column" not in scan or not len(scan["row"]):
        return None, None
    row, column = (scan[name].astype(np.int64) for name in ("row", "column"))
    row, column = row - row.min(), column - column.min()
    shape = int(row.max()) + 1, int(column.max()) + 1
    cells = row * shape[1] + column
    is_grid = min(shape) > 1 and len(np.unique(cells)) == len(cells) and shape[0] * shape[1] <= MOST_CELLS * len(cells)
    return (shape, cells) if is_grid else (None, None)


def _parts(headers: list[Any], progress: Progress | None) -> list[Progress | None]:
    """The progress callback of each scan, weighted by its number of points."""
    ends = np.cumsum([0, *(int(header.point_count) for header in headers)])
    total = max(1, int(ends[-1]))
    return [part(progress, start / total, end / total) for start, end in pairwise(ends.tolist())]


def _place(header: Any) -> Array | None:
    """Where the scanner of a scan stood in the file's frame, (3,); None without a pose that anyone set."""
    if not header.has_pose():
        return None
    place = np.array(header.translation, dtype=np.float64)
    is_set = place.any() or not np.array_equal(header.rotation_matrix, np.eye(3))
    return place if is_set else None


def _scan(pye57: Any, image: Any, header: Any, progress: Progress | None) -> dict[str, Scalars]:
    """The columns of one scan, with its coordinates in the file's frame."""
    wanted = [*CARTESIAN, *SPHERICAL, *INVALID, *COLORS, *OTHERS]
    raw = _raw_columns(pye57, image, header, [name for name in header.point_fields if name in wanted], progress)
    points = _points(raw)
    for name in INVALID:
        if name in raw:
            points[raw[name] != 0] = np.nan
    # In the scan's own frame zeros are beams without a return; in the file's they lie where the scanner stood.
    points[~points.any(axis=1)] = np.nan
    if header.has_pose():
        points = points @ header.rotation_matrix.T + header.translation
    scan: dict[str, Scalars] = {axis: points[:, index] for index, axis in enumerate(COORDINATES)}
    if set(COLORS) <= set(raw):
        scan |= _colors(header, raw)
    return scan | {OTHERS[name]: raw[name] for name in OTHERS if name in raw}


def _raw_columns(pye57: Any, image: Any, header: Any, names: list[str], progress: Progress | None) -> dict[str, Array]:
    """The columns `names` of a scan as the file holds them, all as float64."""
    count = int(header.point_count)
    raw = {name: np.empty(count) for name in names}
    pieces = {name: np.empty(min(count, PIECE_POINTS)) for name in names}
    buffers = pye57.libe57.VectorSourceDestBuffer()
    for name, values in pieces.items():
        buffers.append(pye57.libe57.SourceDestBuffer(image, name, values, len(values), True, True))
    reader, read = header.points.reader(buffers), 0
    while read < count and (more := reader.read()):
        for name, values in pieces.items():
            raw[name][read : read + more] = values[:more]
        read += more
        if progress is not None:
            progress(read / count)
    reader.close()
    if read != count:
        raise ValueError(f"{read} points instead of {count}")
    return raw


def _points(raw: dict[str, Array]) -> Array:
    """Cartesian points (n, 3) in the scan's frame, from range, azimuth and elevation where these are stored."""
    if set(CARTESIAN) <= set(raw):
        return np.stack([raw[name] for name in CARTESIAN], axis=1)
    if not set(SPHERICAL) <= set(raw):
        raise ValueError(f"a scan with {', '.join(raw) or 'nothing'} and no whole coordinates")
    distance, azimuth, elevation = (raw[name] for name in SPHERICAL)
    level = distance * np.cos(elevation)
    return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), distance * np.sin(elevation)], axis=1)


def _colors(header: Any, raw: dict[str, Array]) -> dict[str, Scalars]:
    """Colors of 8 bits by the limits that the scan states; as they are without limits."""
    colors: dict[str, Scalars] = {}
    limited = "colorLimits" in header.scan_fields
    for name, own in COLORS.items():
        most = float(header["colorLimits"][f"{name}Maximum"].value()) if limited else 255.0
        colors[own] = np.rint(np.clip(raw[name] / (most or 255.0), 0.0, 1.0) * 255.0).astype(np.uint8)
    return colors
