"""Masks and outlines that others made: of label images, files of labeling tools, and arrays of a segmenter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
import shapely
from numpy.typing import NDArray

from regionpose import _core
from regionpose.io.masks.coco import run_length_mask
from regionpose.io.masks.mask_files import MasksOfFile, file_items
from regionpose.io.masks.mask_items import MaskItem, polygon_rings, size_of
from regionpose.io.masks.segmenter_outputs import output_masks
from regionpose.io.reading import read_pixels
from regionpose.regions.image import ImageRegion
from regionpose.validation.arrays import sample_bits
from regionpose.validation.foreign import as_array

Mask = NDArray[np.bool_]

MOST_SHOWN = 12
"""Regions that a message lists at most."""

PER_PIXEL_OF_FRACTIONS = 2
"""A quarter of the bytes of a pixel's share, once as read and once as the region keeps it."""


def masks_from_file(path: str | Path, *, image: str | int | None = None) -> Mapping[str, Mask]:
    """Masks (h, w) by name from a label image (PNG, TIFF, ...), or a file of COCO, labelme, Segment Anything, Label
    Studio or CVAT (XML for images).

    Each is made on first use, since all masks of a file may take much more memory than the file: keep the one
    that you use more than once.

    A label image has one mask per value other than 0 (per color other than black), named by the value; a single one is
    named after the file. COCO names come from the categories, those of labeling tools from the labels, and Segment
    Anything's masks are "mask 0" and so on; those of a name that several have get a number each. Polygons cover the
    pixels whose center is inside.

    Parameters
    ----------
    path : str or Path
        Of the file.
    image : str or int, optional
        Id or file name of the image within a file that holds several.

    Raises
    ------
    FileNotFoundError
        Where it is missing.
    ValueError
        That names the file and the item.
    """
    items = file_items(Path(path), image)
    for item in items:
        item.check()
    return MasksOfFile({item.name: item.mask for item in items})


def mask_from_file(path: str | Path, label: int | str | None = None, *, image: str | int | None = None) -> Mask:
    """The mask (h, w) of one region of a file that `masks_from_file` reads.

    Parameters
    ----------
    path : str or Path
        Of the file.
    label : int or str, optional
        Its name there, the value in a label image, or the id of an annotation; not needed where the file holds one
        region.
    image : str or int, optional
        As of `masks_from_file`.

    Raises
    ------
    ValueError
        That lists what is there when no region or several match.
    """
    return _chosen(Path(path), label, image).mask()


def regions_from_file(path: str | Path, *, image: str | int | None = None) -> dict[str, ImageRegion]:
    """Image regions by name, of the files of `masks_from_file`; polygons keep their exact vertices.

    Several polygons of one COCO annotation make one region, their union.

    Parameters
    ----------
    path : str or Path
        Of the file.
    image : str or int, optional
        As of `masks_from_file`.
    """
    return {item.name: _region_of(item, path) for item in file_items(Path(path), image)}


def region_from_file(
    path: str | Path,
    label: int | str | None = None,
    *,
    image: str | int | None = None,
    size: tuple[int, int] | None = None,
    panorama: bool = False,
) -> ImageRegion:
    """One image region of a file, with exact vertices as by `regions_from_file`.

    Parameters
    ----------
    path : str or Path
        Of the file.
    label : int or str, optional
        As of `mask_from_file`.
    image : str or int, optional
        As of `masks_from_file`.
    size : tuple of 2 int, optional
        Height and width of the image that the file must belong to.
    panorama : bool
        As of `ImageRegion.from_mask`; several polygons of one region are then its mask, which joins them at the seam.

    Raises
    ------
    ValueError
        As of `mask_from_file`, and where it belongs to another size.
    """
    item = _chosen(Path(path), label, image)
    if size is not None:
        _check_size(path, item.size, size)
    return _region_of(item, path, panorama)


def coverage_from_file(path: str | Path, size: tuple[int, int]) -> NDArray[np.float32]:
    """Fractions (h, w) in [0, 1] of the pixels that a region covers: levels of gray over the largest of their depth,
    such as 255 of 8 bits, and floats as they are.

    `size`: (h, w) of the image that it must belong to; ValueError when it belongs to another size, and for floats
    outside [0, 1].
    """
    levels = read_pixels(Path(path), "L", per_pixel=PER_PIXEL_OF_FRACTIONS).values
    _check_size(path, levels.shape, size)
    if not (levels.min() >= 0 and (levels.dtype.kind in "iu" or levels.max() <= 1)):
        raise ValueError(f"{path}: found fractions from {levels.min()} to {levels.max()}; needed them in [0, 1]")
    whole = 1.0 if levels.dtype.kind == "f" else 2.0 ** sample_bits(levels) - 1.0
    return levels.astype(np.float32) / np.float32(whole)


