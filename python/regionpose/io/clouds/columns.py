"""From named columns of a file to a cloud."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from regionpose.io.clouds.cloud import BYTE_LIMIT, Cloud, Scalars
from regionpose.io.clouds.errors import cloud_error

SKIPPED = "_"
"""The name of a column that is not read."""

COORDINATES = ("x", "y", "z")
COLOR_NAMES = (("red", "green", "blue"), ("r", "g", "b"), ("diffuse_red", "diffuse_green", "diffuse_blue"))
INTENSITY_NAMES = ("intensity", "scalar_intensity", "reflectance", "scalar_reflectance")


def cloud_of_columns(
    path: Path,
    columns: Mapping[str, Scalars],
    triangles: ArrayLike | None = None,
    grid_shape: tuple[int, int] | None = None,
    grid_indices: ArrayLike | None = None,
) -> Cloud:
    """The cloud of columns (n,) by name: x, y, z, colors and intensity under their usual names, the rest as fields.

    Names are compared without regard to case. `grid_shape` and `grid_indices` as of `Cloud.from_points`. CloudError
    where a coordinate is missing.
    """
    lower = {name.lower(): name for name in reversed(list(columns))}
    missing = [name for name in COORDINATES if name not in lower]
    if missing:
        raise cloud_error(path, "columns", ", ".join(columns) or "none", f"x, y and z (missing: {', '.join(missing)})")
    color_names = next(([lower[n] for n in names] for names in COLOR_NAMES if set(names) <= set(lower)), [])
    intensity_name = next((lower[name] for name in INTENSITY_NAMES if name in lower), None)
    count = columns[lower["x"]].shape
    for name in (*(lower[name] for name in COORDINATES), *color_names):
        if columns[name].ndim != 1 or columns[name].shape != count:
            raise cloud_error(path, name, f"shape {columns[name].shape}", f"columns (n,) of one length, as x {count}")
    taken = {SKIPPED, *(lower[name] for name in COORDINATES), *color_names, intensity_name}
    return Cloud.from_points(
        _stacked([columns[lower[name]] for name in COORDINATES], np.dtype(np.float64)),
        colors=_stacked([columns[name] for name in color_names]) if color_names else None,
        intensity=None if intensity_name is None else columns[intensity_name],
        fields={name: _native(values) for name, values in columns.items() if name not in taken},
        triangles=triangles,
        source=path,
        grid_shape=grid_shape,
        grid_indices=grid_indices,
    )


def cloud_of_table(
    path: Path, table: Scalars, names: Sequence[str] | None, grid_shape: tuple[int, int] | None = None
) -> Cloud:
    """The cloud of a table (n, k) of numbers whose columns are `names`, or guessed by `guessed_names`."""
    if table.ndim != 2 or table.shape[1] < len(COORDINATES) or table.dtype.kind not in "iuf":
        raise cloud_error(path, "table", f"{table.dtype} of shape {table.shape}", "numbers of shape (n, 3) or wider")
    chosen = guessed_names(table) if names is None else checked_names(path, names, table.shape[1])
    named = {name: table[:, index] for index, name in enumerate(chosen) if name != SKIPPED}
    return cloud_of_columns(path, named, grid_shape=grid_shape)


def checked_names(path: Path, names: Sequence[str], width: int | None = None) -> list[str]:
    """`names` as a list; CloudError unless there are `width` of them, each but "_" once, with x, y and z."""
    chosen = [names] if isinstance(names, str) else list(names)
    read_names = [name.lower() for name in chosen if name != SKIPPED]
    if not set(COORDINATES) <= set(read_names) or len(set(read_names)) != len(read_names):
        raise cloud_error(path, "columns", chosen, "different names, with x, y and z among them")
    if width is not None and len(chosen) != width:
        raise cloud_error(path, "columns", f"{len(chosen)} names ({', '.join(chosen)})", f"{width}, one a column")
    return chosen


def guessed_names(table: Scalars) -> list[str]:
    """Names for the columns of a table without any: x, y, z and then by their number and values.

    4 columns: intensity. 6 columns: red, green, blue where these are whole numbers from 0 to 255. 7 columns: intensity
    before or after such colors (before, where both would do). Everything else is called column_4 and on.
    """
    width = table.shape[1]
    names = list(COORDINATES) + [f"column_{index}" for index in range(4, width + 1)]
    if width == 4:
        names[3] = "intensity"
    color_starts = {6: (3,), 7: (4, 3)}.get(width, ())
    start = next((start for start in color_starts if are_bytes(table[:, start : start + 3])), None)
    if start is not None:
        names[start : start + 3] = COLOR_NAMES[0]
        names[3:] = [name if name in COLOR_NAMES[0] else "intensity" for name in names[3:]]
    return names


def are_bytes(values: Scalars) -> bool:
    """Whether all are whole numbers from 0 to 255."""
    return bool(np.all((values >= 0) & (values <= BYTE_LIMIT)) and np.all(values == np.floor(values)))


def _stacked(columns: Sequence[Scalars], kind: np.dtype[np.float64] | None = None) -> Scalars:
    """Columns (n,) side by side, (n, 3), as `kind` or their own type."""
    stacked = np.empty((len(columns[0]), len(columns)), dtype=kind or np.result_type(*columns))
    # Bytes that are no floats may look like signaling NaNs.
    with np.errstate(invalid="ignore"):
        for index, column in enumerate(columns):
            stacked[:, index] = column
    return stacked


def _native(values: Scalars) -> Scalars:
    """A contiguous copy in the machine's byte order, so that the file's buffer can go."""
    return np.array(values, dtype=values.dtype.newbyteorder("="))
