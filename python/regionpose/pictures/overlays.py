"""Pictures that show how well a pose fits: projected regions over observed contours, and a cloud colored by depth."""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image
from skimage.color import lab2rgb, rgb2lab

from regionpose.arrays import checked_image
from regionpose.cameras import Camera
from regionpose.clouds.whole_file import whole_file
from regionpose.estimation.sample_fit import sample_fit
from regionpose.pictures.colors import project_points
from regionpose.pictures.pens import (
    CASING,
    STRIP_ROWS,
    Box,
    Bytes,
    Color,
    Font,
    Text,
    draw_dots,
    draw_lines,
    draw_panel,
    font_for,
    text_size,
    written,
)
from regionpose.pose import Pose
from regionpose.regions.image import ImageRegion
from regionpose.regions.world import WorldRegion
from regionpose.witness import Alignment

Array = NDArray[np.float64]

OBSERVED: Color = (64, 176, 255)
PROJECTED: Color = (255, 140, 0)
AGREES: Color = (0, 230, 90)
DISAGREES: Color = (255, 0, 200)
OUTSIDE: Color = (255, 255, 255)
"""A blue, an orange and white: told apart with every common color blindness (after Okabe and Ito 2008)."""

PAPER: Color = (255, 255, 255)

LINE_SHARE, DOT_SHARE = 1 / 700, 1 / 1300
"""Width of a line and radius of a dot over the image's diagonal."""

STEP_SHARE = 1 / 600
"""Radius of a depth step's dot over the image's diagonal: seen without hiding the edge that it lies on."""

THINNEST_LINE = 1.5
"""Pixels; what is thinner can't be seen."""

ARC_STEP = np.radians(0.2)
"""Radians between neighboring points on a projected edge: distortion bends it by far less than a pixel in between."""

CONTOUR_STEP = 3.0
"""Pixels between neighboring points of a contour that labels keep clear of."""

MOST_PARTS = 2000
"""Parts of an edge at the most, which passes the camera closely then."""

TABLE_SIZE = 256
LIGHTNESS, HUE_DEG = (32.0, 93.0), (315.0, 95.0)
"""CIELAB lightness and hue from the far (dark violet) to the near end (light yellow)."""

CHROMA = 46.0
"""CIELAB chroma of the whole path, which a screen shows at nearly every lightness and hue on it."""

BACKGROUND_SHARE = 0.55
"""Brightness that is left of the gray image under a colored cloud."""

DEPTH_PERCENTILES = (1.0, 99.0)
"""The range of colors leaves single stray points out."""


def overlay_regions(
    image: ArrayLike,
    camera: Camera,
    pose: Pose,
    image_regions: Sequence[ImageRegion] | None,
    world_regions: Sequence[WorldRegion],
    labels: Sequence[str] = (),
) -> Bytes:
    """The image (h, w, 3) with the projected regions' contours over the observed ones.

    Of regions with samples those are drawn as well that lie on the wrong side of the observed contour: orange ones
    belong within it, white ones beyond. Edges are followed through the camera's distortion; parts that it doesn't see
    are left out.

    Parameters
    ----------
    image : (h, w) or (h, w, 3) array
        uint8, uint16 or floats in [0, 1].
    camera : Camera
        That took it.
    pose : Pose
        `camera_from_world`.
    image_regions : sequence of ImageRegion or None
        The observed ones.
    world_regions : sequence of WorldRegion
        The projected ones.
    labels : sequence of str
        Written beside each region; its number without.

    Raises
    ------
    ValueError
        Where the numbers of regions and labels differ.
    """
    picture = checked_image(image).copy()
    observed = _checked_pairs(image_regions, world_regions, labels)
    width = max(THINNEST_LINE, LINE_SHARE * float(np.hypot(*picture.shape[:2])))
    projected = [
        _repeated(camera, [_projected_ring(ring, camera, pose) for ring in region.rings]) for region in world_regions
    ]
    rings = [np.concatenate([ring, ring[:1]]) for region in observed for ring in region.rings]
    lines = _repeated(camera, rings)
    arcs = [piece for region in projected for ring in region for piece in _visible_pieces(ring)]
    draw_lines(picture, [*lines, *arcs], 2.8 * width, CASING, 0.55)
    draw_lines(picture, lines, 2.0 * width, OBSERVED)
    draw_lines(picture, arcs, width, PROJECTED)
    pairs = zip(observed, world_regions, strict=False)
    fits = [fit for pair in pairs if (fit := sample_fit(camera, pose, *pair)) is not None]
    for wrong, color in (([fit.beyond for fit in fits], PROJECTED), ([fit.within for fit in fits], OUTSIDE)):
        places = np.concatenate([np.empty((0, 2)), *wrong])
        draw_dots(picture, places, 2.0 * width, CASING)
        draw_dots(picture, places, 1.4 * width, color)
    names = list(labels) or [f"region {k}" for k in range(len(world_regions))]
    return _annotated(picture, names, projected, lines, width, sampled=bool(fits))


