"""One region of a file of masks, and what the readers of such files share.

Files of labeling tools put (0, 0) at the outer corner of the first pixel; here an integer is a pixel's center, so their
points are moved by half a pixel.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.polygon import orient
from skimage.draw import polygon2mask

from regionpose.cameras.base import MOST_SIDE
from regionpose.io.reading import unfolding_error
from regionpose.validation.arrays import Array
from regionpose.validation.quoting import quoted

Mask = NDArray[np.bool_]

CORNER_TO_CENTER = 0.5
"""Pixels from the outer corner of the first pixel to its center."""

OUTSIDE_MARGIN = 1.0
"""Pixels that a polygon may reach beyond the image: drawn along its border, it may be off by one but not by more."""


class Drawn(NamedTuple):
    """A polygon (n, 2), pixels, that is added to those before it, or cut out of them."""

    points: Array
    is_hole: bool = False


class MaskItem(NamedTuple):
    """One region of a file.

    `number`: the value of a label image, the id of an annotation, or the place of a mask without one. `size`: (h, w) of
    the image. `polygons`: one after another, none where the file holds pixels. `mask`: makes the mask, which may be
    large, on request. `check`: raises the ValueError that this would end in, where it may.
    """

    name: str
    number: int | None
    size: tuple[int, int]
    polygons: list[Drawn]
    mask: Callable[[], Mask]
    check: Callable[[], object] = lambda: None


def polygon_item(name: str, number: int | None, size: tuple[int, int], polygons: list[Drawn]) -> MaskItem:
    """The region of polygons in an image of a size (h, w)."""
    return MaskItem(name, number, size, polygons, partial(polygon_mask, polygons, size))


def refused_item(name: str, size: tuple[int, int], message: str) -> MaskItem:
    """A region that cannot be read; reading it raises an error with the reason."""

    def refused() -> NoReturn:
        raise ValueError(message)

    return MaskItem(name, None, size, [], refused, refused)


def polygon_mask(polygons: Sequence[Drawn], size: tuple[int, int]) -> Mask:
    """The pixels of an image (h, w) whose centers are within polygons."""
    mask = np.zeros(size, dtype=np.bool_)
    for points, is_hole in polygons:
        inside = polygon2mask(size, points[:, ::-1])  # type: ignore[no-untyped-call]
        mask = mask & ~inside if is_hole else mask | inside
    return mask


def polygon_rings(polygons: Sequence[Drawn]) -> list[Array]:
    """The rings of polygons, outer ones counter-clockwise, holes the other way."""
    whole: shapely.Geometry = shapely.Polygon()
    for points, is_hole in polygons:
        part = shapely.make_valid(shapely.Polygon(points))
        whole = shapely.difference(whole, part) if is_hole else shapely.union(whole, part)
    faces = [orient(part) for part in shapely.get_parts(whole) if isinstance(part, shapely.Polygon)]
    rings = [ring for face in faces for ring in (face.exterior, *face.interiors)]
    return [np.asarray(ring.coords)[:-1] for ring in rings]


def pixel_points(given: object, size: tuple[int, int], item: str, least: int = 3) -> Array:
    """Polygon (n, 2) of corner-based [[x, y], ...] or [x, y, x, y, ...], moved to pixel centers."""
    try:
        points = np.asarray(given, dtype=np.float64)
        points = points.reshape(-1, 2) if points.ndim == 1 else points
    except (TypeError, ValueError, OverflowError) as error:
        raise ValueError(f"{item} has points that aren't pairs of numbers; needed [x, y] each") from error
    if points.ndim != 2 or points.shape[1] != 2 or len(points) < least or not np.isfinite(points).all():
        raise ValueError(f"{item} has points of shape {points.shape}; needed at least {least} finite [x, y]")
    beyond = (points < -OUTSIDE_MARGIN) | (points > np.array(size[::-1]) + OUTSIDE_MARGIN)
    if beyond.any():
        x, y = points[beyond.any(axis=1)][0]
        raise ValueError(f"{item} has the point ({x:g}, {y:g}); the image has {size[1]} x {size[0]} pixels")
    closed = len(points) > least and (points[0] == points[-1]).all()
    return (points[:-1] if closed else points) - CORNER_TO_CENTER


def box_points(left: float, top: float, right: float, bottom: float) -> Array:
    """The corners (4, 2) of a box."""
    return np.array([(left, top), (right, top), (right, bottom), (left, bottom)])


def turned(points: Array, center: Array, degrees: float) -> Array:
    """Points (n, 2) of an image turned clockwise about a place."""
    cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.asarray((points - center) @ np.array([[cosine, sine], [-sine, cosine]]) + center)


def run_values(runs: NDArray[np.integer[Any]]) -> Mask:
    """Pixels of run lengths, in turn outside and inside, the first outside."""
    return np.repeat(np.arange(len(runs)) % 2 == 1, runs)


def checked_runs(runs: NDArray[Any], pixels: int, item: str) -> NDArray[np.integer[Any]]:
    """Run lengths that fill so many pixels; ValueError for others."""
    if runs.ndim != 1 or runs.dtype.kind not in "iu" or (runs < 0).any():
        raise ValueError(f"{item} has counts that aren't run lengths; needed whole numbers of at least 0")
    if runs.max(initial=0) > pixels or runs.sum() != pixels:
        raise ValueError(f"{item} has run lengths for {runs.sum()} pixels; needed {pixels}")
    return runs


def listed(content: Mapping[str, object], key: str, item: str) -> list[dict[str, object]]:
    """The objects that a file lists under a key; ValueError where it holds something else."""
    entries = content.get(key)
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise ValueError(f"{item} has {key!r} of type {type(entries).__name__}; needed a list of objects")
    return entries


def size_of(content: Mapping[str, object], height: str, width: str, item: str) -> tuple[int, int]:
    """The size (h, w) under two keys; ValueError for no whole numbers above 0."""
    values = content.get(height), content.get(width)
    if not all(type(value) is int and 0 < value <= MOST_SIDE for value in values):
        found = f"{height} {quoted(values[0])} and {width} {quoted(values[1])}"
        raise ValueError(f"{item} has {found}; needed whole numbers from 1 to {MOST_SIDE}")
    return int(str(values[0])), int(str(values[1]))


def file_size(path: Path, content: Mapping[str, object], height: str, width: str, item: str) -> tuple[int, int]:
    """The image size (h, w) that a file states, whose masks fit the budget of the file."""
    size = size_of(content, height, width, item)
    wrong = unfolding_error(path, size[0] * size[1])
    if wrong is not None:
        raise ValueError(f"{item}, masks of {size[1]} x {size[0]} pixels: {wrong}")
    return size


def chosen_image(
    path: Path, images: Sequence[tuple[object, str]], image: str | int | None, what: str = "images"
) -> int:
    """The index of the requested image among a file's ids and file names; ValueError that lists them."""
    if image is None and len(images) == 1:
        return 0
    matching = [place for place, one in enumerate(images) if image is not None and image in one]
    if len(matching) != 1:
        choices = ", ".join(f"{number} ({name})" for number, name in images[:8])
        raise ValueError(
            f"{path} has {len(matching)} {what} {image!r}; needed the id or file name of one of: {choices}"
        )
    return matching[0]
