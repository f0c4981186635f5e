"""The regions of CVAT's XML "for images" 1.1: polygons, boxes and masks."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray

from regionpose.io.masks.mask_items import (
    Drawn,
    Mask,
    MaskItem,
    box_points,
    checked_runs,
    chosen_image,
    file_size,
    pixel_points,
    polygon_item,
    refused_item,
    run_values,
    turned,
)
from regionpose.io.reading import read_xml, whole_number
from regionpose.validation.arrays import Array
from regionpose.validation.quoting import quoted

OTHER_SHAPES = {"polyline", "points", "ellipse", "cuboid", "skeleton"}
"""Shapes that are no region, or none with straight edges."""


def cvat_items(path: Path, image: str | int | None) -> Iterator[MaskItem]:
    """The regions of one image."""
    root = read_xml(path)
    images = root.findall("image")
    if root.tag != "annotations" or not images:
        found = "tracks of a video" if root.find("track") is not None else f"<{root.tag}> without images"
        needed = "CVAT's annotations for images 1.1, or an export as COCO or PNG masks"
        raise ValueError(f"{path} holds {found}; needed {needed}")
    names = [(whole_number(one.get("id", "")), Path(one.get("name", "")).name) for one in images]
    chosen = images[chosen_image(path, names, Path(image).name if isinstance(image, str) else image)]
    sides = {side: whole_number(chosen.get(side, "")) for side in ("height", "width")}
    size = file_size(path, sides, "height", "width", f"{path}, image {chosen.get('id')}")
    for index, shape in enumerate(chosen):
        if shape.tag in {"polygon", "box", "mask"} | OTHER_SHAPES:
            yield _item(shape, size, f"{path}, shape {index}")


def _item(shape: Element, size: tuple[int, int], item: str) -> MaskItem:
    name = shape.get("label") or "region"
    if shape.tag == "polygon":
        return polygon_item(name, None, size, [Drawn(pixel_points(_pairs(shape, item), size, item))])
    if shape.tag == "box":
        points = box_points(*(_number(shape, key, item) for key in ("xtl", "ytl", "xbr", "ybr")))
        rotation = _number(shape, "rotation", item) if shape.get("rotation") is not None else 0.0
        points = turned(points, points.mean(axis=0), rotation)
        return polygon_item(name, None, size, [Drawn(pixel_points(points, size, item))])
    if shape.tag == "mask":
        mask = partial(_pixels, shape, size, item)
        return MaskItem(name, None, size, [], mask, mask)
    needed = "a polygon, a box or a mask"
    return refused_item(name, size, f"{item} ({name!r}) is a {shape.tag}; needed {needed}")


def _pairs(shape: Element, item: str) -> Array:
    """Points (n, 2) of a text "x,y;x,y"."""
    text = shape.get("points", "")
    try:
        return np.array([[float(word) for word in pair.split(",")] for pair in text.split(";")])
    except ValueError as error:
        raise ValueError(f"{item} has the points {quoted(text)}; needed x,y;x,y and so on") from error


def _number(shape: Element, key: str, item: str) -> float:
    text = shape.get(key, "")
    try:
        return float(text)
    except ValueError as error:
        raise ValueError(f"{item} has {key} {quoted(text)}; needed a number") from error


def _pixels(shape: Element, size: tuple[int, int], item: str) -> Mask:
    """The mask (h, w) of run lengths along the rows of a box, the first of them outside."""
    left, top, width, height = (_whole(shape, key, item) for key in ("left", "top", "width", "height"))
    if left + width > size[1] or top + height > size[0]:
        found = f"a mask of {width} x {height} pixels at ({left}, {top})"
        raise ValueError(f"{item} has {found}; the image has {size[1]} x {size[0]}")
    runs = checked_runs(_runs(shape, item), width * height, item)
    mask = np.zeros(size, dtype=np.bool_)
    mask[top : top + height, left : left + width] = run_values(runs).reshape(height, width)
    return mask


def _whole(shape: Element, key: str, item: str) -> int:
    text = shape.get(key, "")
    number = whole_number(text)
    if number is None:
        raise ValueError(f"{item} has {key} {quoted(text)}; needed a whole number of pixels")
    return number


def _runs(shape: Element, item: str) -> NDArray[Any]:
    text = shape.get("rle", "")
    runs = [whole_number(word.strip()) for word in text.split(",")]
    if any(run is None for run in runs):
        raise ValueError(f"{item} has the rle {quoted(text)}; needed whole numbers, one after another")
    return np.array(runs, dtype=np.int64)
