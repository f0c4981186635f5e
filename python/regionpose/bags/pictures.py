"""Pictures of a bag's messages, as 8 bit sRGB."""

from __future__ import annotations

from collections.abc import Callable
from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray

from regionpose.bags.messages import read_messages
from regionpose.bags.place import BagPlace
from regionpose.reading import FileError, read_pixels

Picture = NDArray[np.uint8]

KINDS = ("Image", "CompressedImage")

LAYOUTS: dict[str, tuple[str, tuple[int, ...]]] = {
    "rgb8": ("u1", (0, 1, 2)),
    "rgba8": ("u1", (0, 1, 2, 3)),
    "bgr8": ("u1", (2, 1, 0)),
    "bgra8": ("u1", (2, 1, 0, 3)),
    "8uc3": ("u1", (2, 1, 0)),
    "mono8": ("u1", (0,)),
    "8uc1": ("u1", (0,)),
    "mono16": ("u2", (0,)),
    "16uc1": ("u2", (0,)),
}
"""The numbers of a pixel of each encoding: their type, and where red, green, blue and alpha stand, or gray."""


def read_bag_picture(place: BagPlace) -> Picture:
    """The picture (h, w, 3) of a message of an Image or a CompressedImage.

    FileError for other messages, other encodings (Bayer patterns and YUV among them) and damage; else as of
    `read_messages`.
    """
    if place.count != 1:
        raise FileError(f"{place}: found {place.count} messages asked for; needed one of a picture")
    message = read_messages(place, KINDS)[0]
    read: Callable[[BagPlace, Any], Picture] = _decoded if hasattr(message.content, "format") else _unpacked
    return read(place, message.content)


def _decoded(place: BagPlace, message: Any) -> Picture:
    """The picture of a CompressedImage: a JPEG or a PNG."""
    return read_pixels(place.bag, "RGB", per_pixel=3, content=BytesIO(bytes(message.data))).values


def _unpacked(place: BagPlace, message: Any) -> Picture:
    """The picture of an Image, rows of which may be padded."""
    encoding, height, width, step = str(message.encoding), int(message.height), int(message.width), int(message.step)
    if encoding.lower() not in LAYOUTS:
        raise FileError(f"{place}: found the encoding {encoding!r}; needed {', '.join(LAYOUTS)}, or a CompressedImage")
    kind, order = LAYOUTS[encoding.lower()]
    data, row = np.asarray(message.data, dtype=np.uint8), width * len(order) * np.dtype(kind).itemsize
    if not (height > 0 and width > 0 and row <= step and height * step <= len(data)):
        raise FileError(f"{place}: found {len(data)} bytes in rows of {step}; needed {height} rows of {row}")
    rows = np.ascontiguousarray(data[: height * step].reshape(height, step)[:, :row])
    values = rows.view(np.dtype(kind).newbyteorder(">" if message.is_bigendian else "<")).reshape(height, width, -1)
    shades = values[..., list(order)[:3]]
    # The upper byte of 16 bits is the shade in 8.
    levels = shades if kind == "u1" else shades >> 8
    return np.ascontiguousarray(np.broadcast_to(levels, (height, width, 3)).astype(np.uint8))
