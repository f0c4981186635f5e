"""Arrays of numbers and rings as they are given: their shapes and types, named where they are wrong."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from regionpose.validation.foreign import as_array, polygon_parts

Array = NDArray[np.float64]
Kind = TypeVar("Kind", bound=np.generic)

SAMPLE_BITS = (8, 10, 12, 14, 16, 32, 64)
"""Bits of the samples of sensors and files. Cameras of 10 to 14 bits write numbers of 16 whose upper bits are empty."""

LARGEST_COORDINATE, SMALLEST_EXTENT = 2.0**200, 2.0**-200
"""Of points, as of the core's rings: products of a few of these, and their inverses, are finite numbers."""


def ring_list(rings: object, columns: int) -> list[Array]:
    """Rings (n, columns) as a list of arrays; one array of vertices is one ring. ValueError for anything else."""
    parts = polygon_parts(rings)
    if parts is not None and len(parts) > 1:
        raise ValueError(f"found {len(parts)} polygons; needed one, or the constructor of several")
    if parts is not None:
        rings = parts[0]
    unlisted = isinstance(rings, str | bytes | Mapping) or (isinstance(rings, np.ndarray) and rings.ndim == 0)
    if hasattr(rings, "__array__"):
        whole = as_array(rings, "rings", f"(n, {columns})")
        rings = [whole] if whole.ndim == 2 or whole.shape[1:2] == (1,) else whole
    if unlisted or not isinstance(rings, Iterable):
        raise ValueError(f"rings is a {type(rings).__name__}; needed a list of (n, {columns}) arrays")
    listed: list[Any] = list(rings)
    if not listed:
        raise ValueError(f"rings is empty; needed at least one (n, {columns}) array")
    if _is_vertex(listed[0]):
        listed = [listed]
    return [row_array(ring, f"ring {index}", columns).copy() for index, ring in enumerate(listed)]


def _is_vertex(item: object) -> bool:
    """Whether an item of a list is a row of numbers, so that the list is a ring."""
    try:
        return np.asarray(item).ndim == 1
    except (TypeError, ValueError, RuntimeError):
        return False


def row_array(values: object, item: str, columns: int) -> Array:
    """The values as floats (n, columns), the array itself where it holds such; OpenCV's (n, 1, columns), too."""
    return real_rows(values, item, columns).astype(np.float64, copy=False)


def real_rows(values: object, item: str, columns: int) -> NDArray[Any]:
    """The values as real numbers (n, columns), of whatever kind they are."""
    needed = f"(n, {columns})"
    array = real_array(values, item, needed)
    if array.ndim == 3 and array.shape[1] == 1:
        array = array[:, 0]
    if array.ndim != 2 or array.shape[1] != columns:
        raise ValueError(f"{item} has shape {array.shape}; needed {needed}")
    return array


def real_array(values: object, item: str, needed: str) -> NDArray[np.generic]:
    """The values as an array of real numbers, of whatever kind they are."""
    array = as_array(values, item, needed)
    if array.dtype.kind not in "iuf":
        raise ValueError(f"{item} has type {array.dtype}; needed real numbers {needed}")
    return array


def finite_array(values: object, item: str, *shapes: tuple[int, ...]) -> Array:
    """The values as finite floats of one of the shapes."""
    needed = " or ".join(map(str, shapes))
    array = real_array(values, item, needed)
    if array.shape not in shapes:
        raise ValueError(f"{item} has shape {array.shape}; needed {needed}")
    floats = array.astype(np.float64)
    if not np.isfinite(floats).all():
        raise ValueError(f"{item} is {floats.tolist()}; needed finite numbers {needed}")
    return floats


def finite_rows(points: Array) -> NDArray[np.bool_]:
    """Which of the points (n, k) are finite. Column by column: along rows of three it takes six times as long."""
    finite: NDArray[np.bool_] = np.logical_and.reduce([np.isfinite(column) for column in points.T])
    return finite


def check_coordinates(points: Array, item: str = "point") -> None:
    """Check that finite points (n, k) are within `LARGEST_COORDINATE`; ValueError that names one."""
    # Without temporaries as large as a cloud: seldom is one too far away.
    if (
        not points.size
        or max(np.fmax.reduce(points, axis=None), -np.fmin.reduce(points, axis=None)) <= LARGEST_COORDINATE
    ):
        return
    far = np.flatnonzero(((points > LARGEST_COORDINATE) | (points < -LARGEST_COORDINATE)).any(axis=1))
    wrong = far[np.isfinite(points[far]).all(axis=1)]
    if len(wrong):
        found = f"{item} {wrong[0]} is {points[wrong[0]].tolist()}"
        raise ValueError(f"{found}; needed coordinates of at most {LARGEST_COORDINATE:.1e}")


