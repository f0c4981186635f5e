"""The regions that label images, COCO and labelme files hold.

COCO and labelme put (0, 0) at the outer corner of the first pixel; here an integer is a pixel's center, so their
polygons are moved by half a pixel.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from skimage.draw import polygon2mask

from regionpose.cameras.base import MOST_SIDE
from regionpose.reading import read_json, read_pixels, unfolding_error

Array = NDArray[np.float64]

Mask = NDArray[np.bool_]

CORNER_TO_CENTER = 0.5
"""Pixels from the outer corner of the first pixel to its center."""

OUTSIDE_MARGIN = 1.0
"""Pixels that a polygon may reach beyond the image: drawn along its border, it may be off by one but not by more."""

MOST_LABELS = 1000
"""Distinct values of a label image at the most; a picture that is no label image holds more."""

LONGEST_RUN_BITS = 65
"""Bits of a run's length in COCO's text, five a character."""

MOST_CHARACTERS = 60
"""Characters of a found value that a message quotes at most."""


class MaskItem(NamedTuple):
    """One region of a file.

    `number`: the value of a label image, the id of a COCO annotation. `size`: (h, w) of the image. `polygons`: (n, 2)
    in pixels, none where the file holds pixels. `mask`: makes the mask, which may be large, when asked. `check`: raises
    the ValueError that this would end in, where it may.
    """

    name: str
    number: int | None
    size: tuple[int, int]
    polygons: list[Array]
    mask: Callable[[], Mask]
    check: Callable[[], object] = lambda: None


class MasksOfFile(Mapping[str, Mask]):
    """Masks (h, w) by name, each made when it is asked for."""

    def __init__(self, makers: Mapping[str, Callable[[], Mask]]) -> None:
        """Keep what makes them."""
        self._makers = makers

    def __getitem__(self, name: str) -> Mask:
        """The mask of a name."""
        return self._makers[name]()

    def __iter__(self) -> Iterator[str]:
        """The names, as the file orders them."""
        return iter(self._makers)

    def __len__(self) -> int:
        """How many there are."""
        return len(self._makers)

    def __repr__(self) -> str:
        """The names."""
        return f"MasksOfFile({', '.join(map(repr, self))})"


def file_items(path: Path, image: str | int | None) -> list[MaskItem]:
    """The regions of a file, each with a name of its own."""
    if not path.is_file():
        raise FileNotFoundError(f"{path} isn't there; needed a label image, a COCO or a labelme file")
    items = list(_json_items(path, image) if path.suffix.lower() == ".json" else _label_items(path))
    if not items:
        raise ValueError(f"{path} holds no regions; needed at least one")
    counts = Counter(item.name for item in items)
    taken = {name for name, count in counts.items() if count == 1}
    numbers = dict.fromkeys(counts, 0)
    named = []
    for item in items:
        name = item.name
        while counts[item.name] > 1 and (name in taken or name == item.name):
            numbers[item.name] += 1
            name = f"{item.name} {numbers[item.name]}"
        taken.add(name)
        named.append(item._replace(name=name))
    return named


def _label_items(path: Path) -> Iterator[MaskItem]:
    labels, shown = _labels(path)
    values = [int(value) for value in np.unique(labels) if value]
    if len(values) > MOST_LABELS:
        raise ValueError(f"{path} holds {len(values)} values; a label image has at most {MOST_LABELS}")
    for value in values:
        name = path.stem if len(values) == 1 else shown.format(value)
        yield MaskItem(name, value, (labels.shape[0], labels.shape[1]), [], partial(_equal, labels, value))


def _equal(labels: NDArray[np.generic], value: int) -> Mask:
    return np.asarray(labels == value)


def _labels(path: Path) -> tuple[NDArray[np.generic], str]:
    """Labels (h, w) of a picture, whole numbers, and the format of their names."""
    pixels, _, form = read_pixels(path)
    if form in {"JPEG", "MPO"}:
        raise ValueError(f"{path} is a JPEG, which changes the labels; needed a lossless format, as PNG")
    if pixels.ndim == 3:
        packed = _packed(pixels)
        del pixels  # Large pictures fit the budget of memory but for this.
        gray = np.asarray(packed % 256 * 0x010101 == packed).all()
        return (packed % 256, "{}") if gray else (packed, "#{:06x}")
    if pixels.dtype.kind == "f" and not (np.isfinite(pixels).all() and (pixels == np.round(pixels)).all()):
        raise ValueError(f"{path} holds numbers that aren't whole; needed labels")
    return pixels, "{}"


def _packed(pixels: NDArray[np.uint8]) -> NDArray[np.uint32]:
    """Colors (h, w, 2 to 4) as one number 0xRRGGBB; transparent pixels count as black."""
    packed = np.zeros(pixels.shape[:2], dtype=np.uint32)
    for channel in (0, 1, 2) if pixels.shape[2] >= 3 else (0, 0, 0):
        packed <<= 8
        packed |= pixels[..., channel]
    if pixels.shape[2] in {2, 4}:
        packed[pixels[..., -1] == 0] = 0
    return packed


def _json_items(path: Path, image: str | int | None) -> Iterator[MaskItem]:
    content = read_json(path)
    if isinstance(content, dict) and "shapes" in content:
        return _labelme_items(path, content)
    if isinstance(content, dict) and {"images", "annotations"} <= content.keys():
        return _coco_items(path, content, image)
    found = _brief(sorted(content)) if isinstance(content, dict) else type(content).__name__
    raise ValueError(f"{path} holds {found}; needed 'shapes' (labelme) or 'images' and 'annotations' (COCO)")


def _labelme_items(path: Path, content: dict[str, object]) -> Iterator[MaskItem]:
    size = _file_size(path, content, "imageHeight", "imageWidth", str(path))
    for index, shape in enumerate(_listed(content, "shapes", str(path))):
        item = f"{path}, shape {index}"
        name, kind = shape.get("label"), shape.get("shape_type", "polygon")
        if not isinstance(name, str) or not name:
            raise ValueError(f"{item} has the label {_brief(name)}; needed a name")
        if kind not in ("polygon", "rectangle"):
            raise ValueError(f"{item} ({name!r}) is a {_brief(kind)}; needed a polygon or a rectangle")
        points = _points(shape.get("points"), size, item, 2 if kind == "rectangle" else 3)
        if len(points) == 2:
            (left, top), (right, bottom) = points
            points = np.array([(left, top), (right, top), (right, bottom), (left, bottom)])
        yield _polygon_item(name, None, size, [points])


def _polygon_item(name: str, number: int | None, size: tuple[int, int], polygons: list[Array]) -> MaskItem:
    return MaskItem(name, number, size, polygons, partial(_polygon_mask, polygons, size))


def _coco_items(path: Path, content: dict[str, object], image: str | int | None) -> Iterator[MaskItem]:
    chosen = _coco_image(path, _listed(content, "images", str(path)), image)
    size = _file_size(path, chosen, "height", "width", f"{path}, image {chosen.get('id')}")
    categories = _listed(content, "categories", str(path)) if "categories" in content else []
    for index, entry in enumerate(_listed(content, "annotations", str(path))):
        if entry.get("image_id") == chosen.get("id"):
            category = entry.get("category_id")
            named = (other.get("name") for other in categories if other.get("id") == category)
            yield _annotation(
                entry,
                str(next(named, None) or f"category {category}"),
                size,
                f"{path}, annotation {entry.get('id', index)}",
            )


def _annotation(entry: Mapping[str, object], name: str, size: tuple[int, int], item: str) -> MaskItem:
    segmentation, number = entry.get("segmentation"), entry.get("id")
    number = number if isinstance(number, int) else None
    if isinstance(segmentation, dict):
        mask, check = partial(run_length_mask, segmentation, size, item), partial(_runs, segmentation, size, item)
        return MaskItem(name, number, size, [], mask, check)
    if isinstance(segmentation, list) and segmentation:
        polygons = [_points(part, size, f"{item}, polygon {k}", 3) for k, part in enumerate(segmentation)]
        return _polygon_item(name, number, size, polygons)
    raise ValueError(f"{item} has the segmentation {_brief(segmentation)}; needed polygons or run lengths")


def _coco_image(path: Path, images: list[dict[str, object]], image: str | int | None) -> dict[str, object]:
    if image is None and len(images) == 1:
        return images[0]
    matching = [entry for entry in images if image is not None and image in (entry.get("id"), entry.get("file_name"))]
    if len(matching) != 1:
        held = ", ".join(f"{entry.get('id')} ({entry.get('file_name')})" for entry in images[:8])
        raise ValueError(f"{path} has {len(matching)} images {image!r}; needed the id or file name of one of: {held}")
    return matching[0]


def run_length_mask(code: Mapping[str, object], size: tuple[int, int], item: str) -> Mask:
    """The mask of COCO's run lengths: down the columns, starting with 0; as numbers or as their text."""
    runs = _runs(code, size, item)
    values = np.repeat(np.arange(len(runs)) % 2 == 1, runs)
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
    if runs.ndim != 1 or runs.dtype.kind not in "iu" or (runs < 0).any():
        raise ValueError(f"{item} has counts that aren't run lengths; needed whole numbers of at least 0")
    if code.get("size") not in (list(size), size):
        raise ValueError(f"{item} has size {code.get('size')}; the image's is {list(size)} (h, w)")
    if runs.max(initial=0) > size[0] * size[1] or runs.sum() != size[0] * size[1]:
        raise ValueError(f"{item} has run lengths for {runs.sum()} pixels; needed {size[0] * size[1]}")
    return runs


