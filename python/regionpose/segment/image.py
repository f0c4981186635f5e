"""Image regions grown from a seed.

The work is done in three steps: smoothing (a median) and the choice of the tolerance on a reduced image, then the
outline at full resolution, placed by how the colors of both sides mix in each pixel.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Literal, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image
from scipy import ndimage

from regionpose import _core
from regionpose.segment.medians import disc_median
from regionpose.segment.outlining import Growth, Reduced, as_bytes, lab_of, outlined
from regionpose.validation.arrays import Array, checked_levels, sample_bits
from regionpose.validation.content import Content

Floats = NDArray[np.float32]
Bytes = NDArray[np.uint8]
Mask = NDArray[np.bool_]
Steps = NDArray[np.uint16]
Window = tuple[slice, slice]

WORK_PIXELS = 300_000
"""Size of the reduced image: a region worth a pose keeps hundreds of pixels, and growing takes under a second."""

SMOOTHING_FRACTION = 1 / 400
"""Default radius of the median over the image's diagonal: the joints of a brick wall that fills the image vanish."""

LARGEST_TOLERANCE = 40.0
"""CIELAB units; colors farther apart belong to different surfaces."""

TOLERANCE_STEP = 0.15
"""CIELAB units between tolerances that are compared, far below a visible difference (about 2)."""

TOLERANCES = int(LARGEST_TOLERANCE / TOLERANCE_STEP) + 1
"""How many are compared, from zero."""

STABILITY_SPAN = 8
"""Steps of the tolerance on both sides over which the growth of the area is taken."""

GROWTH_PENALTY = 5.0
"""A region that grows by a fifth within the span loses half of its score."""

SMALLEST_FRACTION, LARGEST_FRACTION = 5e-4, 0.8
"""Fractions of the image between which the tolerance is looked for: below are single bricks, above is everything."""

GOOD_FRACTION = 0.65
"""Of the tolerances that score this fraction of the best, the first range wins: the smaller region around the seed."""

NEAR_BEST_FRACTION = 0.85
"""In that range the least tolerance of this fraction of the best score: a larger one reaches into the mixed pixels."""


OTHER_SIZE = 1.3
"""Ratio of areas from which two regions around a seed are two proposals; a convention, plain to see."""

CLOSER_FRACTION = 0.5
"""A region whose surroundings take less than this fraction of the image is grown again in them alone, less reduced."""


@overload
def grow_image_region(
    image: ArrayLike,
    seed: ArrayLike,
    *,
    tolerance: float | None = None,
    smoothing_px: float | None = None,
    fill_holes: bool = True,
    coverage: Literal[False] = False,
    linear_light: bool = False,
) -> Mask: ...


@overload
def grow_image_region(
    image: ArrayLike,
    seed: ArrayLike,
    *,
    tolerance: float | None = None,
    smoothing_px: float | None = None,
    fill_holes: bool = True,
    coverage: Literal[True],
    linear_light: bool = False,
) -> Floats: ...


def grow_image_region(
    image: ArrayLike,
    seed: ArrayLike,
    *,
    tolerance: float | None = None,
    smoothing_px: float | None = None,
    fill_holes: bool = True,
    coverage: bool = False,
    linear_light: bool = False,
) -> Mask | Floats:
    """The mask of the surface around a seed: the connected pixels whose color is like the region's.

    Parameters
    ----------
    image : (h, w) or (h, w, 3) array
        uint8, uint16 or floats in [0, 1], sRGB-encoded unless `linear_light`.
    seed : (2,) array
        x and y in pixels, x right, y down.
    tolerance : float, optional
        CIELAB units; by default the one whose outline shows a high contrast, is short and moves least (after the
        maximally stable regions of Matas et al. 2002), and among similar ones the smallest.
    smoothing_px : float, optional
        Radius in pixels of a median that wipes out texture thinner than itself, 0 for none; 1/400 of the diagonal by
        default.
    fill_holes : bool
        Whether holes count as the region's; True by default.
    coverage : bool
        Return the fraction of each pixel in [0, 1] (float32) instead of a bool mask, from how the colors of both sides
        mix in it; `ImageRegion.from_mask` takes either.
    linear_light : bool
        Whether the image's values are proportional to light; False by default.

    Returns
    -------
    (h, w) array of bool or float32
        The mask, or the coverage.

    Raises
    ------
    ValueError
        For another image, a seed outside it, or a negative option.
    """
    given = _checked_image(image)
    seed_place = _checked_seed(seed, given.shape)
    tolerance, smoothing = _checked_option("tolerance", tolerance), _checked_option("smoothing_px", smoothing_px)
    reduced = _reduced_photo(Content.of(given), smoothing)
    growth = _grown(reduced, seed_place, tolerance)
    closer = _surroundings(growth.mask, reduced.factor, given.shape)
    if reduced.factor > 1 and given[closer].size <= CLOSER_FRACTION * given.size:
        seed_place = seed_place[0] - closer[1].start, seed_place[1] - closer[0].start
        reduced = _reduced(given[closer], smoothing)
        growth = _grown(reduced, seed_place, tolerance)
    else:
        closer = slice(0, given.shape[0]), slice(0, given.shape[1])
    fractions = np.zeros(given.shape[:2], dtype=np.float32)
    fractions[closer] = outlined(given[closer], seed_place, reduced, growth, fill_holes, linear_light)
    return fractions if coverage else np.asarray(fractions >= 0.5)