def _checked_pairs(
    image_regions: Sequence[ImageRegion] | None, world_regions: Sequence[WorldRegion], labels: Sequence[str]
) -> list[ImageRegion]:
    observed = list(image_regions or [])
    for name, count in (("image regions", len(observed)), ("labels", len(labels))):
        if count not in {0, len(world_regions)}:
            raise ValueError(f"there are {count} {name} and {len(world_regions)} world regions; needed as many of both")
    return observed


def overlay_depth(
    image: ArrayLike,
    camera: Camera,
    pose: Pose,
    points: ArrayLike,
    *,
    limits_m: tuple[float, float] | None = None,
    radius_px: float | None = None,
) -> Bytes:
    """The image, gray and dimmed, with world points colored by their distance from the camera, and a strip with the
    scale beside its right side: (h, w + strip, 3).

    Points behind others are left out, as in `colorize`, and near ones lie over far ones. The colors run evenly in
    lightness and hue over the logarithm of the distance, light is near; the scale shows meters.

    Parameters
    ----------
    image : (h, w) or (h, w, 3) array
        uint8, uint16 or floats in [0, 1].
    camera : Camera
        That took it.
    pose : Pose
        `camera_from_world`.
    points : (n, 3) array
        World coordinates.
    limits_m : tuple of 2 float, optional
        Nearest and farthest distance of the scale; percentiles 1 and 99 by default.
    radius_px : float, optional
        Of a dot; by the image's size by default.

    Raises
    ------
    ValueError
        For limits that aren't increasing and positive.
    """
    colors = checked_image(image)
    pixels, distances = project_points(points, camera, pose, colors.shape[:2], hidden=False)
    seen = np.flatnonzero(np.isfinite(distances) & (distances > 0.0))
    near, far = _checked_limits(limits_m, distances[seen])
    dot = DOT_SHARE * float(np.hypot(*colors.shape[:2])) if radius_px is None else radius_px
    depth = _depth_image(pixels[seen], distances[seen], colors.shape[:2], dot)
    picture = _dimmed(colors)
    for top in range(0, len(depth), STRIP_ROWS):
        strip = depth[top : top + STRIP_ROWS]
        covered = np.isfinite(strip)
        share = np.log(far / strip[covered]) / np.float32(np.log(far / near))
        shades = np.clip(share * (TABLE_SIZE - 1), 0, TABLE_SIZE - 1).astype(np.uint8)
        picture[top : top + STRIP_ROWS][covered] = depth_colors()[shades]
    return _with_bar(picture, near, far)


def overlay_steps(image: ArrayLike, alignment: Alignment) -> Bytes:
    """The image (h, w, 3) with the depth steps of an `Alignment`: green where an edge of the photo stands out, magenta
    where none does.
    """
    picture = checked_image(image).copy()
    radius = STEP_SHARE * float(np.hypot(*picture.shape[:2]))
    for agrees, color in ((False, DISAGREES), (True, AGREES)):
        draw_dots(picture, alignment.places[alignment.agrees == agrees], radius, color)
    return picture