def _decoded(text: str) -> list[int]:
    """Run lengths of COCO's text: 5 bits a character, the lowest first; 0x20 says that more follow.

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


def _points(given: object, size: tuple[int, int], item: str, least: int) -> Array:
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


def _listed(content: Mapping[str, object], key: str, item: str) -> list[dict[str, object]]:
    entries = content.get(key)
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise ValueError(f"{item} has {key!r} of type {type(entries).__name__}; needed a list of objects")
    return entries


def size_of(content: Mapping[str, object], height: str, width: str, item: str) -> tuple[int, int]:
    """The size (h, w) under two keys; ValueError for no whole numbers above 0."""
    values = content.get(height), content.get(width)
    if not all(type(value) is int and 0 < value <= MOST_SIDE for value in values):
        found = f"{height} {_brief(values[0])} and {width} {_brief(values[1])}"
        raise ValueError(f"{item} has {found}; needed whole numbers from 1 to {MOST_SIDE}")
    return int(str(values[0])), int(str(values[1]))


def _file_size(path: Path, content: Mapping[str, object], height: str, width: str, item: str) -> tuple[int, int]:
    """The size (h, w) of an image that a file says, whose masks fit the budget of the file."""
    size = size_of(content, height, width, item)
    wrong = unfolding_error(path, size[0] * size[1])
    if wrong is not None:
        raise ValueError(f"{item}, masks of {size[1]} x {size[0]} pixels: {wrong}")
    return size


def _brief(value: object) -> str:
    return repr(value)[:MOST_CHARACTERS]


def _polygon_mask(polygons: list[Array], size: tuple[int, int]) -> Mask:
    mask = np.zeros(size, dtype=np.bool_)
    for polygon in polygons:
        mask |= polygon2mask(size, polygon[:, ::-1])  # type: ignore[no-untyped-call]
    return mask