def stable_tolerances(image: ArrayLike, seed: ArrayLike, *, most: int) -> list[tuple[float, float]]:
    """Tolerances (CIELAB units) of up to `most` regions around a seed whose outlines stand out, in order of size.

    Each with its region's area over that of the region that `grow_image_region` chooses, which is among them. Arguments
    and errors as there.
    """
    given = _checked_image(image)
    x, y = _checked_seed(seed, given.shape)
    reduced = _reduced_photo(Content.of(given), None)
    growth = _grown(reduced, (x, y), None)
    steps, scores = _stepped(reduced.lab, _start(reduced, (x, y)), growth.color)
    areas = np.cumsum(np.bincount(steps.ravel(), minlength=len(scores) + 1))[: len(scores)]
    own = round(growth.tolerance / TOLERANCE_STEP)
    kept = [own]
    for step in np.argsort(-scores, kind="stable"):
        apart = all(max(areas[step], areas[other]) > OTHER_SIZE * min(areas[step], areas[other]) for other in kept)
        if len(kept) < most and scores[step] > 0.0 and apart:
            kept.append(int(step))
    return [(float(step * TOLERANCE_STEP), float(areas[step] / areas[own])) for step in sorted(kept)]


@lru_cache(maxsize=1)
def _reduced_photo(photo: Content[np.generic], smoothing: float | None) -> Reduced:
    """A whole image, reduced once for all seeds in it: that takes longer than to grow a region."""
    return _reduced(photo.array, smoothing)


def _surroundings(mask: Mask, factor: int, shape: tuple[int, ...]) -> Window:
    """The box of a mask of the reduced image, with as much again on every side, in the image."""
    bounds = [np.flatnonzero(mask.any(axis=axis))[[0, -1]] for axis in (1, 0)]
    spans = [(max(int(2 * low - high - 1), 0), int(2 * high - low + 2)) for low, high in bounds]
    rows, columns = (
        slice(low * factor, min(high * factor, size)) for (low, high), size in zip(spans, shape[:2], strict=True)
    )
    return rows, columns


def _checked_image(image: ArrayLike) -> NDArray[np.generic]:
    """An image as of `checked_levels`, samples of fewer than 16 bits moved to the upper ones."""
    given = checked_levels(image)
    if given.dtype != np.uint16:
        return given
    return np.left_shift(given.astype(np.uint16, copy=False), np.uint16(16 - sample_bits(given)))


def _checked_seed(seed: ArrayLike, shape: tuple[int, ...]) -> tuple[float, float]:
    try:
        x, y = np.asarray(seed, dtype=np.float64).tolist()
    except (TypeError, ValueError) as error:
        raise ValueError(f"seed is {seed!r}; needed a pixel (x, y)") from error
    if not (-0.5 <= x <= shape[1] - 0.51 and -0.5 <= y <= shape[0] - 0.51):
        raise ValueError(f"seed ({x}, {y}) is outside the image, which has {shape[1]} x {shape[0]} pixels")
    return x, y


def _checked_option(name: str, value: float | None) -> float | None:
    if value is not None and not (np.isfinite(value) and value >= 0.0):
        raise ValueError(f"{name} is {value}; needed a finite number of at least 0, or None")
    return value


