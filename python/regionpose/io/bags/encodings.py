"""From the rows of a raw picture in one of the encodings of `sensor_msgs/msg/Image` to 8 bit sRGB."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import convolve

from regionpose.validation.arrays import eight_bits

Picture = NDArray[np.uint8]

RED_FRACTION, BLUE_FRACTION = 0.299, 0.114
"""Weights of red and blue in luma (ITU-R BT.601-7, section 2.5.1)."""

BLACK, LUMA_SPAN, GRAY, CHROMA_SPAN = 16, 219, 128, 224
"""Where luma and chroma begin in 8 bits, and how far they span (ITU-R BT.601-7, section 2.5.3)."""

NEIGHBORS = np.array([[1.0, 2.0, 1.0], [2.0, 4.0, 2.0], [1.0, 2.0, 1.0]])
"""Weights of linear interpolation between every second pixel."""


class Encoding(NamedTuple):
    """How many numbers a pixel has, their type, and what makes a picture (h, w, 3) of levels (h, w, numbers)."""

    numbers: int
    kind: str
    picture: Callable[[NDArray[Any]], NDArray[Any]]
    even: bool = False
    """Whether two pixels beside one another belong together."""


def _channels(values: NDArray[Any], order: tuple[int, ...]) -> NDArray[Any]:
    """The channels red, green and blue, or gray thrice, by where they stand."""
    return np.broadcast_to(values[..., list(order)], (*values.shape[:2], 3))


def _demosaiced(values: NDArray[Any], pattern: str) -> NDArray[Any]:
    """The picture of a Bayer mosaic, by the colors of its first four pixels, what is missing interpolated linearly."""
    mosaic = values[..., 0].astype(np.float32)
    picture = np.empty((*mosaic.shape, 3), np.float32)
    for channel, color in enumerate("rgb"):
        there = np.zeros(mosaic.shape, np.float32)
        for place in (place for place, each in enumerate(pattern) if each == color):
            there[place // 2 :: 2, place % 2 :: 2] = 1.0
        weighted, weight = (convolve(each, NEIGHBORS, mode="constant") for each in (mosaic * there, there))
        # A single row or column may not show a color at all.
        around = weighted / np.maximum(weight, 1.0)
        picture[..., channel] = np.where(there > 0.0, mosaic, around)
    return picture


def _from_luma(values: NDArray[Any], luma: int) -> NDArray[Any]:
    """Luma, which stands at `luma` in each pixel, and one chroma value a pixel, blue's and red's in turn."""
    chroma = values[..., 1 - luma].astype(np.float32) - GRAY
    blue, red = (np.repeat(chroma[:, first::2], 2, axis=1) * (255.0 / CHROMA_SPAN) for first in (0, 1))
    gray = (values[..., luma].astype(np.float32) - BLACK) * (255.0 / LUMA_SPAN)
    of_red, of_blue = 2.0 * (1.0 - RED_FRACTION) * red, 2.0 * (1.0 - BLUE_FRACTION) * blue
    of_green = (RED_FRACTION * of_red + BLUE_FRACTION * of_blue) / (1.0 - RED_FRACTION - BLUE_FRACTION)
    return np.stack([gray + of_red, gray - of_green, gray + of_blue], axis=2)


ENCODINGS: dict[str, Encoding] = {
    **{
        name: Encoding(numbers, kind, partial(_channels, order=order))
        for name, numbers, kind, order in (
            ("rgb8", 3, "u1", (0, 1, 2)),
            ("rgba8", 4, "u1", (0, 1, 2)),
            ("bgr8", 3, "u1", (2, 1, 0)),
            ("bgra8", 4, "u1", (2, 1, 0)),
            ("8uc3", 3, "u1", (2, 1, 0)),
            ("mono8", 1, "u1", (0,)),
            ("8uc1", 1, "u1", (0,)),
            ("mono16", 1, "u2", (0,)),
            ("16uc1", 1, "u2", (0,)),
        )
    },
    **{
        f"bayer_{pattern}{bits}": Encoding(1, f"u{bits // 8}", partial(_demosaiced, pattern=pattern))
        for bits in (8, 16)
        for pattern in ("rggb", "bggr", "gbrg", "grbg")
    },
    **{name: Encoding(2, "u1", partial(_from_luma, luma=1), even=True) for name in ("yuv422", "uyvy")},
    **{name: Encoding(2, "u1", partial(_from_luma, luma=0), even=True) for name in ("yuv422_yuy2", "yuyv")},
}
"""By name, in lower case."""


def picture_of(levels: NDArray[Any], encoding: Encoding) -> Picture:
    """The picture (h, w, 3) of the numbers (h, w, numbers) of its pixels."""
    shades = encoding.picture(eight_bits(levels))
    return np.ascontiguousarray(np.clip(np.rint(shades), 0, 255), dtype=np.uint8)
