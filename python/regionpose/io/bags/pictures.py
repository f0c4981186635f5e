"""Pictures of a bag's messages, as 8 bit sRGB."""

from __future__ import annotations

from collections.abc import Callable
from io import BytesIO
from typing import Any

import numpy as np

from regionpose.io.bags.encodings import ENCODINGS, Picture, picture_of
from regionpose.io.bags.messages import read_messages, usual_fields
from regionpose.io.bags.place import BagPlace
from regionpose.io.reading import FileError, read_colors

KINDS = ("Image", "CompressedImage")


def read_bag_picture(place: BagPlace) -> Picture:
    """The picture (h, w, 3) of a message of an Image or a CompressedImage.

    FileError for other messages, other encodings than those of `ENCODINGS`, and damage; else as of
    `read_messages`.
    """
    if place.count != 1:
        raise FileError(f"{place}: found {place.count} messages selected; needed one of a picture")
    return message_picture(place, read_messages(place, KINDS)[0].content)


def message_picture(place: BagPlace, message: Any) -> Picture:
    """The picture (h, w, 3) of the content of an Image or a CompressedImage; FileError as of `read_bag_picture`."""
    read: Callable[[BagPlace, Any], Picture] = _decoded if hasattr(message, "format") else _unpacked
    with usual_fields(place):
        return read(place, message)


def _decoded(place: BagPlace, message: Any) -> Picture:
    """The picture of a CompressedImage: a JPEG or a PNG."""
    return read_colors(place.bag, content=BytesIO(bytes(message.data)))


def _unpacked(place: BagPlace, message: Any) -> Picture:
    """The picture of an Image, rows of which may be padded."""
    name, height, width, step = str(message.encoding), int(message.height), int(message.width), int(message.step)
    encoding = ENCODINGS.get(name.lower())
    if encoding is None:
        raise FileError(f"{place}: found the encoding {name!r}; needed {', '.join(ENCODINGS)}, or a CompressedImage")
    if encoding.even and width % 2:
        raise FileError(f"{place}: found {width} columns of {name!r}; needed an even number")
    data, row = np.asarray(message.data, dtype=np.uint8), width * encoding.numbers * np.dtype(encoding.kind).itemsize
    if not (height > 0 and width > 0 and row <= step and height * step <= len(data)):
        raise FileError(f"{place}: found {len(data)} bytes in rows of {step}; needed {height} rows of {row}")
    rows = np.ascontiguousarray(data[: height * step].reshape(height, step)[:, :row])
    numbers = rows.view(np.dtype(encoding.kind).newbyteorder(">" if message.is_bigendian else "<"))
    return picture_of(numbers.reshape(height, width, encoding.numbers), encoding)
