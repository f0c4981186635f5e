"""The bare float32 rows of KITTI, nuScenes, Waymo and the like, whose files do not name their columns."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from regionpose.io.clouds.cloud import Cloud, Scalars
from regionpose.io.clouds.columns import COORDINATES, are_bytes, checked_names, cloud_of_table, guessed_names
from regionpose.io.clouds.errors import cloud_error
from regionpose.io.clouds.pieces import file_bytes
from regionpose.io.clouds.row_width import NARROWEST, WIDEST, WIDEST_FOUND, row_width
from regionpose.progress import Progress

NUSCENES_ENDING, NUSCENES_WIDTH = ".pcd.bin", 5

INTENSITY = 3
"""The column that is the intensity in rows of 4 to 6 numbers, unless these are colors or normals."""

NORMAL_TOLERANCE = 1e-3
"""How far from 1 the length of a normal in single precision is, as files round it: a convention."""

FARTHEST_RETURN = 100_000.0
"""Coordinates of bare rows are within this (meters) of the scanner; any other bytes read as floats exceed it soon."""

COLUMNS_NEEDED = (
    "the names of the columns, such as x,y,z,intensity,_ (columns; cloud: {file, columns: [...]} in a scene file)"
)


def read_bin(path: Path, columns: Sequence[str] | None, *, progress: Progress | None = None) -> Cloud:
    """The cloud of bare little-endian float32 rows: x, y, z and what else was measured, in the scanner's own frame.

    How many numbers a row has is found in the values (`row_width`), or by a name that ends in .pcd.bin, as nuScenes'
    own, which have 5. CloudError where it stays open, or the values contradict the name; `columns` decides.
    """
    data = file_bytes(path, progress=progress)
    if len(data) % 4:
        raise cloud_error(path, "size", f"{len(data)} bytes", "a multiple of 4: rows of float32")
    values = data.view("<f4")
    names = None if columns is None else checked_names(path, columns)
    width = _width(path, values) if names is None else len(names)
    if len(values) % width:
        raise cloud_error(path, "size", f"{len(data)} bytes", f"a multiple of {4 * width}: rows of {width} float32")
    table = values.reshape(-1, width)
    cloud = cloud_of_table(path, table, _names(table) if names is None else names)
    points = cloud.points
    farthest = float(max(points.max(), -points.min()))
    if farthest > FARTHEST_RETURN:
        needed = f"float32 within {FARTHEST_RETURN:.0f} m of the scanner"
        raise cloud_error(path, "coordinates", f"{farthest:.3g}", needed)
    return cloud.scanned_from(np.zeros(3))


def _width(path: Path, values: Scalars) -> int:
    """The numbers of a row, by the values and the name's ending; CloudError where these leave it open."""
    found, fitting = row_width(values)
    if path.name.lower().endswith(NUSCENES_ENDING):
        if found not in (None, NUSCENES_WIDTH):
            conflict = f"values in rows of {found}, and the ending {NUSCENES_ENDING} of rows of {NUSCENES_WIDTH}"
            raise cloud_error(path, "columns", conflict, COLUMNS_NEEDED)
        return NUSCENES_WIDTH
    if found is not None:
        return found
    listed = ", ".join(map(str, fitting)) or f"none of {NARROWEST} to {WIDEST}"
    unclear = f"{len(values)} numbers, in which no rows of {NARROWEST} to {WIDEST_FOUND} stand out"
    raise cloud_error(path, "columns", f"{unclear}; rows of {listed} would fit", COLUMNS_NEEDED)


def _names(table: Scalars) -> list[str]:
    """Names of the columns of rows (n, k)."""
    width, names = table.shape[1], guessed_names(table)
    if width == 2 * len(COORDINATES) and _are_normals(table[:, INTENSITY:]):
        names[INTENSITY:] = ["normal_x", "normal_y", "normal_z"]
    elif INTENSITY < width <= 6 and names[INTENSITY] == f"column_{INTENSITY + 1}":
        names[INTENSITY] = "intensity"
    if width == NUSCENES_WIDTH and are_bytes(table[:, 4]):
        names[4] = "ring"
    return names


def _are_normals(rows: Scalars) -> bool:
    """Whether the finite ones of the rows (n, 3) are of length 1."""
    lengths = np.linalg.norm(rows, axis=1)
    return bool(np.all(np.abs(lengths[np.isfinite(lengths)] - 1.0) < NORMAL_TOLERANCE))
