"""Masks and outlines that others made: label images, COCO and labelme files, arrays of a segmenter.

COCO and labelme put (0, 0) at the outer corner of the first pixel; here an integer is a pixel's centre, so their
polygons are moved by half a pixel.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from PIL import Image, UnidentifiedImageError
from shapely.geometry.polygon import orient
from skimage.draw import polygon2mask

from regionpose import _core
from regionpose.regions import ImageRegion

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

CORNER_TO_CENTRE = 0.5
"""Pixels from the outer corner of the first pixel to its centre."""

MOST_LABELS = 1000
"""Distinct values of a label image at the most; a picture that is no label image holds more."""


class _Item(NamedTuple):
    """One region of a file: polygons (n, 2) in pixels, or a mask; `size` is (h, w)."""

    name: str
    polygons: list[Array]
    mask: Mask | None
    size: tuple[int, int]


def masks_from_file(path: str | Path, *, image: str | int | None = None) -> dict[str, Mask]:
    """Masks (h, w) by name from a label image (PNG, TIFF, ...), a COCO or a labelme file.

    A label image has one mask per value other than 0 (per colour other than black), named by the value; a single one is
    named after the file. COCO names come from the categories, labelme's from the labels; repeated ones get a number.
    `image`: id or file name of the image within a COCO file that holds several. Polygons cover the pixels whose centre
    is inside. FileNotFoundError, or ValueError that names the file and the item.
    """
    return {item.name: _mask_of(item) for item in _items(Path(path), image)}


def regions_from_file(path: str | Path, *, image: str | int | None = None) -> dict[str, ImageRegion]:
    """Image regions by name, of the files of `masks_from_file`; polygons keep their exact vertices.

    Several polygons of one COCO annotation make one region, their union.
    """
    regions = {}
    for item in _items(Path(path), image):
        try:
            regions[item.name] = _region_of(item)
        except ValueError as error:
            raise ValueError(f"{path}, region {item.name!r}: {error}") from error
    return regions


def masks_from_segmenter(
    masks: ArrayLike | Sequence[Mapping[str, ArrayLike]],
    *,
    kind: Literal["mask", "probability", "logit"] | None = None,
    coverage: bool = False,
) -> list[NDArray[np.bool_] | NDArray[np.float32]]:
    """Masks (h, w) of a segmenter's array (n, h, w), (n, 1, h, w) or (h, w), or of dictionaries with a "segmentation".

    `kind` says what numbers are; without it bool and the integers 0 and 1 (or 255) are masks, floats within [0, 1]
    probabilities, other floats logits. The outline of probabilities lies at 1/2, of logits at 0. `coverage`: return
    probabilities (float32), whose outline has sub-pixel places, instead of bool masks.
    """
    given = _stacked(_arrays_of(masks))
    held = kind or _guessed_kind(given)
    if held not in {"mask", "probability", "logit"}:
        raise ValueError(f"kind is {kind!r}; needed 'mask', 'probability', 'logit' or None")
    with np.errstate(over="ignore"):
        shares = 1.0 / (1.0 + np.exp(-given.astype(np.float32))) if held == "logit" else given.astype(np.float32)
    shares = (given != 0).astype(np.float32) if held == "mask" else shares
    if not (shares.min() >= 0.0 and shares.max() <= 1.0):
        raise ValueError(f"masks hold values from {given.min()} to {given.max()}; needed probabilities in [0, 1]")
    return [share if coverage else np.asarray(share > 0.5) for share in shares]


def _arrays_of(masks: ArrayLike | Sequence[Mapping[str, ArrayLike]]) -> NDArray[np.generic]:
    if not isinstance(masks, Sequence) or not any(isinstance(entry, Mapping) for entry in masks):
        return np.asarray(masks)
    arrays = []
    for index, entry in enumerate(masks):
        if not isinstance(entry, Mapping) or "segmentation" not in entry:
            raise ValueError(f"mask {index} has no 'segmentation'; needed one in each, or arrays only")
        arrays.append(np.asarray(entry["segmentation"]))
    return np.asarray(arrays)


def _stacked(given: NDArray[np.generic]) -> NDArray[np.generic]:
    """Masks (n, h, w) of numbers."""
    if given.ndim == 4 and given.shape[1] == 1:
        given = given[:, 0]
    given = given[None] if given.ndim == 2 else given
    if given.ndim != 3 or 0 in given.shape or given.dtype.kind not in "biuf":
        raise ValueError(f"masks have shape {given.shape} and type {given.dtype}; needed numbers (n, h, w) or (h, w)")
    if not np.isfinite(given).all():
        raise ValueError("masks hold NaN or infinite values; needed finite numbers")
    return given


def _guessed_kind(given: NDArray[np.generic]) -> str:
    if given.dtype.kind in "iu":
        values = np.unique(given)
        if len(values) > 2 or not np.isin(values, (0, 1, 255)).all():
            raise ValueError(f"masks hold {len(values)} integer values; needed 0 and 1 (or 255), or say their kind")
    if given.dtype.kind != "f":
        return "mask"
    return "probability" if given.min() >= 0.0 and given.max() <= 1.0 else "logit"


def _items(path: Path, image: str | int | None) -> list[_Item]:
    """The regions of a file, each with a name of its own."""
    if not path.is_file():
        raise FileNotFoundError(f"{path} isn't there; needed a label image, a COCO or a labelme file")
    items = list(_json_items(path, image) if path.suffix.lower() == ".json" else _label_items(path))
    if not items:
        raise ValueError(f"{path} holds no regions; needed at least one")
    taken: set[str] = set()
    named = []
    for item in items:
        number, name = 1, item.name
        while name in taken:
            number += 1
            name = f"{item.name} {number}"
        taken.add(name)
        named.append(item._replace(name=name))
    return named


def _label_items(path: Path) -> Iterator[_Item]:
    try:
        with Image.open(path) as picture:
            pixels = np.asarray(picture)
    except UnidentifiedImageError as error:
        raise ValueError(f"{path} is no image; needed a label image, a COCO or a labelme file (.json)") from error
    labels, shown = (_packed(pixels), "#{:06x}") if pixels.ndim == 3 else (pixels, "{}")
    values = [int(value) for value in np.unique(labels) if value]
    if len(values) > MOST_LABELS:
        raise ValueError(f"{path} holds {len(values)} values; a label image has at most {MOST_LABELS}")
    for value in values:
        name = path.stem if len(values) == 1 else shown.format(value)
        yield _Item(name, [], np.asarray(labels == value), (labels.shape[0], labels.shape[1]))


def _packed(pixels: NDArray[np.uint8]) -> NDArray[np.uint32]:
    """Colours (h, w, 1 to 4) as one number 0xRRGGBB; transparent pixels, and grey ones' alpha, count as black."""
    channels = pixels.astype(np.uint32)
    colours = channels[..., :3] if channels.shape[2] >= 3 else np.repeat(channels[..., :1], 3, axis=2)
    packed = (colours[..., 0] << 16) | (colours[..., 1] << 8) | colours[..., 2]
    shown = channels[..., -1] > 0 if channels.shape[2] in {2, 4} else True
    return np.asarray(np.where(shown, packed, 0), dtype=np.uint32)


