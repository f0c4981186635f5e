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

UNEVENNESS_PX = 0.1
"""A line is a row of dots, so dense that its rim is no more than this from straight."""

PIXELS_AT_ONCE = 1 << 19
"""Of all dots together: more at a time need memory and are no faster."""


def draw_lines(picture: Bytes, lines: Sequence[Array], width: float, color: Color, opacity: float = 1.0) -> None:
    """Blend anti-aliased polylines (n, 2) of a width in pixels into the picture, in place."""
    import shapely

    height, across = picture.shape[:2]
    radius = 0.5 * width
    # Discs of radius r, s apart, leave notches of about s^2 / (8 r) between them.
    spacing = float(np.sqrt(8.0 * radius * UNEVENNESS_PX))
    whole = shapely.MultiLineString(list(lines))
    near = shapely.clip_by_rect(whole, -width, -width, across + width, height + width)
    evened = shapely.segmentize(shapely.simplify(near, UNEVENNESS_PX, preserve_topology=False), spacing)
    _draw_discs(picture, shapely.get_coordinates(evened), radius, color, opacity)


def draw_dots(picture: Bytes, places: Array, radius: float, color: Color) -> None:
    """Fill anti-aliased circles of a radius (pixels) around places (n, 2) of the picture, in place."""
    _draw_discs(picture, places, radius, color, 1.0)


def _draw_discs(picture: Bytes, places: Array, radius: float, color: Color, opacity: float) -> None:
    """Blend the union of discs into what of the picture they touch."""
    sizes = np.array(picture.shape[1::-1])
    reach = radius + 0.5
    places = places[((places > -reach) & (places < sizes - 1 + reach)).all(axis=1)]
    if not len(places):
        return
    left, top = np.maximum(np.ceil(places.min(axis=0) - reach), 0).astype(np.intp)
    right, bottom = np.minimum(np.floor(places.max(axis=0) + reach) + 1, sizes).astype(np.intp)
    area = picture[top:bottom, left:right]
    ink = _discs(places - (left, top), radius, (bottom - top, right - left))
    rows, columns = np.nonzero(ink)
    fraction = (ink[rows, columns] * np.float32(opacity / 255.0))[:, None]
    area[rows, columns] = np.round(
        area[rows, columns] * (1.0 - fraction) + np.array(color, dtype=np.float32) * fraction
    )


def _discs(places: Array, radius: float, shape: tuple[int, int]) -> Bytes:
    """How much of each pixel (h, w) the discs around places (n, 2) cover, of 255: of the one that covers most of it."""
    ink = np.zeros(shape, dtype=np.uint8)
    offsets = np.arange(int(2.0 * radius) + 2)
    step = max(1, PIXELS_AT_ONCE // len(offsets) ** 2)
    for start in range(0, len(places), step):
        some = places[start : start + step]
        corners = np.ceil(some - (radius + 0.5))
        columns, rows = np.moveaxis(corners.astype(np.int32)[:, :, None] + offsets, 1, 0)
        across, down = np.moveaxis((corners - some).astype(np.float32)[:, :, None] + offsets.astype(np.float32), 1, 0)
        distances = np.sqrt(down[:, :, None] ** 2 + across[:, None, :] ** 2)
        covered = np.clip((radius + 0.5 - distances) * np.float32(255.0), 0.0, 255.0).astype(np.uint8)
        within = ((rows >= 0) & (rows < shape[0]))[:, :, None] & ((columns >= 0) & (columns < shape[1]))[:, None, :]
        cells = rows[:, :, None] * np.int64(shape[1]) + columns[:, None, :]
        touched = within & (covered > 0)
        np.maximum.at(ink.reshape(-1), cells[touched], covered[touched])
    return ink


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
