"""Distances as colored dots, and the scale of their colors."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from skimage.color import lab2rgb, rgb2lab

from regionpose.viz.pens import CASING, PAPER, Bytes, Text, font_for, text_size, write_texts

Depths = NDArray[np.float32]

TABLE_SIZE = 256
LIGHTNESS, HUE_DEG = (32.0, 93.0), (315.0, 95.0)
"""CIELAB lightness and hue from the far (dark violet) to the near end (light yellow)."""

CHROMA = 46.0
"""CIELAB chroma of the whole path, which a screen shows at nearly every lightness and hue on it."""

DEPTH_PERCENTILES = (1.0, 99.0)
"""The range of colors leaves single stray points out."""


DOT_ROWS = 128
"""Rows of a picture that are drawn at a time, so that a large one needs little memory."""


def draw_depths(picture: Bytes, pixels: Depths, distances: Depths, radius: float, limits: tuple[float, float]) -> None:
    """Color dots of a radius around pixels (n, 2) of a picture (h, w, 3) by their distances (n,) within limits, meters,
    in place; the nearest is in front.
    """
    near, far = limits
    nearest = _nearest(pixels, distances, picture.shape[:2])
    for top in range(0, len(picture), DOT_ROWS):
        strip = _dots(nearest, slice(top, min(top + DOT_ROWS, len(picture))), radius)
        covered = np.isfinite(strip)
        with np.errstate(divide="ignore"):
            fraction = np.log(far / strip) / np.float32(np.log(far / near))
        shades = np.clip(fraction * (TABLE_SIZE - 1), 0, TABLE_SIZE - 1).astype(np.uint8)
        # The whole strip and then what is covered: to pick the pixels takes longer than to shade the others, too.
        np.copyto(picture[top : top + DOT_ROWS], depth_colors().take(shades, axis=0), where=covered[..., None])


@lru_cache(maxsize=1)
def depth_colors() -> Bytes:
    """Color table (256, 3), far to near: equal steps are about equally visible.

    Lightness and hue of CIELAB run together at a constant chroma, and the table is spaced by the length of that path.
    """
    fraction = np.linspace(0.0, 1.0, 4 * TABLE_SIZE)
    lightness = LIGHTNESS[0] + fraction * (LIGHTNESS[1] - LIGHTNESS[0])
    hue = np.radians(HUE_DEG[0] + fraction * (HUE_DEG[1] - HUE_DEG[0]))
    path = np.column_stack([lightness, CHROMA * np.cos(hue), CHROMA * np.sin(hue)])
    displayable = rgb2lab(np.clip(lab2rgb(path), 0.0, 1.0))
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(displayable, axis=0), axis=1))])
    even = np.linspace(0.0, length[-1], TABLE_SIZE)
    table = np.column_stack([np.interp(even, length, displayable[:, axis]) for axis in range(3)])
    return np.asarray(np.round(255.0 * np.clip(lab2rgb(table), 0.0, 1.0)), dtype=np.uint8)


def checked_limits(limits: tuple[float, float] | None, distances: Depths) -> tuple[float, float]:
    """Nearest and farthest distance of a scale, meters: as given, or of distances (n,)."""
    if limits is None:
        if len(distances) == 0:
            return 1.0, 10.0
        near, far = np.percentile(distances, DEPTH_PERCENTILES).tolist()
        return (near, far) if far > 1.01 * near else (near / 1.1, near * 1.1)
    near, far = limits
    if not 0.0 < near < far < np.inf:
        raise ValueError(f"limits_m is ({near}, {far}); needed 0 < nearest < farthest, in meters")
    return float(near), float(far)


def _nearest(pixels: Depths, distances: Depths, size: tuple[int, ...]) -> Depths:
    """Least distance (h, w) at each pixel, infinite where there is none."""
    nearest = np.full(size, np.inf, dtype=np.float32)
    columns, rows = np.rint(pixels).astype(np.int32).T
    cells = np.clip(rows, 0, size[0] - 1) * np.int64(size[1]) + np.clip(columns, 0, size[1] - 1)
    np.minimum.at(nearest.ravel(), cells, distances)
    return nearest


def _dots(nearest: Depths, rows: slice, radius: float) -> Depths:
    """Distance of the nearest dot over each pixel of some rows of a picture (h, w)."""
    height, width = nearest.shape
    # Of a narrow picture dots may be wider than it is.
    below, beside = min(int(np.ceil(radius)), height - 1), min(int(np.ceil(radius)), width - 1)
    low, high = max(rows.start - below, 0), min(rows.stop + below, height)
    # A disc is a stack of lines: the nearest within `half` columns is found once for all lines of that half width.
    around, dots, half = nearest[low:high].copy(), nearest[rows].copy(), 0
    for down in range(below, -1, -1):
        square = (radius + 0.3) ** 2 - down**2
        while half < beside and (half + 1) ** 2 <= square:
            half += 1
            np.minimum(around[:, half:], nearest[low:high, :-half], out=around[:, half:])
            np.minimum(around[:, :-half], nearest[low:high, half:], out=around[:, :-half])
        for shift in (down, -down) if square >= 0.0 else ():
            first, last = max(rows.start + shift, 0), min(rows.stop + shift, height)
            into = dots[max(first - shift - rows.start, 0) : max(last - shift - rows.start, 0)]
            np.minimum(into, around[first - low : max(last, first) - low], out=into)
    return dots


def with_bar(picture: Bytes, near: float, far: float) -> Bytes:
    """The picture and, on a strip beside its right side, the color bar, near below."""
    font = font_for(picture)
    height, width = picture.shape[:2]
    line = text_size(font, "0")[1]
    ticks = _ticks(near, far, most=max(2, int(0.6 * height / (2.5 * line))))
    text_width = max(text_size(font, f"{tick:g} m")[0] for tick in ticks)
    left, top, length, thick = width + line, int(0.18 * height), int(0.64 * height), line
    strip = np.full((height, text_width + 4 * line, 3), CASING, dtype=np.uint8)
    picture = np.concatenate([picture, strip], axis=1)
    shades = np.linspace(0, TABLE_SIZE - 1, length).astype(np.uint8)
    bar = picture[top : top + length, left : left + thick]
    bar[:] = depth_colors()[shades][: bar.shape[0], None]
    texts: list[Text] = []
    for tick in ticks:
        y = top + int(np.log(far / tick) / np.log(far / near) * (length - 1))
        picture[max(y - line // 16, 0) : y + line // 16 + 1, left + thick : left + thick + line // 2] = PAPER
        texts.append(((left + thick + line - line // 4, y - line // 2), f"{tick:g} m", PAPER))
    write_texts(picture, texts, font)
    return picture


def _ticks(near: float, far: float, most: int) -> list[float]:
    """Round distances within the limits, at most so many, fewer per decade when there are too many."""
    powers = range(int(np.floor(np.log10(near))), int(np.ceil(np.log10(far))) + 1)
    for digits in (
        range(10, 100),
        (10, 15, 20, 25, 30, 40, 50, 60, 70, 80, 90),
        (10, 15, 20, 30, 50, 70),
        (10, 20, 50),
        (10,),
    ):
        ticks = [float(f"{digit}e{power - 1}") for power in powers for digit in digits]
        ticks = [tick for tick in ticks if near <= tick <= far]
        if len(ticks) <= most:
            break
    return ticks if len(ticks) >= 2 else [float(f"{near:.3g}"), float(f"{far:.3g}")]