def _json_items(path: Path, image: str | int | None) -> Iterator[_Item]:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"{path} is no JSON: {error}") from error
    if isinstance(content, dict) and "shapes" in content:
        return _labelme_items(path, content)
    if isinstance(content, dict) and {"images", "annotations"} <= content.keys():
        return _coco_items(path, content, image)
    found = sorted(content) if isinstance(content, dict) else type(content).__name__
    raise ValueError(f"{path} holds {found}; needed 'shapes' (labelme) or 'images' and 'annotations' (COCO)")


def _labelme_items(path: Path, content: dict[str, object]) -> Iterator[_Item]:
    size = _size(content, "imageHeight", "imageWidth", str(path))
    for index, shape in enumerate(_listed(content, "shapes", str(path))):
        item = f"{path}, shape {index}"
        name, kind = shape.get("label"), shape.get("shape_type", "polygon")
        if not isinstance(name, str) or not name:
            raise ValueError(f"{item} has the label {name!r}; needed a name")
        if kind not in {"polygon", "rectangle"}:
            raise ValueError(f"{item} ({name!r}) is a {kind!r}; needed a polygon or a rectangle")
        points = _points(shape.get("points"), item, 2 if kind == "rectangle" else 3)
        if kind == "rectangle":
            (left, top), (right, bottom) = points[:2]
            points = np.array([(left, top), (right, top), (right, bottom), (left, bottom)])
        yield _Item(name, [points], None, size)


def _coco_items(path: Path, content: dict[str, object], image: str | int | None) -> Iterator[_Item]:
    chosen = _coco_image(path, _listed(content, "images", str(path)), image)
    size = _size(chosen, "height", "width", f"{path}, image {chosen.get('id')}")
    categories = content.get("categories", [])
    names = {entry.get("id"): entry.get("name") for entry in categories} if isinstance(categories, list) else {}
    for index, entry in enumerate(_listed(content, "annotations", str(path))):
        if entry.get("image_id") != chosen.get("id"):
            continue
        item = f"{path}, annotation {entry.get('id', index)}"
        category = entry.get("category_id")
        name = str(names.get(category) or f"category {category}")
        segmentation = entry.get("segmentation")
        if isinstance(segmentation, dict):
            yield _Item(name, [], _run_length_mask(segmentation, size, item), size)
        elif isinstance(segmentation, list) and segmentation:
            polygons = [_points(part, f"{item}, polygon {k}", 3) for k, part in enumerate(segmentation)]
            yield _Item(name, polygons, None, size)
        else:
            raise ValueError(f"{item} has the segmentation {segmentation!r}; needed polygons or a run-length code")