def check_extent(points: Array) -> None:
    """Check that finite points (n, k) extend over at least `SMALLEST_EXTENT`; ValueError otherwise."""
    extent = float(np.ptp(points, axis=0).max())
    if extent < SMALLEST_EXTENT:
        raise ValueError(f"{len(points)} points are within {extent:.3g}; needed an extent of {SMALLEST_EXTENT:.1e}")


def read_only(values: NDArray[Kind]) -> NDArray[Kind]:
    """The array, if it cannot be written to, else a copy of it that can't."""
    if not values.flags.writeable:
        return values
    kept = values.copy()
    kept.setflags(write=False)
    return kept


class KeptArrays:
    """An object all of whose arrays are read-only, also in what is unpickled and in deep copies."""

    def __post_init__(self) -> None:
        """Make the arrays of a dataclass read-only."""
        for name, value in list(vars(self).items()):
            if isinstance(value, np.ndarray):
                object.__setattr__(self, name, read_only(value))

    def __setstate__(self, state: Mapping[str, object]) -> None:
        """Restore a pickled state; numpy unpickles arrays writeable."""
        for value in state.values():
            _lock(value)
        self.__dict__.update(state)


def _lock(value: object) -> None:
    """Make arrays read-only, those in tuples and mappings, too."""
    if isinstance(value, np.ndarray):
        value.setflags(write=False)
    elif isinstance(value, tuple | Mapping):
        for item in value.values() if isinstance(value, Mapping) else value:
            _lock(item)


def signed_area(ring: Array) -> float:
    """Area of a ring (n, 2), negative where it turns clockwise."""
    # The last edge adds nothing: it ends in the vertex that all are counted from.
    x, y = np.ascontiguousarray((ring - ring[0]).T)
    return 0.5 * float(x[:-1] @ y[1:] - y[:-1] @ x[1:])


def counter_clockwise(ring: Array) -> Array:
    """The ring (n, 2), reversed where it is clockwise."""
    return ring if signed_area(ring) > 0.0 else ring[::-1]


def checked_image(image: ArrayLike) -> NDArray[np.uint8]:
    """An image (h, w) or (h, w, 3) of uint8, uint16 or floats in [0, 1] as (h, w, 3) uint8; ValueError for others."""
    levels = eight_bits(checked_levels(image))
    return np.asarray(levels if levels.ndim == 3 else np.broadcast_to(levels[..., None], (*levels.shape, 3)))


def checked_levels(image: ArrayLike) -> NDArray[np.generic]:
    """An image (h, w) or (h, w, 3) of uint8, uint16 or floats in [0, 1], as it is; ValueError for others."""
    given = as_array(image, "image", "(h, w) or (h, w, 3)")
    if given.ndim not in {2, 3} or 0 in given.shape or (given.ndim == 3 and given.shape[2] != 3):
        raise ValueError(f"image has shape {given.shape}; needed (h, w) or (h, w, 3)")
    if given.dtype not in (np.uint8, np.uint16) and given.dtype.kind != "f":
        raise ValueError(f"image has type {given.dtype}; needed uint8, uint16 or floats in [0, 1]")
    if given.dtype.kind == "f" and not (given.min() >= 0.0 and given.max() <= 1.0):
        raise ValueError(f"image holds values from {given.min()} to {given.max()}; needed floats in [0, 1]")
    return given


def sample_bits(levels: NDArray[Any]) -> int:
    """Bits of the samples that whole numbers of at least 0 hold: the fewest of `SAMPLE_BITS` that the largest needs."""
    needed = int(levels.max()).bit_length()
    return next(bits for bits in SAMPLE_BITS if bits >= needed)


def eight_bits(levels: NDArray[Any]) -> NDArray[np.uint8]:
    """Levels of any depth as 8 bits; ValueError for such as are not finite.

    Whole numbers of at least 0 by the depth of their samples, of which the upper 8 bits stay; floats in [0, 1] by that
    range; others, such as temperatures, by their own, from the lowest to the highest.
    """
    if levels.dtype == np.uint8:
        return levels
    low, high = levels.min(), levels.max()
    if not np.isfinite([low, high]).all():
        raise ValueError(f"found levels from {low} to {high}; needed finite ones")
    if levels.dtype.kind in "iu" and low >= 0:
        return (levels >> (sample_bits(levels) - 8)).astype(np.uint8)
    bottom, top = (0.0, 1.0) if low >= 0.0 and high <= 1.0 else (float(low), float(high))
    return np.round((levels - bottom) * (255.0 / ((top - bottom) or 1.0))).astype(np.uint8)
