"""The regions of Label Studio's exports, JSON and JSON-MIN: polygons, rectangles and brushes."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from regionpose.io.masks.mask_items import (
    Drawn,
    Mask,
    MaskItem,
    box_points,
    chosen_image,
    file_size,
    pixel_points,
    polygon_item,
    refused_item,
    turned,
)
from regionpose.validation.arrays import Array
from regionpose.validation.quoting import quoted

Entry = dict[str, Any]

SIZE = ("original_height", "original_width")

CHANNELS = 4
"""Numbers of a brush's pixel: red, green, blue and how far it is covered."""

COVERED = 128
"""Least number of a pixel's cover that counts: half."""


def is_label_studio(content: object) -> bool:
    """Whether a JSON value is an export of Label Studio."""
    tasks = content if isinstance(content, list) else []
    return any(isinstance(task, dict) and ("annotations" in task or any(_results_beside(task))) for task in tasks)


def label_studio_items(path: Path, content: list[Entry], image: str | int | None) -> Iterator[MaskItem]:
    """The regions of one task's image."""
    tasks = [task for task in content if isinstance(task, dict)]
    names = [(task.get("id"), _image_name(task)) for task in tasks]
    # Uploads have a prefix before the name that the file had.
    wanted = next((name for _, name in names if isinstance(image, str) and name.endswith(f"-{image}")), image)
    task = tasks[chosen_image(path, names, image if any(image in one for one in names) else wanted, "tasks")]
    items: dict[str, MaskItem] = {}
    for index, result in enumerate(_results(task)):
        item = _item(path, result, f"{path}, result {index}")
        if item is None:
            continue
        # A shape and its label may be two results of one id.
        key, label = str(result.get("id", f"result {index}")), _label(result)
        if key not in items or label is not None:
            items[key] = item
    yield from items.values()


def _image_name(task: Entry) -> str:
    data = task.get("data", task)
    fields = data.values() if isinstance(data, dict) else ()
    names = [PurePosixPath(value.partition("?")[0]).name for value in fields if isinstance(value, str)]
    given = data.get("image") if isinstance(data, dict) else None
    return PurePosixPath(given.partition("?")[0]).name if isinstance(given, str) else next(iter(names), "")


def _results(task: Entry) -> Iterator[Entry]:
    """The results of a task's annotations that were not withdrawn; of JSON-MIN those beside its data."""
    annotations = task.get("annotations")
    if not isinstance(annotations, list):
        yield from _results_beside(task)
        return
    for annotation in annotations:
        if isinstance(annotation, dict) and not annotation.get("was_cancelled"):
            results = annotation.get("result")
            yield from (one for one in (results if isinstance(results, list) else []) if isinstance(one, dict))


def _results_beside(task: Entry) -> Iterator[Entry]:
    lists = (value for value in task.values() if isinstance(value, list))
    yield from (one for values in lists for one in values if isinstance(one, dict) and SIZE[0] in one)


def _value(result: Entry) -> Entry:
    value = result.get("value", result)
    return value if isinstance(value, dict) else {}


def _label(result: Entry) -> str | None:
    """The first label of a result, if it has any."""
    for key, labels in _value(result).items():
        if key.endswith("labels") and isinstance(labels, list) and labels and isinstance(labels[0], str):
            return labels[0]
    return None


def _item(path: Path, result: Entry, item: str) -> MaskItem | None:
    """The region of a result; None of one that isn't a place in the image."""
    value, name = _value(result), _label(result) or "region"
    if not ({"points", "rle", "x"} & value.keys()):
        return None
    size = file_size(path, result, *SIZE, item)
    if result.get("image_rotation"):
        return refused_item(name, size, f"{item} ({name!r}) is of a turned image; needed image_rotation 0")
    if "rle" in value:
        levels = partial(_brush_mask, value["rle"], size, item)
        return MaskItem(name, None, size, [], levels, levels)
    if "points" in value:
        points = _percent(value["points"], size, item)
    elif {"width", "height"} <= value.keys():
        x, y, width, height = (_number(value, key, item) for key in ("x", "y", "width", "height"))
        corners = _percent([[x, y], [x + width, y + height]], size, item)
        rotation = _number(value, "rotation", item) if "rotation" in value else 0.0
        points = turned(box_points(*corners[0], *corners[1]), corners[0], rotation)
    else:
        kind = quoted(result.get("type"))
        needed = "a polygon, a rectangle or a brush, or an export as COCO or PNG"
        return refused_item(name, size, f"{item} ({name!r}) is a {kind}; needed {needed}")
    return polygon_item(name, None, size, [Drawn(pixel_points(points, size, item))])