def _dimmed(colors: Bytes) -> Bytes:
    """The image in gray, (h, w, 3), its brightness reduced."""
    levels = np.round(BACKGROUND_SHARE * np.arange(256)).astype(np.uint8)
    gray = levels[np.asarray(Image.fromarray(colors).convert("L"))]
    return np.repeat(gray[..., None], 3, axis=2)


@lru_cache(maxsize=1)
def depth_colors() -> Bytes:
    """Color table (256, 3), far to near: equal steps are about equally visible.

    Lightness and hue of CIELAB run together at a constant chroma, and the table is spaced by the length of that path.
    """
    share = np.linspace(0.0, 1.0, 4 * TABLE_SIZE)
    lightness = LIGHTNESS[0] + share * (LIGHTNESS[1] - LIGHTNESS[0])
    hue = np.radians(HUE_DEG[0] + share * (HUE_DEG[1] - HUE_DEG[0]))
    path = np.column_stack([lightness, CHROMA * np.cos(hue), CHROMA * np.sin(hue)])
    shown = rgb2lab(np.clip(lab2rgb(path), 0.0, 1.0))
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(shown, axis=0), axis=1))])
    even = np.linspace(0.0, length[-1], TABLE_SIZE)
    table = np.column_stack([np.interp(even, length, shown[:, axis]) for axis in range(3)])
    return np.asarray(np.round(255.0 * np.clip(lab2rgb(table), 0.0, 1.0)), dtype=np.uint8)


def save_png(path: str | os.PathLike[str], picture: ArrayLike, *, overwrite: bool = False) -> Path:
    """Write a picture (h, w, 3) or (h, w) as PNG, whole or not at all, and return its path.

    FileExistsError unless `overwrite`, which replaces the old file when the new one is complete.
    """
    page = Image.fromarray(checked_image(picture))
    with whole_file(Path(path), overwrite=overwrite) as file:
        page.save(file, format="PNG")
    return Path(path)


def projected_lines(camera: Camera, pose: Pose, region: WorldRegion) -> list[Array]:
    """The parts of a region's outline that the camera sees at a pose, as open lines (m, 2) of pixels."""
    rings = _repeated(camera, [_projected_ring(ring, camera, pose) for ring in region.rings])
    return [piece for ring in rings for piece in _visible_pieces(ring)]


def _projected_ring(ring: Array, camera: Camera, pose: Pose) -> Array:
    """Pixels (m, 2) of a closed ring (n, 3), its edges split into short arcs, the first point repeated; NaN where not
    seen.
    """
    start = pose.transform(ring)
    end = np.roll(start, -1, axis=0)
    lengths = np.linalg.norm(end - start, axis=1)
    share = np.clip(-np.sum(start * (end - start), axis=1) / np.maximum(lengths**2, 1e-300), 0.0, 1.0)[:, None]
    closest = np.linalg.norm(start + share * (end - start), axis=1)
    parts = np.clip(np.ceil(lengths / np.maximum(closest * ARC_STEP, 1e-300)), 1, MOST_PARTS).astype(np.int64)
    edge = np.repeat(np.arange(len(ring)), parts)
    within = (np.arange(len(edge)) - np.repeat(np.cumsum(parts) - parts, parts)) / parts[edge]
    points = start[edge] + within[:, None] * (end - start)[edge]
    pixels = camera.project(np.concatenate([points, start[:1]]))
    if camera.period is not None:
        pixels[:, 0] = np.unwrap(pixels[:, 0], period=camera.period)
    return pixels


def _repeated(camera: Camera, lines: list[Array]) -> list[Array]:
    """The lines, those that leave a panorama by one side again where they come in by the other."""
    if camera.period is None or camera.width is None:
        return lines
    copies = list(lines)
    for line in lines:
        left, right = float(np.nanmin(line[:, 0])), float(np.nanmax(line[:, 0]))
        for shift in (camera.period, -camera.period):
            if left + shift < camera.width and right + shift > 0.0:
                copies.append(line + np.array([shift, 0.0]))
    return copies