def _reduced(image: NDArray[np.generic], smoothing: float | None) -> Reduced:
    """The image averaged to about `WORK_PIXELS` and smoothed."""
    height, width = image.shape[:2]
    factor = max(1, round(float(np.sqrt(height * width / WORK_PIXELS))))
    picture = Image.fromarray(as_bytes(image)).convert("RGB")
    levels = np.asarray(picture.reduce(factor) if factor > 1 else picture)
    pixels = SMOOTHING_FRACTION * float(np.hypot(height, width)) if smoothing is None else smoothing
    radius = round(pixels / factor)
    smooth = disc_median(levels, radius)
    return Reduced(levels, lab_of(smooth), factor, radius)


def _start(reduced: Reduced, seed: tuple[float, float]) -> tuple[int, int]:
    """The row and column of the reduced image that hold a pixel (x, y) of the whole one."""
    x, y = seed
    return int((y + 0.5) // reduced.factor), int((x + 0.5) // reduced.factor)


def _grown(reduced: Reduced, seed: tuple[float, float], tolerance: float | None) -> Growth:
    """The region at the working size, grown from the color around the seed, then from the color of what was found."""
    row, column = start = _start(reduced, seed)
    near = (
        slice(max(row - reduced.radius, 0), row + reduced.radius + 1),
        slice(max(column - reduced.radius, 0), column + reduced.radius + 1),
    )
    once = _region_around(reduced.lab, start, np.median(reduced.lab[near].reshape(-1, 3), axis=0), tolerance)
    again = _region_around(reduced.lab, start, np.median(reduced.lab[once.mask], axis=0), tolerance)
    return again if again.score >= once.score and again.mask[start] else once


def _region_around(lab: Floats, start: tuple[int, int], color: Floats, tolerance: float | None) -> Growth:
    """The connected region within a tolerance of a color."""
    if tolerance is not None:
        within = np.asarray(np.linalg.norm(lab - color, axis=2) <= tolerance)
        within[start] = True
        return Growth(_connected(within, start), color, tolerance, 0.0)
    steps, scores = _stepped(lab, start, color)
    good = np.flatnonzero(scores >= GOOD_FRACTION * scores.max())
    first = good[: np.append(np.flatnonzero(np.diff(good) > 1) + 1, len(good))[0]]
    best = first[scores[first] >= NEAR_BEST_FRACTION * scores[first].max()][0]
    return Growth(np.asarray(steps <= best), color, float(best * TOLERANCE_STEP), float(scores[best]))


def _stepped(lab: Floats, start: tuple[int, int], color: Floats) -> tuple[Steps, Array]:
    """The step of the tolerance at which growth arrives at each pixel, and the score of the region of each step."""
    steps = _steps(lab, start, color)
    return steps, _scores(steps, lab)


def _connected(mask: Mask, start: tuple[int, int]) -> Mask:
    """The part of a mask that is connected with a pixel of it, over sides and corners."""
    labels, _ = ndimage.label(mask, np.ones((3, 3)))
    return np.asarray(labels == labels[start])


def _steps(lab: Floats, start: tuple[int, int], color: Floats) -> Steps:
    """The tolerance at which growth from a start arrives at each pixel, in steps; too large ones by one beyond the
    last.
    """
    levels = _core.color_levels(lab, color.tolist(), TOLERANCE_STEP, TOLERANCES)
    levels[start] = 0
    return _core.flood_levels(levels, start)


def _scores(steps: Steps, lab: Floats) -> Array:
    """Score of the region {steps <= k} for every k: contrast on the outline, times compactness, less for growth."""
    area = np.cumsum(np.bincount(steps.ravel(), minlength=TOLERANCES + 1))[:TOLERANCES]
    total, edges = _core.outline_sums(steps, lab, TOLERANCES)
    # Pixel edges overstate the length of an outline by 4 / pi on average over its directions.
    compactness = np.minimum(np.sqrt(4.0 * np.pi * area) / np.maximum(edges * np.pi / 4.0, 1.0), 1.0)
    index = np.arange(TOLERANCES)
    wider, narrower = np.minimum(index + STABILITY_SPAN, TOLERANCES - 1), np.maximum(index - STABILITY_SPAN, 0)
    growth = (area[wider] - area[narrower]) / np.maximum(area, 1)
    scores = total / np.maximum(edges, 1.0) * np.sqrt(compactness) / (1.0 + GROWTH_PENALTY * growth)
    within = (area >= SMALLEST_FRACTION * steps.size) & (area <= LARGEST_FRACTION * steps.size)
    return np.asarray(np.where(within, scores, 0.0) if within.any() else scores)