def _number(value: Entry, key: str, item: str) -> float:
    try:
        return float(value[key])
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise ValueError(f"{item} has {key} {quoted(value.get(key))}; needed a number") from error


def _percent(points: object, size: tuple[int, int], item: str) -> Array:
    """Corner-based pixels of points in percent of the image's sides."""
    try:
        given = np.asarray(points, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise ValueError(f"{item} has points that aren't pairs of numbers; needed [x, y] each") from error
    if given.ndim != 2 or given.shape[1] != 2:
        raise ValueError(f"{item} has points of shape {given.shape}; needed (n, 2)")
    return np.asarray(given / 100.0 * np.array(size[::-1]), dtype=np.float64)


def _brush_mask(code: object, size: tuple[int, int], item: str) -> Mask:
    """The mask (h, w) of a brush: its pixels that are covered by half at least."""
    if not (isinstance(code, list) and code and all(type(one) is int and 0 <= one <= 255 for one in code)):
        raise ValueError(f"{item} has the rle {quoted(code)}; needed whole numbers from 0 to 255")
    values, ends = _runs(BitReader(np.array(code, dtype=np.uint8)), CHANNELS * size[0] * size[1], item)
    # The last number of each pixel is its coverage.
    covers = np.diff(ends // CHANNELS, prepend=0)
    return np.repeat(values >= COVERED, covers).reshape(size)


class BitReader:
    """Numbers of any count of bits, the highest first, one after another."""

    def __init__(self, content: NDArray[np.uint8]) -> None:
        """Begin at the first bit."""
        self._bits, self._next = np.unpackbits(content), 0

    def take(self, count: int) -> NDArray[np.uint8]:
        """The next bits; ValueError where there are fewer."""
        bits = self._bits[self._next : self._next + count]
        if len(bits) < count:
            raise ValueError("ends too early")
        self._next += count
        return bits

    def number(self, count: int) -> int:
        """The number that the next bits are."""
        return int.from_bytes(np.packbits(np.concatenate([np.zeros(-count % 8, np.uint8), self.take(count)])).tobytes())


def _runs(reader: BitReader, needed: int, item: str) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
    """The numbers of a brush's runs, and how many there are up to the end of each.

    Its first bits hold the count of numbers (32), of how many bits each is (5, less one), and the bits of four
    lengths (4 each, less one). Then come runs: whether its number stands once for all (1), which of the four lengths
    (2), the length, less one, and the number or the numbers. So in thi.ng/rle-pack, which Label Studio uses.
    """
    try:
        found, bits = reader.number(32), reader.number(5) + 1
        if found != needed or bits != 8:
            raise ValueError(f"holds {found} numbers of {bits} bits, not {needed} of 8")
        lengths_bits = [reader.number(4) + 1 for _ in range(4)]
        values, lengths, count = [], [], 0
        while count < needed:
            is_run, length_bits = reader.number(1), lengths_bits[reader.number(2)]
            length = reader.number(length_bits) + 1
            count += length
            if count > needed:
                raise ValueError("holds runs of more numbers")
            values.append(np.packbits(reader.take(bits if is_run else bits * length)))
            lengths.append(np.array([length]) if is_run else np.ones(length, dtype=np.int64))
    except ValueError as error:
        wanted = "a brush of the image, or an export as COCO or PNG"
        raise ValueError(f"{item} has an rle that {error}; needed {wanted}") from error
    return np.concatenate(values), np.cumsum(np.concatenate(lengths))
