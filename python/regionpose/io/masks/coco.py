"""The regions of COCO's files and of Segment Anything's, whose masks have COCO's run lengths."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from regionpose.io.masks.mask_items import (
    Drawn,
    Mask,
    MaskItem,
    checked_runs,
    chosen_image,
    file_size,
    listed,
    pixel_points,
    polygon_item,
    run_values,
)
from regionpose.validation.quoting import quoted

LONGEST_RUN_BITS = 65
"""Bits of a run's length in COCO's text, five a character."""


def coco_items(path: Path, content: dict[str, object], image: str | int | None) -> Iterator[MaskItem]:
    """The annotations of one image of a COCO file."""
    images = listed(content, "images", str(path))
    place = chosen_image(path, [(one.get("id"), str(one.get("file_name"))) for one in images], image)
    chosen = images[place]
    size = file_size(path, chosen, "height", "width", f"{path}, image {chosen.get('id')}")
    categories = listed(content, "categories", str(path)) if "categories" in content else []
    for index, entry in enumerate(listed(content, "annotations", str(path))):
        if entry.get("image_id") == chosen.get("id"):
            category = entry.get("category_id")
            named = (other.get("name") for other in categories if other.get("id") == category)
            yield _annotation(
                entry,
                str(next(named, None) or f"category {category}"),
                _number(entry),
                size,
                f"{path}, annotation {entry.get('id', index)}",
            )


def sam_items(path: Path, content: dict[str, object]) -> Iterator[MaskItem]:
    """The masks of an image of SA-1B, or of SAM 2: named by their places, numbered by their ids."""
    image = content["image"]
    size = file_size(path, image if isinstance(image, dict) else {}, "height", "width", f"{path}, image")
    for index, entry in enumerate(listed(content, "annotations", str(path))):
        number = _number(entry)
        yield _annotation(entry, f"mask {index}", index if number is None else number, size, f"{path}, mask {index}")


def listed_items(path: Path, content: list[dict[str, object]], image: str | int | None) -> Iterator[MaskItem]:
    """The masks of a list: of Segment Anything's automatic generator, or of COCO's results, which name their images."""
    ids = list(dict.fromkeys(str(entry["image_id"]) for entry in content if "image_id" in entry))
    wanted = ids[chosen_image(path, [(one, one) for one in ids], None if image is None else str(image))] if ids else ""
    for index, entry in enumerate(content):
        if ids and str(entry.get("image_id")) != wanted:
            continue
        item, code = f"{path}, mask {index}", entry.get("segmentation")
        size = code.get("size") if isinstance(code, dict) else None
        if not isinstance(size, list) or len(size) != 2:
            raise ValueError(f"{item} has the segmentation {quoted(code)}; needed run lengths with their size (h, w)")
        given = file_size(path, {"h": size[0], "w": size[1]}, "h", "w", item)
        name = f"category {entry['category_id']}" if "category_id" in entry else f"mask {index}"
        number = _number(entry)
        yield _annotation(entry, name, index if number is None else number, given, item)


def _number(entry: Mapping[str, object]) -> int | None:
    number = entry.get("id")
    return number if isinstance(number, int) else None


def _annotation(
    entry: Mapping[str, object], name: str, number: int | None, size: tuple[int, int], item: str
) -> MaskItem:
    segmentation = entry.get("segmentation")
    if isinstance(segmentation, dict):
        mask, check = partial(run_length_mask, segmentation, size, item), partial(_runs, segmentation, size, item)
        return MaskItem(name, number, size, [], mask, check)
    if isinstance(segmentation, list) and segmentation:
        parts = [pixel_points(part, size, f"{item}, polygon {k}") for k, part in enumerate(segmentation)]
        return polygon_item(name, number, size, [Drawn(part) for part in parts])
    raise ValueError(f"{item} has the segmentation {quoted(segmentation)}; needed polygons or run lengths")


def run_length_mask(code: Mapping[str, object], size: tuple[int, int], item: str) -> Mask:
    """The mask of COCO's run lengths: down the columns, starting with 0; as numbers or as their text."""
    values = run_values(_runs(code, size, item))
    return np.ascontiguousarray(values.reshape(size[1], size[0]).T)


def _runs(code: Mapping[str, object], size: tuple[int, int], item: str) -> NDArray[np.integer[Any]]:
    """Run lengths that fill an image of a size (h, w)."""
    counts = code.get("counts")
    text = counts.decode("latin-1") if isinstance(counts, bytes) else counts
    try:
        runs = np.asarray(_decoded(text) if isinstance(text, str) else text)
    except ValueError as error:
        raise ValueError(
            f"{item} has counts that aren't run lengths ({error}); needed COCO's numbers or text"
        ) from error
    if code.get("size") not in (list(size), size):
        raise ValueError(f"{item} has size {code.get('size')}; the image's is {list(size)} (h, w)")
    return checked_runs(runs, size[0] * size[1], item)


def _decoded(text: str) -> list[int]:
    """Run lengths of COCO's text: 5 bits a character, the lowest first; 0x20 marks that more follow.

    From the fourth on they're differences from the last but one.
    """
    runs: list[int] = []
    value, shift = 0, 0
    for character in text:
        bits = ord(character) - 48
        if not 0 <= bits < 64:
            raise ValueError(f"character {character!r} is no part of a run-length text")
        value |= (bits & 0x1F) << shift
        shift += 5
        if shift > LONGEST_RUN_BITS:
            raise ValueError("a run of more than 64 bits")
        if not bits & 0x20:
            if bits & 0x10:
                value -= 1 << shift
            runs.append(value + runs[-2] if len(runs) > 2 else value)
            value, shift = 0, 0
    if shift:
        raise ValueError("the run-length text ends within a number")
    return runs