def _visible_pieces(ring: Array) -> list[Array]:
    """The runs of finite pixels of a ring, at least two long."""
    seen = np.isfinite(ring).all(axis=1)
    cuts = np.flatnonzero(np.diff(seen)) + 1
    return [piece for piece in np.split(ring, cuts) if len(piece) >= 2 and np.isfinite(piece[0]).all()]


def _annotated(
    picture: Bytes,
    labels: Sequence[str],
    projected: Sequence[Sequence[Array]],
    observed: Sequence[Array],
    width: float,
    *,
    sampled: bool,
) -> Bytes:
    """The picture with a label at each region and a legend in the corner that covers the fewest contours."""
    font = font_for(picture)
    pad = round(4 * width)
    lines = _inside(_dense([*observed, *(ring for region in projected for ring in region)]), picture)
    entries = [("observed", OBSERVED)] if observed else []
    entries += [("projected, samples beyond", PROJECTED), ("samples within", OUTSIDE)] if sampled else []
    entries += [] if sampled else [("projected", PROJECTED)]
    texts, legend = _legend(picture, font, pad, width, lines, entries)
    taken = [legend]
    for label, region in zip(labels, projected, strict=True):
        across, line = text_size(font, label)
        box = _label_box(region, (across + 2 * pad, line + 2 * pad), picture, lines, taken)
        if label and box is not None:
            draw_panel(picture, box)
            taken.append(box)
            texts.append(((box[0] + pad, box[1] + pad), label, PAPER))
    return written(picture, texts, font)


def _dense(lines: Sequence[Array]) -> Array:
    """Points (n, 2) on polylines, a few pixels apart, so that a box over a line holds some."""
    points = [np.empty((0, 2))]
    for line in lines:
        start, steps = line[:-1], np.diff(line, axis=0)
        with np.errstate(invalid="ignore"):
            counts = np.nan_to_num(np.clip(np.hypot(*steps.T) / CONTOUR_STEP, 1, MOST_PARTS), nan=1.0).astype(np.int64)
        edge = np.repeat(np.arange(len(steps)), counts)
        share = (np.arange(len(edge)) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[edge]
        points.append(start[edge] + share[:, None] * steps[edge])
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


def _checked_limits(limits: tuple[float, float] | None, distances: NDArray[np.float32]) -> tuple[float, float]:
    if limits is None:
        if len(distances) == 0:
            return 1.0, 10.0
        near, far = np.percentile(distances, DEPTH_PERCENTILES).tolist()
        return (near, far) if far > 1.01 * near else (near / 1.1, near * 1.1)
    near, far = limits
    if not 0.0 < near < far < np.inf:
        raise ValueError(f"limits_m is ({near}, {far}); needed 0 < nearest < farthest, in meters")
    return float(near), float(far)


def _depth_image(
    pixels: NDArray[np.float32], distances: NDArray[np.float32], size: tuple[int, int], radius: float
) -> NDArray[np.float32]:
    """Distance (h, w) of the nearest dot over each pixel, infinite where there is none."""
    center = np.full(size, np.inf, dtype=np.float32)
    columns, rows = np.rint(pixels).astype(np.int32).T
    cells = np.clip(rows, 0, size[0] - 1) * np.int64(size[1]) + np.clip(columns, 0, size[1] - 1)
    np.minimum.at(center.ravel(), cells, distances)
    depth = center.copy()
    reach = int(np.ceil(radius))
    for down in range(-reach, reach + 1):
        for right in range(-reach, reach + 1):
            if 0 < down**2 + right**2 <= (radius + 0.3) ** 2:
                into = (slice(max(down, 0), size[0] + min(down, 0)), slice(max(right, 0), size[1] + min(right, 0)))
                out_of = (
                    slice(max(-down, 0), size[0] + min(-down, 0)),
                    slice(max(-right, 0), size[1] + min(-right, 0)),
                )
                np.minimum(depth[into], center[out_of], out=depth[into])
    return depth


def _with_bar(picture: Bytes, near: float, far: float) -> Bytes:
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
    return written(picture, texts, font)


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
