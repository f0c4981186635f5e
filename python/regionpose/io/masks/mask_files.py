"""The regions that label images and the files of labeling tools hold."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from regionpose.io.masks.coco import coco_items, listed_items, sam_items
from regionpose.io.masks.cvat import cvat_items
from regionpose.io.masks.label_studio import is_label_studio, label_studio_items
from regionpose.io.masks.labelme import labelme_items
from regionpose.io.masks.mask_items import Mask, MaskItem
from regionpose.io.reading import check_regular, read_json, read_pixels
from regionpose.validation.quoting import quoted

JSON_FILES = (
    "'shapes' (labelme) or 'images' and 'annotations' (COCO), masks of Segment Anything, or tasks of Label Studio"
)

MOST_LABELS = 1000
"""Distinct values of a label image at the most; a picture that is no label image holds more."""


class MasksOfFile(Mapping[str, Mask]):
    """Masks (h, w) by name, each made on first use."""

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
    check_regular(path)
    if not path.is_file():
        raise FileNotFoundError(f"{path} isn't there; needed a label image, or a file of a labeling tool")
    items = list(READERS.get(path.suffix.lower(), _label_items)(path, image))
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


def _label_items(path: Path, image: str | int | None) -> Iterator[MaskItem]:
    labels, label_format = _labels(path)
    values = [int(value) for value in np.unique(labels) if value]
    if len(values) > MOST_LABELS:
        raise ValueError(f"{path} holds {len(values)} values; a label image has at most {MOST_LABELS}")
    for value in values:
        name = path.stem if len(values) == 1 else label_format.format(value)
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
        return labelme_items(path, content)
    if isinstance(content, dict) and {"images", "annotations"} <= content.keys():
        return coco_items(path, content, image)
    if isinstance(content, dict) and {"image", "annotations"} <= content.keys():
        return sam_items(path, content)
    if is_label_studio(content):
        return label_studio_items(path, content, image)
    if (
        isinstance(content, list)
        and content
        and all(isinstance(one, dict) and "segmentation" in one for one in content)
    ):
        return listed_items(path, content, image)
    found = quoted(sorted(content)) if isinstance(content, dict) else type(content).__name__
    raise ValueError(f"{path} holds {found}; needed {JSON_FILES}")


READERS: dict[str, Callable[[Path, str | int | None], Iterator[MaskItem]]] = {".json": _json_items, ".xml": cvat_items}
"""By the ending of a file's name; any other is that of a label image."""
