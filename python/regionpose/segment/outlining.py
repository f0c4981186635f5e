"""The outline of a region that was found in a reduced image, at full resolution.

Near the outline each pixel's color is taken as a mixture of both sides' colors nearby.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage.color import rgb2lab

Floats = NDArray[np.float32]
Bytes = NDArray[np.uint8]
Mask = NDArray[np.bool_]
Window = tuple[slice, slice]

CONTRAST_FLOOR = 0.02
"""Difference of both sides in linear light (0 to 1) below which mixing is uninformative and the outline stays as grown.
"""

TEXTURE_SPREAD = 0.2
"""Spread of the mixing fraction away from the outline above which a single pixel can't separate the sides."""

STRAY_FRACTION = 0.25
"""A color farther than this off the line between both sides, over their difference, is no mixture of them."""

SOFT_PIXELS = 2
"""Pixels on both sides of the outline that may be mixed: the blur of a sharp image."""

LOCAL_REACH = 5
"""Pixels within which the colors of both sides are taken, beyond the soft ones."""

WINDOW_BANDS = 7
"""Margin around the region, in bands: the colors of both sides are averaged within six, one more is the band."""


class Reduced(NamedTuple):
    """The image at the working size: sRGB levels, CIELAB after the median, and pixels per reduced pixel."""

    levels: Bytes
    lab: Floats
    factor: int
    radius: int


class Growth(NamedTuple):
    """A region at the working size, the color and tolerance it was grown with, and its score (0 if given)."""

    mask: Mask
    color: Floats
    tolerance: float
    score: float


