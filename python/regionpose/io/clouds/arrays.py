"""Clouds as arrays: .npy and .npz."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from regionpose.io.clouds.cloud import Cloud, Scalars
from regionpose.io.clouds.columns import cloud_of_columns, cloud_of_table
from regionpose.io.clouds.errors import CloudError, cloud_error
from regionpose.io.reading import FileError, read_archive, unfolding_error

POINT_KEYS = ("points", "xyz", "vertices", "pts")
COLOR_KEYS = ("colors", "colours", "rgb")
TRIANGLE_KEYS = ("triangles", "faces")
ORIGIN_KEY = "origin"


def read_npy(path: Path, columns: Sequence[str] | None) -> Cloud:
    """The cloud of one array: (n, k) or organized (h, w, k) rows, or a structured array with named columns."""
    try:
        stored = np.load(path, mmap_mode="r", allow_pickle=False)
    # Damaged headers fail in numpy and in Python's tokenizer alike.
    except Exception as error:
        raise cloud_error(path, "array", f"{type(error).__name__}: {error}", "one whole array of numbers") from error
    if stored.dtype.names is not None:
        if columns is not None:
            raise cloud_error(path, "columns", "names given", "none, since the array holds its own")
        named = {name: stored[name].reshape(-1) for name in stored.dtype.names}
        return cloud_of_columns(path, named, grid_shape=_grid_shape(stored.shape[:2]) if stored.ndim == 2 else None)
    if stored.ndim == 3 and stored.size:
        return cloud_of_table(path, stored.reshape(-1, stored.shape[2]), columns, _grid_shape(stored.shape[:2]))
    return cloud_of_table(path, stored, columns)


def _grid_shape(shape: Sequence[int]) -> tuple[int, int] | None:
    """Rows and columns of organized points; None of a single row, which is a list."""
    rows, width = shape
    return (rows, width) if rows > 1 and width > 1 else None


def read_npz(path: Path, columns: Sequence[str] | None) -> Cloud:
    """The cloud of an archive of arrays: points (n, 3), colors, intensity, triangles, origin, other (n,) arrays.

    Without points, the only array is read as a table, or arrays called x, y and z as columns.
    """
    arrays = _archive(path)
    key = next((key for key in POINT_KEYS if key in arrays), None)
    if key is None and len(arrays) == 1:
        return cloud_of_table(path, next(iter(arrays.values())), columns)
    if columns is not None:
        raise cloud_error(path, "columns", "names given", "none, since the archive names its arrays")
    if key is None:
        return cloud_of_columns(path, arrays)
    points = arrays[key]
    if points.ndim != 2 or points.shape[1] != 3 or points.dtype.kind not in "iuf":
        raise cloud_error(path, key, f"{points.dtype} of shape {points.shape}", "numbers of shape (n, 3)")
    return _cloud_of_arrays(path, arrays, points)


def _archive(path: Path) -> dict[str, Scalars]:
    """The arrays of an archive by name."""
    try:
        arrays = read_archive(path)
    except FileError as error:
        raise CloudError(str(error)) from error
    # Small types become doubles.
    wrong = unfolding_error(path, sum(array.size for array in arrays.values()) * np.dtype(np.float64).itemsize)
    if wrong is not None:
        raise CloudError(f"{path}: archive: {wrong}")
    unreadable = [name for name, array in arrays.items() if array.dtype.kind not in "biufUS"]
    if unreadable or not arrays:
        raise cloud_error(path, "archive", ", ".join(unreadable) or "no array", "arrays of numbers")
    return arrays


def _cloud_of_arrays(path: Path, arrays: Mapping[str, Scalars], points: Scalars) -> Cloud:
    """The cloud of `points` and of what else the archive holds for each of them."""

    def first(keys: Sequence[str]) -> Scalars | None:
        return next((arrays[key] for key in keys if key in arrays), None)

    origin = arrays.get(ORIGIN_KEY, np.zeros(3))
    if origin.shape != (3,) or origin.dtype.kind not in "iuf" or not np.isfinite(origin).all():
        raise cloud_error(path, ORIGIN_KEY, f"{origin.dtype} of shape {origin.shape}", "3 finite numbers")
    colors = first(COLOR_KEYS)
    if colors is not None and (colors.ndim != 2 or colors.shape != points.shape):
        raise cloud_error(path, "colors", f"shape {colors.shape}", f"{points.shape}")
    reserved = {*POINT_KEYS, *COLOR_KEYS, *TRIANGLE_KEYS, "intensity", ORIGIN_KEY}
    extra: dict[str, ArrayLike] = {
        name: array
        for name, array in arrays.items()
        if name not in reserved and array.shape == (len(points),) and array.dtype.kind in "biuf"
    }
    return Cloud.from_points(
        points + origin,
        colors=colors,
        intensity=arrays.get("intensity"),
        fields=extra,
        triangles=first(TRIANGLE_KEYS),
        source=path,
    )
