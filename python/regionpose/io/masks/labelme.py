"""The regions of labelme's files: polygons, rectangles and the masks of its AI tools, holes and groups."""

from __future__ import annotations

import binascii
from base64 import b64decode
from collections.abc import Iterator, Sequence
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import NamedTuple

import numpy as np
import shapely

from regionpose.io.masks.mask_items import (
    CORNER_TO_CENTER,
    Drawn,
    Mask,
    MaskItem,
    box_points,
    file_size,
    listed,
    pixel_points,
    polygon_item,
    polygon_mask,
)
from regionpose.io.reading import read_pixels
from regionpose.validation.arrays import Array
from regionpose.validation.quoting import quoted

HOLE = "__hole__"
"""The label of shapes that are cut out of others."""

KINDS = ("polygon", "rectangle", "mask")


class Shape(NamedTuple):
    """A shape: its label, its group or None, and its outline (n, 2), pixels; of a mask its box, and its text."""

    item: str
    label: str
    group: int | str | None
    points: Array
    text: str | None = None


def labelme_items(path: Path, content: dict[str, object]) -> Iterator[MaskItem]:
    """The regions of a labelme file.

    Shapes of one label and group are one region: parts that lie beside one another, and holes that lie within. Shapes
    that are labeled as holes are cut out of their group, or of what they lie in.
    """
    size = file_size(path, content, "imageHeight", "imageWidth", str(path))
    given = listed(content, "shapes", str(path))
    shapes = [_shape(shape, size, f"{path}, shape {index}") for index, shape in enumerate(given)]
    regions: dict[tuple[object, ...], list[Shape]] = {}
    for index, shape in enumerate(shapes):
        if shape.label != HOLE:
            key = (index,) if shape.group is None else (shape.label, shape.group)
            regions.setdefault(key, []).append(shape)
    parts_by_region = list(regions.values())
    cut: list[list[Drawn]] = [[] for _ in parts_by_region]
    for hole in (shape for shape in shapes if shape.label == HOLE):
        for place in _places_of(hole, parts_by_region):
            cut[place].append(Drawn(hole.points, is_hole=True))
    for parts, holes in zip(parts_by_region, cut, strict=True):
        yield _region(path, parts, holes, size)


def _shape(shape: dict[str, object], size: tuple[int, int], item: str) -> Shape:
    label, kind, group = shape.get("label"), shape.get("shape_type", "polygon"), shape.get("group_id")
    if not isinstance(label, str) or not label:
        raise ValueError(f"{item} has the label {quoted(label)}; needed a name")
    if kind not in KINDS or (kind == "mask" and label == HOLE):
        raise ValueError(f"{item} ({label!r}) is a {quoted(kind)}; needed a polygon, a rectangle or a mask")
    if not isinstance(group, int | str | None):
        raise ValueError(f"{item} ({label!r}) has the group_id {quoted(group)}; needed a number or none")
    points = pixel_points(shape.get("points"), size, item, 3 if kind == "polygon" else 2)
    if kind == "mask":
        text = shape.get("mask")
        if not isinstance(text, str) or len(points) != 2:
            raise ValueError(f"{item} ({label!r}) has the mask {quoted(text)}; needed a PNG in base64 and two corners")
        return Shape(item, label, group, points, text)
    return Shape(item, label, group, box_points(*points[0], *points[1]) if len(points) == 2 else points)


def _places_of(hole: Shape, regions: Sequence[Sequence[Shape]]) -> list[int]:
    """The places of the regions that a hole is cut out of; ValueError without any."""
    if hole.group is not None:
        places = [place for place, parts in enumerate(regions) if parts[0].group == hole.group]
    else:
        outline = shapely.make_valid(shapely.Polygon(hole.points))
        fractions = [
            sum(float(shapely.area(shapely.intersection(outline, _outline(part)))) for part in parts)
            for parts in regions
        ]
        places = [place for place, fraction in enumerate(fractions) if fraction > 0.5 * shapely.area(outline)]
    if not places:
        needed = "a shape of its group_id" if hole.group is not None else "a shape that it lies in"
        raise ValueError(f"{hole.item} ({HOLE}) is in no region; needed {needed}")
    return places


def _outline(shape: Shape) -> shapely.Geometry:
    points = shape.points if shape.text is None else box_points(*shape.points[0], *shape.points[1])
    return shapely.make_valid(shapely.Polygon(points))


def _region(path: Path, parts: Sequence[Shape], holes: list[Drawn], size: tuple[int, int]) -> MaskItem:
    label, masks = parts[0].label, [part for part in parts if part.text is not None]
    polygons = [*_nested([part.points for part in parts if part.text is None]), *holes]
    if not masks:
        return polygon_item(label, None, size, polygons)
    mask = partial(_pixels, path, masks, polygons, size)
    return MaskItem(label, None, size, [], mask, mask)


def _nested(outlines: Sequence[Array]) -> list[Drawn]:
    """Outlines from the largest to the smallest; one that lies within what is there is a hole of it."""
    if len(outlines) == 1:
        return [Drawn(outlines[0])]
    shapes = [(points, shapely.make_valid(shapely.Polygon(points))) for points in outlines]
    whole: shapely.Geometry = shapely.Polygon()
    drawn = []
    for points, shape in sorted(shapes, key=lambda one: -float(shapely.area(one[1]))):
        is_hole = bool(shapely.covers(whole, shape))
        whole = shapely.difference(whole, shape) if is_hole else shapely.union(whole, shape)
        drawn.append(Drawn(points, is_hole))
    return drawn


def _pixels(path: Path, masks: Sequence[Shape], polygons: Sequence[Drawn], size: tuple[int, int]) -> Mask:
    """The mask (h, w) of a region of masks, and of polygons that are added to them or cut out."""
    parts, holes = ([one for one in polygons if one.is_hole == cut] for cut in (False, True))
    whole = polygon_mask(parts, size)
    for shape in masks:
        pixels = _decoded(path, shape)
        corners = shape.points + CORNER_TO_CENTER
        left, top = np.round(corners[0]).astype(int)
        rows, columns = pixels.shape
        if np.abs(corners[1] - corners[0] + 1.0 - [columns, rows]).max() > CORNER_TO_CENTER:
            raise ValueError(
                f"{shape.item} has corners {quoted(corners.tolist())} for a mask of {columns} x {rows} pixels"
            )
        if min(left, top) < 0 or left + columns > size[1] or top + rows > size[0]:
            found = f"a mask of {columns} x {rows} pixels at ({left}, {top})"
            raise ValueError(f"{shape.item} has {found}; the image has {size[1]} x {size[0]}")
        whole[top : top + rows, left : left + columns] |= pixels
    return whole & ~polygon_mask([Drawn(hole.points) for hole in holes], size) if holes else whole


def _decoded(path: Path, shape: Shape) -> Mask:
    try:
        content = b64decode(shape.text or "", validate=True)
    except binascii.Error as error:
        raise ValueError(f"{shape.item} has the mask {quoted(shape.text)}; needed a PNG in base64") from error
    pixels = read_pixels(path, content=BytesIO(content)).values
    if pixels.ndim != 2:
        raise ValueError(f"{shape.item} has a mask with {pixels.shape[2]} channels; needed one")
    return np.asarray(pixels != 0)