def outlined(
    image: NDArray[np.generic],
    seed: tuple[float, float],
    reduced: Reduced,
    growth: Growth,
    fill_holes: bool,
    linear_light: bool,
) -> Floats:
    """Fraction (h, w) of each pixel of the image that a region grown in the reduced image covers."""
    if fill_holes:
        growth = growth._replace(mask=_without_holes(growth.mask))
    near, window = _windows(growth.mask, reduced, image.shape)
    reduced, growth = reduced._replace(levels=reduced.levels[near]), growth._replace(mask=growth.mask[near])
    mask, textured = _full_size(image[window], reduced, growth, linear_light)
    radius = reduced.radius * reduced.factor
    mask = _smoothed(mask, max(radius if textured else radius // 2, 1))
    mask = _one_piece(mask, (round(seed[1]) - window[0].start, round(seed[0]) - window[1].start), fill_holes)
    fractions = np.zeros(image.shape[:2], dtype=np.float32)
    fractions[window] = mask if textured else _outline_fractions(image[window], mask, linear_light)
    return fractions


def _without_holes(mask: Mask) -> Mask:
    """A mask with its holes filled, also those that the image's border cuts, as it does a window of a wall.

    Beyond a border the mask is taken to go on between its first and last pixel there if most of those between are its.
    """
    beyond = np.pad(mask, 1)
    for turned in (beyond, beyond[::-1], beyond.T, beyond.T[::-1]):
        columns = np.flatnonzero(turned[1, 1:-1])
        if len(columns) and 2 * len(columns) > columns[-1] - columns[0]:
            turned[0, 1 + columns[0] : 2 + columns[-1]] = True
    return np.asarray(ndimage.binary_fill_holes(beyond)[1:-1, 1:-1])


def _windows(mask: Mask, reduced: Reduced, shape: tuple[int, ...]) -> tuple[Window, Window]:
    """The part of the reduced image, and that of the image, that decide where the outline of a mask runs."""
    margin = WINDOW_BANDS * (reduced.radius + 2)
    bounds = [np.flatnonzero(mask.any(axis=axis))[[0, -1]] for axis in (1, 0)]
    near = [(max(int(low) - margin, 0), int(high) + margin + 1) for low, high in bounds]
    factor = reduced.factor
    whole = [slice(low * factor, min(high * factor, size)) for (low, high), size in zip(near, shape[:2], strict=True)]
    return (slice(*near[0]), slice(*near[1])), (whole[0], whole[1])


def as_bytes(image: NDArray[np.generic]) -> Bytes:
    """The levels of an image of 8 or 16 bits, or of floats in [0, 1], as 8 bits."""
    if image.dtype == np.uint16:
        return (image.astype(np.uint16) >> 8).astype(np.uint8)
    if image.dtype == np.uint8:
        return image.astype(np.uint8, copy=False)
    return np.round(image.astype(np.float64) * 255.0).astype(np.uint8)


def lab_of(levels: Bytes) -> Floats:
    """CIELAB (h, w, 3) of sRGB bytes, in single precision: to 1e-4 of a unit, in half the time."""
    return np.asarray(rgb2lab(levels.astype(np.float32) / np.float32(255.0)))


def _full_size(image: NDArray[np.generic], reduced: Reduced, growth: Growth, linear_light: bool) -> tuple[Mask, bool]:
    """The region at full size, and whether either side of its outline is textured.

    Near the coarse outline every pixel joins the side it is nearer to: a fraction above 1/2 in the mixture of both
    sides' colors nearby. A third color (such as a shadow) stays where growth put it, and what joins keeps to the
    tolerance.
    """
    coarse = growth.mask
    band = reduced.radius + 2
    core = ndimage.minimum_filter(coarse, size=2 * band + 1)
    outside = ndimage.minimum_filter(~coarse, size=2 * band + 1)
    light = _linear(reduced.levels, linear_light)
    inner, _ = _nearby_mean(light, core, band, fallback=np.median(light[coarse], axis=0))
    outer, has_neighbors = _nearby_mean(light, outside, band, fallback=np.zeros(3, dtype=np.float32))
    contrast = np.where(has_neighbors, np.linalg.norm(inner - outer, axis=2), 0.0).astype(np.float32)
    fields = np.concatenate([inner, outer, contrast[..., None]], axis=2)
    mask = _enlarged(coarse, reduced.factor, image.shape)
    rows, columns = np.nonzero(_enlarged(~(core | outside), reduced.factor, image.shape))
    sampled = _sampled(fields, rows, columns, reduced.factor)
    fraction, stray = _mixture(_linear(image[rows, columns], linear_light), sampled[:, :3], sampled[:, 3:6])
    clear = (sampled[:, 6] > CONTRAST_FLOOR) & (stray < STRAY_FRACTION)
    allowed = mask[rows, columns] | (_color_distance(image[rows, columns], growth.color) <= growth.tolerance)
    mask[rows, columns] = np.where(clear, (fraction >= 0.5) & allowed, mask[rows, columns])
    return mask, _is_textured(light, fields, core, outside, band)


def _linear(values: NDArray[np.generic], linear_light: bool) -> Floats:
    """Linear light in [0, 1] with three channels, of sRGB values (IEC 61966-2-1) or of linear values."""
    scale = {"uint8": 255.0, "uint16": 65535.0}.get(str(values.dtype), 1.0)
    if linear_light:
        level = np.asarray(values, dtype=np.float32) / np.float32(scale)
    elif values.dtype == np.uint8:
        level = _linear_bytes().take(values.astype(np.intp))
    else:
        level = _light(np.asarray(values, dtype=np.float32) / np.float32(scale))
    return np.asarray(level if level.shape[-1:] == (3,) else np.repeat(level[..., None], 3, axis=-1))


@lru_cache(maxsize=1)
def _linear_bytes() -> Floats:
    """Linear light of the 256 sRGB values."""
    return _light(np.arange(256, dtype=np.float32) / np.float32(255.0))


def _light(level: Floats) -> Floats:
    """Linear light in [0, 1] of sRGB levels in [0, 1]."""
    return np.where(level <= 0.04045, level / 12.92, ((level + 0.055) / 1.055) ** 2.4).astype(np.float32)


def _color_distance(values: NDArray[np.generic], color: Floats) -> Floats:
    """Distance (n,) in CIELAB of sRGB values from a color (3,)."""
    levels = as_bytes(values)
    colors = np.repeat(levels[:, None], 3, axis=1) if levels.ndim == 1 else levels
    return np.asarray(np.linalg.norm(lab_of(colors[None])[0] - color, axis=1), dtype=np.float32)


def _nearby_mean(light: Floats, chosen: Mask, band: int, *, fallback: Floats) -> tuple[Floats, Mask]:
    """Weighted mean color (h, w, 3) of the chosen pixels nearby, the fallback elsewhere, and where there are any."""
    reach = 1.5 * band
    weight = ndimage.gaussian_filter(chosen.astype(np.float32), reach)
    sums = ndimage.gaussian_filter(light * chosen[..., None], (reach, reach, 0))
    has_neighbors = weight > 1e-3
    mean = sums / np.maximum(weight, 1e-3)[..., None]
    return np.where(has_neighbors[..., None], mean, fallback).astype(np.float32), has_neighbors


def _enlarged(mask: Mask, factor: int, shape: tuple[int, ...]) -> Mask:
    return mask.repeat(factor, axis=0).repeat(factor, axis=1)[: shape[0], : shape[1]]


def _sampled(fields: Floats, rows: NDArray[np.intp], columns: NDArray[np.intp], factor: int) -> Floats:
    """Fields (h, w, k) of the reduced image at full-size pixels, (n, k)."""
    places = np.stack([(rows + 0.5) / factor - 0.5, (columns + 0.5) / factor - 0.5])
    layers = [ndimage.map_coordinates(fields[..., k], places, order=1, mode="nearest") for k in range(fields.shape[2])]
    return np.stack(layers, axis=1)


def _mixture(light: Floats, inner: Floats, outer: Floats) -> tuple[Floats, Floats]:
    """How colors (n, 3) mix from two: `(I - out) . (in - out) / |in - out|^2`, and the rest over `|in - out|`."""
    step = inner - outer
    square = np.maximum(np.sum(step**2, axis=-1), 1e-12)
    fraction = np.sum((light - outer) * step, axis=-1) / square
    stray = np.linalg.norm(light - outer - fraction[..., None] * step, axis=-1) / np.sqrt(square)
    return fraction, stray


def _is_textured(light: Floats, fields: Floats, core: Mask, outside: Mask, band: int) -> bool:
    """Whether the mixing fraction of pixels known to lie on one side strays from 0 or 1 near the outline."""
    decided = core | outside
    near = decided & ndimage.maximum_filter(~decided, size=2 * band + 1) & (fields[..., 6] > CONTRAST_FLOOR)
    if not near.any():
        return False
    fraction, _ = _mixture(light[near], fields[near][:, :3], fields[near][:, 3:6])
    return bool(np.sqrt(np.mean((fraction - core[near]) ** 2)) > TEXTURE_SPREAD)


def _smoothed(mask: Mask, radius: int) -> Mask:
    """The mask after a median over a square, which takes out texture and spikes and leaves straight outlines."""
    means = ndimage.uniform_filter(mask.astype(np.float32), 2 * radius + 1)
    return np.asarray(means > 0.5)


def _outline_fractions(image: NDArray[np.generic], mask: Mask, linear_light: bool) -> Floats:
    """Fraction (h, w) of each pixel that the region covers, from the mixture of the colors off its outline."""
    core = ndimage.minimum_filter(mask, size=2 * SOFT_PIXELS + 1)
    outside = ndimage.minimum_filter(~mask, size=2 * SOFT_PIXELS + 1)
    rows, columns = np.nonzero(~(core | outside))
    inner, inner_count = _local_mean(image, core, rows, columns, linear_light)
    outer, outer_count = _local_mean(image, outside, rows, columns, linear_light)
    fraction, stray = _mixture(_linear(image[rows, columns], linear_light), inner, outer)
    contrast = np.linalg.norm(inner - outer, axis=1)
    clear = (inner_count > 0) & (outer_count > 0) & (contrast > CONTRAST_FLOOR) & (stray < STRAY_FRACTION)
    fractions = mask.astype(np.float32)
    fractions[rows, columns] = np.where(clear, np.clip(fraction, 0.0, 1.0), fractions[rows, columns])
    return fractions


def _local_mean(
    image: NDArray[np.generic], chosen: Mask, rows: NDArray[np.intp], columns: NDArray[np.intp], linear_light: bool
) -> tuple[Floats, NDArray[np.int64]]:
    """Mean color (n, 3) of the chosen pixels around each of the pixels given, and how many there are."""
    sums, counts = np.zeros((len(rows), 3), dtype=np.float32), np.zeros(len(rows), dtype=np.int64)
    height, width = chosen.shape
    for down in range(-LOCAL_REACH, LOCAL_REACH + 1):
        for right in range(-LOCAL_REACH, LOCAL_REACH + 1):
            row, column = np.clip(rows + down, 0, height - 1), np.clip(columns + right, 0, width - 1)
            indices = np.flatnonzero(chosen[row, column])
            sums[indices] += _linear(image[row[indices], column[indices]], linear_light)
            counts[indices] += 1
    means: Floats = (sums / np.maximum(counts, 1)[:, None]).astype(np.float32)
    return means, counts


def _one_piece(mask: Mask, seed: tuple[int, int], fill_holes: bool) -> Mask:
    """The piece of the mask that holds the seed, or the largest, with its holes filled if `fill_holes` is set.

    ValueError for an empty mask.
    """
    if not mask.any():
        raise ValueError(
            "found a region around the seed so thin that smoothing its outline leaves nothing of it; needed a larger"
            " tolerance or another seed"
        )
    pieces, _ = ndimage.label(mask)
    chosen = pieces == (pieces[seed] or np.argmax(np.bincount(pieces[mask])))
    if not fill_holes:
        return np.asarray(chosen)
    gaps, count = ndimage.label(~chosen)
    edges = np.concatenate([gaps[0], gaps[-1], gaps[:, 0], gaps[:, -1]])
    open_gaps = np.isin(np.arange(count + 1), edges)
    open_gaps[0] = False
    return np.asarray(~open_gaps[gaps])
