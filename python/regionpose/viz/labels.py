"""Labels beside regions and a legend in a corner, where they cover the fewest lines of a picture."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from regionpose.validation.arrays import Array
from regionpose.viz.pens import (
    PAPER,
    Box,
    Bytes,
    Color,
    Font,
    Text,
    draw_lines,
    draw_panel,
    font_for,
    text_size,
    write_texts,
)

POINT_STEP = 3.0
"""Pixels between neighboring points of a line that labels keep clear of."""

MOST_POINTS = 2000
"""Points of an edge at the most, which goes far beyond the picture then."""


def annotated(
    picture: Bytes,
    labels: Sequence[str],
    regions: Sequence[Sequence[Array]],
    lines: Sequence[Array],
    legend: Sequence[tuple[str, Color]],
    width: float,
) -> Bytes:
    """The picture with a label at each region and a legend.

    `regions`: the rings (n, 2) of each, pixels, NaN where they aren't seen. `lines`: what else is kept clear. `legend`:
    texts and the colors of their lines, `width` pixels wide.
    """
    font, pad = font_for(picture), round(4 * width)
    points = _inside(_dense([*lines, *(ring for region in regions for ring in region)]), picture)
    texts, box = _legend(picture, font, pad, width, points, legend)
    taken = [box]
    for label, region in zip(labels, regions, strict=True):
        across, line = text_size(font, label)
        place = _label_box(region, (across + 2 * pad, line + 2 * pad), picture, points, taken)
        if label and place is not None:
            draw_panel(picture, place)
            taken.append(place)
            texts.append(((place[0] + pad, place[1] + pad), label, PAPER))
    write_texts(picture, texts, font)
    return picture


def _dense(lines: Sequence[Array]) -> Array:
    """Points (n, 2) on polylines, a few pixels apart, so that a box over a line holds some."""
    points = [np.empty((0, 2))]
    for line in lines:
        start, steps = line[:-1], np.diff(line, axis=0)
        with np.errstate(invalid="ignore"):
            counts = np.nan_to_num(np.clip(np.hypot(*steps.T) / POINT_STEP, 1, MOST_POINTS), nan=1.0).astype(np.int64)
        edge = np.repeat(np.arange(len(steps)), counts)
        fraction = (np.arange(len(edge)) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[edge]
        points.append(start[edge] + fraction[:, None] * steps[edge])
    return np.concatenate(points)


def _inside(points: Array, picture: Bytes) -> Array:
    """The points (n, 2) within the picture; comparisons with NaN are false, so those that aren't seen are left out."""
    return np.asarray(points[((points >= 0.0) & (points < (picture.shape[1], picture.shape[0]))).all(axis=1)])


def _legend(
    picture: Bytes, font: Font, pad: int, width: float, lines: Array, entries: Sequence[tuple[str, Color]]
) -> tuple[list[Text], Box]:
    """Draw the legend's panel and line samples; its texts, and the box it takes."""
    line = text_size(font, "Ag|")[1] + pad
    sample = 2 * line
    across = max(text_size(font, note)[0] for note, _ in entries) + sample + 3 * pad
    size = across, len(entries) * line + pad
    low, high = (pad, pad), (picture.shape[1] - size[0] - pad, picture.shape[0] - size[1] - pad)
    corners = [_box_within((x, y), size, picture) for y in (high[1], low[1]) for x in (low[0], high[0])]
    box = min(corners, key=lambda corner: _covered(corner, lines, []))
    draw_panel(picture, box)
    texts: list[Text] = []
    for index, (note, color) in enumerate(entries):
        left, top = box[0] + pad, box[1] + pad + index * line
        y = top + 0.5 * (line - pad)
        draw_lines(picture, [np.array([(left, y), (left + sample - pad, y)])], 1.5 * width, color)
        texts.append(((left + sample, top), note, PAPER))
    return texts, box


def _label_box(
    rings: Sequence[Array], size: tuple[int, int], picture: Bytes, lines: Array, taken: Sequence[Box]
) -> Box | None:
    """Where a label of a size (width, height) covers the fewest contour points (n, 2); None when the region isn't in
    sight.

    Tried are the places above, below, beside and inside the region, flush with its ends and in the middle.
    """
    inside = _inside(np.concatenate(list(rings)), picture)
    if len(inside) == 0:
        return None
    low, high = inside.min(axis=0), inside.max(axis=0)
    middle, gap = (low + high - size) / 2, 0.3 * size[1]
    across, down = (middle[0], low[0], high[0] - size[0]), (middle[1], low[1], high[1] - size[1])
    places = [(x, y) for y in (low[1] - size[1] - gap, high[1] + gap) for x in across]
    places += [(x, y) for x in (high[0] + gap, low[0] - size[0] - gap) for y in down]
    boxes = [_box_within(place, size, picture) for place in (*places, (middle[0], middle[1]))]
    return min(boxes, key=lambda box: _covered(box, lines, taken))


def _box_within(place: tuple[float, float], size: tuple[int, int], picture: Bytes) -> Box:
    """The box of a size with its upper left corner at `place`, or as close as the image allows."""
    x = int(np.clip(place[0], 0, max(picture.shape[1] - size[0], 0)))
    y = int(np.clip(place[1], 0, max(picture.shape[0] - size[1], 0)))
    return x, y, x + size[0], y + size[1]


def _covered(box: Box, lines: Array, taken: Sequence[Box]) -> int:
    """Contour points under a box; another label counts as all of them."""
    left, top, right, bottom = box
    within = (lines >= (left, top)).all(axis=1) & (lines <= (right, bottom)).all(axis=1)
    overlapping = sum(left < b[2] and b[0] < right and top < b[3] and b[1] < bottom for b in taken)
    return int(within.sum()) + overlapping * len(lines)
