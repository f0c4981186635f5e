"""Lines, dots, panels and texts on a picture."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from regionpose.validation.arrays import Array

Bytes = NDArray[np.uint8]
Color = tuple[int, int, int]
Box = tuple[int, int, int, int]
"""Left, top, right, bottom in pixels; the last two are excluded."""

Text = tuple[tuple[int, int], str, Color]
Font = ImageFont.FreeTypeFont | ImageFont.ImageFont

CASING: Color = (16, 16, 20)
PAPER: Color = (255, 255, 255)
PANEL_OPACITY = 0.72

TEXT_FRACTION, SMALLEST_TEXT = 1 / 75, 13
"""Height of a letter over the image's diagonal, and in pixels at the least: what is smaller can't be read."""

SUPERSAMPLING, STRIP_ROWS = 4, 512
"""Lines are drawn four times as large and averaged, in strips, so that a large image needs little memory."""


def draw_lines(picture: Bytes, lines: Sequence[Array], width: float, color: Color, opacity: float = 1.0) -> None:
    """Blend anti-aliased polylines (n, 2) of a width in pixels into the picture, strip by strip."""
    height, across = picture.shape[:2]
    for top in range(0, height, STRIP_ROWS):
        rows = min(STRIP_ROWS, height - top)
        touching = [
            line for line in lines if line[:, 1].max() >= top - width - 1 and line[:, 1].min() <= top + rows + width
        ]
        if not touching:
            continue
        left, right = _columns(np.concatenate(touching), 2.0 * width, across)
        ink = Image.new("L", ((right - left) * SUPERSAMPLING, rows * SUPERSAMPLING))
        pen = ImageDraw.Draw(ink)
        thickness = max(1, round(width * SUPERSAMPLING))
        for line in touching:
            places = (_drawn(line) + 0.5 - (left, top)) * SUPERSAMPLING - 0.5
            pen.line([(float(x), float(y)) for x, y in places], fill=255, width=thickness, joint="curve")
        _blend(picture[top : top + rows, left:right], np.asarray(ink.reduce(SUPERSAMPLING)), color, opacity)


def _columns(places: Array, margin: float, across: int) -> tuple[int, int]:
    """The first column, and the one after the last, of so many that places (n, 2) with a margin around them may touch:
    all of a picture are four times as long to ink as what a region fills.
    """
    low, high = places[:, 0].min() - margin, places[:, 0].max() + margin
    left = int(np.clip(np.floor(low), 0, across - 1))
    return left, int(np.clip(np.ceil(high) + 1, left + 1, across))


def _drawn(line: Array) -> Array:
    """A polyline (n, 2) without vertices that move it by less than half a drawn pixel: each joint takes as long as a
    line.
    """
    import shapely

    whole = shapely.LineString(line)
    return np.asarray(shapely.get_coordinates(whole.simplify(0.5 / SUPERSAMPLING, preserve_topology=False)))


def draw_dots(picture: Bytes, places: Array, radius: float, color: Color) -> None:
    """Fill anti-aliased circles of a radius (pixels) around places (n, 2) of the picture, strip by strip."""
    height, across = picture.shape[:2]
    for top in range(0, height, STRIP_ROWS):
        rows = min(STRIP_ROWS, height - top)
        touching = places[(places[:, 1] >= top - radius) & (places[:, 1] <= top + rows + radius)]
        if not len(touching):
            continue
        left, right = _columns(touching, 2.0 * radius, across)
        ink = Image.new("L", ((right - left) * SUPERSAMPLING, rows * SUPERSAMPLING))
        pen = ImageDraw.Draw(ink)
        for x, y in (touching + 0.5 - (left, top)) * SUPERSAMPLING - 0.5:
            reach = radius * SUPERSAMPLING
            pen.ellipse((float(x - reach), float(y - reach), float(x + reach), float(y + reach)), fill=255)
        _blend(picture[top : top + rows, left:right], np.asarray(ink.reduce(SUPERSAMPLING)), color, 1.0)


def _blend(area: Bytes, ink: Bytes, color: Color, opacity: float) -> None:
    rows, columns = np.nonzero(ink)
    fraction = (ink[rows, columns] * np.float32(opacity / 255.0))[:, None]
    area[rows, columns] = np.round(
        area[rows, columns] * (1.0 - fraction) + np.array(color, dtype=np.float32) * fraction
    )


def font_for(picture: Bytes) -> Font:
    """The font of texts on a picture of its size."""
    size = max(SMALLEST_TEXT, round(TEXT_FRACTION * float(np.hypot(*picture.shape[:2]))))
    try:
        return ImageFont.load_default(size=size)
    except TypeError:  # Pillow 10.0 has one size only
        return ImageFont.load_default()


def text_size(font: Font, text: str) -> tuple[int, int]:
    """Width of a text and height of a line, in pixels."""
    left, _, right, _ = font.getbbox(text)
    _, top, _, bottom = font.getbbox("Ag|")
    return int(np.ceil(right - left)), int(np.ceil(bottom - top))


def draw_panel(picture: Bytes, box: Box) -> None:
    """Darken the rectangle (left, top, right, bottom) so that text on it can be read."""
    left, top, right, bottom = box
    area = picture[max(top, 0) : max(bottom, 0), max(left, 0) : max(right, 0)]
    area[:] = np.round(area * (1.0 - PANEL_OPACITY) + np.array(CASING) * PANEL_OPACITY)


def write_texts(picture: Bytes, items: Sequence[Text], font: Font) -> None:
    """Write texts on the picture, in place; each place is the upper left corner of its line."""
    for (x, y), text, color in items:
        left, top, _, _ = font.getbbox("Ag|")
        box = font.getbbox(text)
        # A pixel more on every side, of which anti-aliasing may touch some.
        low = max(int(x - left + box[0]) - 1, 0), max(int(y - top + box[1]) - 1, 0)
        area = picture[low[1] : max(int(y - top + box[3]) + 2, 0), low[0] : max(int(x - left + box[2]) + 2, 0)]
        if not area.size:
            continue
        page = Image.fromarray(area)
        ImageDraw.Draw(page).text((x - left - low[0], y - top - low[1]), text, fill=color, font=font)
        area[:] = np.asarray(page)