def masks_from_segmenter(
    masks: Any,
    *,
    kind: Literal["mask", "probability", "logit"] | None = None,
    coverage: bool = False,
) -> list[NDArray[np.bool_] | NDArray[np.float32]]:
    """Masks (h, w) of a segmenter's output, as arrays, tensors, or the objects that hold them.

    The outline of probabilities lies at 1/2, of logits at 0.

    Parameters
    ----------
    masks : (n, h, w), (n, 1, h, w) or (h, w) array, or what a segmenter returns
        Segment Anything's automatic list of mappings with a "segmentation", or its predictor's triple (masks,
        scores, logits), whose masks come by falling score; results of ultralytics, detections of supervision; of
        transformers mappings with "masks", lists of mappings with a "mask", and maps of instances with "segments_info".
    kind : {"mask", "probability", "logit"}, optional
        What the numbers are; without it bool and the integers 0 and 1 (or 255) are masks, floats within [0, 1]
        probabilities, other floats logits.
    coverage : bool
        Return probabilities (float32), whose outline has sub-pixel places, instead of bool masks.
    """
    given = _stacked(_arrays_of(output_masks(masks)))
    scale = kind or _guessed_kind(given)
    if scale not in ("mask", "probability", "logit"):
        raise ValueError(f"kind is {kind!r}; needed 'mask', 'probability', 'logit' or None")
    with np.errstate(over="ignore"):
        fractions = 1.0 / (1.0 + np.exp(-given.astype(np.float32))) if scale == "logit" else given.astype(np.float32)
    fractions = (given != 0).astype(np.float32) if scale == "mask" else fractions
    if not (fractions.min() >= 0.0 and fractions.max() <= 1.0):
        raise ValueError(f"masks hold values from {given.min()} to {given.max()}; needed probabilities in [0, 1]")
    return [fraction if coverage else np.asarray(fraction > 0.5) for fraction in fractions]


def _arrays_of(masks: Any) -> NDArray[np.generic]:
    if not isinstance(masks, Sequence):
        return as_array(masks, "masks", "numbers (n, h, w) or (h, w)")
    arrays = [_array_of(entry, f"mask {index}") for index, entry in enumerate(masks)]
    shapes = {array.shape for array in arrays}
    if len(shapes) > 1:
        raise ValueError(f"masks have the shapes {sorted(shapes)}; needed one shape")
    return np.asarray(arrays)


def _array_of(entry: object, item: str) -> NDArray[np.generic]:
    """An entry of a list of masks: an array, or a dictionary with an array or COCO's run lengths."""
    if not isinstance(entry, Mapping):
        return _rows_of(entry, item)
    if "segmentation" not in entry:
        raise ValueError(f"{item} has no 'segmentation'; needed one in each, or arrays only")
    segmentation = entry["segmentation"]
    if not isinstance(segmentation, Mapping):
        return _rows_of(segmentation, item)
    try:
        height, width = segmentation.get("size", (None, None))
    except (TypeError, ValueError) as error:
        raise ValueError(f"{item} has the size {segmentation['size']!r}; needed (h, w)") from error
    return run_length_mask(segmentation, size_of({"h": height, "w": width}, "h", "w", item), item)


def _rows_of(values: Any, item: str) -> NDArray[np.generic]:
    return as_array(values, item, "(h, w)")


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
            raise ValueError(f"masks hold {len(values)} integer values; needed 0 and 1 (or 255), or their kind")
    if given.dtype.kind != "f":
        return "mask"
    return "probability" if given.min() >= 0.0 and given.max() <= 1.0 else "logit"


def _chosen(path: Path, label: int | str | None, image: str | int | None) -> MaskItem:
    items = file_items(path, image)
    matching = [item for item in items if label is None or label in (item.name, item.number)]
    if len(matching) != 1:
        names = [item.name if item.number is None else f"{item.number} ({item.name!r})" for item in items]
        listed = ", ".join(names[:MOST_SHOWN]) + (", ..." if len(names) > MOST_SHOWN else "")
        found = f"{len(matching)} regions" + ("" if label is None else f" of the label {label!r}")
        raise ValueError(f"{path}: found {found}; needed the label of one of: {listed}")
    return matching[0]


def _check_size(path: str | Path, found: tuple[int, ...], needed: tuple[int, int]) -> None:
    """Check that a mask's size (h, w) is the image's; ValueError otherwise."""
    if found == tuple(needed):
        return
    turned = found == tuple(needed)[::-1]
    cure = ", which its EXIF data turn: mark the photo as viewers show it" if turned else ""
    raise ValueError(
        f"{path}: found masks of {found[1]} x {found[0]} pixels; needed {needed[1]} x {needed[0]}, as the image{cure}"
    )


def _region_of(item: MaskItem, path: str | Path, panorama: bool = False) -> ImageRegion:
    try:
        if not item.polygons or (panorama and len(item.polygons) > 1):
            return ImageRegion.from_mask(item.mask(), panorama=panorama)
        if len(item.polygons) == 1:
            return ImageRegion.from_polygon(item.polygons[0].points)
        return ImageRegion(tuple(_core.plane_rings(polygon_rings(item.polygons), polygon=False)))
    except (ValueError, shapely.errors.ShapelyError) as error:
        raise ValueError(f"{path}, region {item.name!r}: {error}") from error
