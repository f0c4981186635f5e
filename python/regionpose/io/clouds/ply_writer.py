"""Writing clouds as PLY without loss."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from regionpose.io.clouds.cloud import Cloud, Scalars
from regionpose.io.clouds.columns import COLOR_NAMES, COORDINATES
from regionpose.io.clouds.errors import cloud_error
from regionpose.io.outputs.whole_file import whole_file
from regionpose.validation.arguments import checked_arguments

ROWS_AT_ONCE = 262_144
"""Points formatted at a time, so that the file needs no second copy of the cloud in memory."""

LARGEST_WHOLE = 2**53
"""Whole numbers up to this are doubles without rounding."""

COLORS = COLOR_NAMES[0]


@checked_arguments
def write_ply(path: str | Path, cloud: Cloud, *, overwrite: bool = False) -> Path:
    """The path of the PLY file written: binary little-endian, world coordinates as doubles.

    Colors are uchar red, green, blue; intensity and the fields are doubles, white space in their names underscores;
    triangles are a face element. The file appears whole or not at all.

    Parameters
    ----------
    path : str or Path
        Of the file.
    cloud : Cloud
        What it holds.
    overwrite : bool
        Replace a file that exists; False by default.

    Raises
    ------
    FileExistsError
        Where it exists, unless `overwrite`.
    CloudError
        A ValueError, for two columns of one name, a name that is not ASCII, and integers that no double holds.
    """
    location = Path(path)
    columns = _scalar_columns(location, cloud)
    row = np.dtype(
        [(name, "<f8") for name in COORDINATES]
        + ([(name, "u1") for name in COLORS] if cloud.colors is not None else [])
        + [(name, "<f8") for name in columns]
    )
    with whole_file(location, overwrite=overwrite) as file:
        file.write(_header(row, cloud).encode("ascii"))
        for start in range(0, len(cloud), ROWS_AT_ONCE):
            file.write(_rows(cloud, columns, row, slice(start, start + ROWS_AT_ONCE)).data)
        if cloud.triangles is not None:
            faces = np.empty(len(cloud.triangles), dtype=[("count", "u1"), ("indices", "<i4", 3)])
            faces["count"], faces["indices"] = 3, cloud.triangles
            file.write(faces.data)
    return location


def _scalar_columns(path: Path, cloud: Cloud) -> dict[str, Scalars]:
    """Intensity and fields by their names in the file."""
    columns: dict[str, Scalars] = {} if cloud.intensity is None else {"intensity": cloud.intensity}
    taken = {*COORDINATES, *(COLORS if cloud.colors is not None else ()), *columns}
    for given, values in cloud.fields.items():
        name = "_".join(given.split())
        if name in taken:
            raise cloud_error(path, f"field {given!r}", f"a second column {name}", "names that differ")
        if not name or not name.isascii() or not name.isprintable():
            raise cloud_error(path, f"field {given!r}", "a name that PLY cannot hold", "printable ASCII")
        if values.dtype.kind in "iu" and (values.max() > LARGEST_WHOLE or values.min() < -LARGEST_WHOLE):
            raise cloud_error(
                path, f"field {given!r}", "integers above 2^53", "numbers that a double holds, or no such field"
            )
        taken.add(name)
        columns[name] = values
    return columns


def _header(row: np.dtype[np.void], cloud: Cloud) -> str:
    """The header of a file with points of the type `row`."""
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(cloud)}"]
    lines += [f"property {'uchar' if row[name] == np.uint8 else 'double'} {name}" for name in row.names or ()]
    if cloud.triangles is not None:
        lines += [f"element face {len(cloud.triangles)}", "property list uchar int vertex_indices"]
    return "\n".join([*lines, "end_header", ""])


def _rows(cloud: Cloud, columns: Mapping[str, Scalars], row: np.dtype[np.void], part: slice) -> Scalars:
    """The points of `part` as the file holds them."""
    rows = np.empty(len(cloud.local_points[part]), dtype=row)
    for axis, name in enumerate(COORDINATES):
        rows[name] = cloud.local_points[part, axis] + cloud.origin[axis]
    if cloud.colors is not None:
        for channel, name in enumerate(COLORS):
            rows[name] = cloud.colors[part, channel]
    for name, values in columns.items():
        rows[name] = values[part]
    return rows