def _coco_image(path: Path, images: list[dict[str, object]], image: str | int | None) -> dict[str, object]:
    if image is None and len(images) == 1:
        return images[0]
    matching = [entry for entry in images if image is not None and image in (entry.get("id"), entry.get("file_name"))]
    if len(matching) != 1:
        held = ", ".join(f"{entry.get('id')} ({entry.get('file_name')})" for entry in images[:8])
        raise ValueError(f"{path} has {len(matching)} images {image!r}; needed the id or file name of one of: {held}")
    return matching[0]


def _run_length_mask(code: Mapping[str, object], size: tuple[int, int], item: str) -> Mask:
    """The mask of COCO's run lengths: down the columns, starting with 0; as numbers or as their text."""
    counts = code.get("counts")
    try:
        runs = np.array(_decoded(counts) if isinstance(counts, str) else counts, dtype=np.int64)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{item} has counts that aren't run lengths; needed whole numbers or COCO's text") from error
    if code.get("size") not in (list(size), size):
        raise ValueError(f"{item} has size {code.get('size')}; the image's is {list(size)} (h, w)")
    if runs.ndim != 1 or (runs < 0).any() or runs.sum() != size[0] * size[1]:
        raise ValueError(f"{item} has run lengths for {runs.sum()} pixels; needed {size[0] * size[1]}")
    values = np.repeat(np.arange(len(runs)) % 2 == 1, runs)
    return np.ascontiguousarray(values.reshape(size[1], size[0]).T)


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
        if not bits & 0x20:
            if bits & 0x10:
                value -= 1 << shift
            runs.append(value + runs[-2] if len(runs) > 2 else value)
            value, shift = 0, 0
    if shift:
        raise ValueError("the run-length text ends within a number")
    return runs


def _points(given: object, item: str, least: int) -> Array:
    """Polygon (n, 2) of corner-based [[x, y], ...] or [x, y, x, y, ...], moved to pixel centres."""
    try:
        points = np.asarray(given, dtype=np.float64)
        points = points.reshape(-1, 2) if points.ndim == 1 else points
    except (TypeError, ValueError) as error:
        raise ValueError(f"{item} has points that aren't pairs of numbers; needed [x, y] each") from error
    if points.ndim != 2 or points.shape[1] != 2 or len(points) < least or not np.isfinite(points).all():
        raise ValueError(f"{item} has points of shape {points.shape}; needed at least {least} finite [x, y]")
    return points - CORNER_TO_CENTRE


def _listed(content: Mapping[str, object], key: str, item: str) -> list[dict[str, object]]:
    entries = content.get(key)
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise ValueError(f"{item} has {key!r} of type {type(entries).__name__}; needed a list of objects")
    return entries


def _size(content: Mapping[str, object], height: str, width: str, item: str) -> tuple[int, int]:
    values = content.get(height), content.get(width)
    if not all(isinstance(value, int) and value > 0 for value in values):
        raise ValueError(f"{item} has {height} {values[0]!r} and {width} {values[1]!r}; needed whole numbers above 0")
    return int(str(values[0])), int(str(values[1]))


def _mask_of(item: _Item) -> Mask:
    if item.mask is not None:
        return item.mask
    mask = np.zeros(item.size, dtype=np.bool_)
    for polygon in item.polygons:
        mask |= polygon2mask(item.size, polygon[:, ::-1])  # type: ignore[no-untyped-call]
    return mask


def _region_of(item: _Item) -> ImageRegion:
    if item.mask is not None:
        return ImageRegion.from_mask(item.mask)
    if len(item.polygons) == 1:
        return ImageRegion.from_polygon([item.polygons[0]])
    union = shapely.union_all([shapely.make_valid(shapely.Polygon(polygon)) for polygon in item.polygons])
    rings = []
    for part in shapely.get_parts(union):
        if isinstance(part, shapely.Polygon):
            facing = orient(part)
            rings += [np.asarray(ring.coords)[:-1] for ring in (facing.exterior, *facing.interiors)]
    return ImageRegion(tuple(_core.plane_rings(rings, polygon=False)))
