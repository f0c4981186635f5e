"""Image regions grown from a seed.

The work is done in three steps: smoothing (a median) and the choice of the tolerance on a reduced image, then the
outline at full resolution, placed by how the colours of both sides mix in each pixel.
"""

from __future__ import annotations

from typing import Literal, NamedTuple, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image
from scipy import ndimage
from skimage.color import rgb2lab
from skimage.filters import rank
from skimage.morphology import disk, reconstruction

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Bytes = NDArray[np.uint8]
Mask = NDArray[np.bool_]
Window = tuple[slice, slice]

WORK_PIXELS = 300_000
"""Size of the reduced image: a region worth a pose keeps hundreds of pixels, and growing takes under a second."""

SMOOTHING_SHARE = 1 / 400
"""Default radius of the median over the image's diagonal: the joints of a brick wall that fills the image vanish."""

LARGEST_TOLERANCE = 40.0
"""CIELAB units; colours farther apart belong to different surfaces."""

TOLERANCE_STEP = 0.15
"""CIELAB units between tolerances that are compared, far below a visible difference (about 2)."""

STABILITY_SPAN = 8
"""Steps of the tolerance on both sides over which the growth of the area is taken."""

GROWTH_PENALTY = 5.0
"""A region that grows by a fifth within the span loses half of its score."""

SMALLEST_SHARE, LARGEST_SHARE = 5e-4, 0.8
"""Shares of the image between which the tolerance is looked for: below are single bricks, above is everything."""

GOOD_SHARE = 0.65
"""Of the tolerances that score this share of the best, the first range wins: the smaller region around the seed."""

NEAR_BEST_SHARE = 0.85
"""In that range the least tolerance of this share of the best score: a larger one reaches into the mixed pixels."""

CONTRAST_FLOOR = 0.02
"""Difference of both sides in linear light (0 to 1) below which mixing says nothing and the outline stays as grown."""

TEXTURE_SPREAD = 0.2
"""Spread of the mixing share away from the outline above which a pixel alone can't tell the sides apart."""

STRAY_SHARE = 0.25
"""A colour farther than this off the line between both sides, over their difference, is no mixture of them."""

SOFT_PIXELS = 2
"""Pixels on both sides of the outline that may be mixed: the blur of a sharp image."""

LOCAL_REACH = 5
"""Pixels within which the colours of both sides are taken, beyond the soft ones."""


OTHER_SIZE = 1.3
"""Ratio of areas from which two regions around a seed are two proposals; a convention, plain to see."""

CLOSER_SHARE = 0.5
"""A region whose surroundings take less than this share of the image is grown again in them alone, less reduced."""

WINDOW_BANDS = 7
"""Margin around the region, in bands: the colours of both sides are averaged within six, one more is the band."""


class _Reduced(NamedTuple):
    """The image at the working size: sRGB levels, CIELAB after the median, and pixels per reduced pixel."""

    levels: Bytes
    lab: Floats
    factor: int
    radius: int


class _Growth(NamedTuple):
    """A region at the working size, the colour and tolerance it was grown with, and its score (0 if given)."""

    mask: Mask
    colour: Floats
    tolerance: float
    score: float


@overload
def grow_image_region(
    image: ArrayLike,
    seed: ArrayLike,
    *,
    tolerance: float | None = None,
    smoothing: float | None = None,
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
    smoothing: float | None = None,
    fill_holes: bool = True,
    coverage: Literal[True],
    linear_light: bool = False,
) -> Floats: ...


def grow_image_region(
    image: ArrayLike,
    seed: ArrayLike,
    *,
    tolerance: float | None = None,
    smoothing: float | None = None,
    fill_holes: bool = True,
    coverage: bool = False,
    linear_light: bool = False,
) -> Mask | Floats:
    """Mask (h, w) of the surface around `seed`: the connected pixels whose colour is within `tolerance` of the
    region's.

    `image`: (h, w) or (h, w, 3), uint8, uint16 or floats in [0, 1], sRGB-encoded unless `linear_light`. `seed`: (x, y)
    in pixels, x right, y down. `tolerance`: CIELAB units; without it, the one whose outline shows a high contrast, is
    short and moves least (after the maximally stable regions of Matas et al. 2002), and among similar ones the
    smallest. `smoothing`: radius in pixels of a median that wipes out texture thinner than itself, 0 for none, without
    it 1/400 of the diagonal. `coverage`: return the share of each pixel in [0, 1] (float32) instead of a bool mask,
    from how the colours of both sides mix in it; `ImageRegion.from_mask` takes either. ValueError for another image, a
    seed outside it, or a negative option.
    """
    given = _checked_image(image)
    seed_place = _checked_seed(seed, given.shape)
    options = _checked_option("tolerance", tolerance), _checked_option("smoothing", smoothing)
    reduced, growth = _found(given, seed_place, *options)
    closer = _surroundings(growth.mask, reduced.factor, given.shape)
    if reduced.factor > 1 and given[closer].size <= CLOSER_SHARE * given.size:
        seed_place = seed_place[0] - closer[1].start, seed_place[1] - closer[0].start
        reduced, growth = _found(given[closer], seed_place, *options)
    else:
        closer = slice(0, given.shape[0]), slice(0, given.shape[1])
    shares = np.zeros(given.shape[:2], dtype=np.float32)
    shares[closer] = _outlined(given[closer], seed_place, reduced, growth, fill_holes, linear_light)
    return shares if coverage else np.asarray(shares >= 0.5)


def stable_tolerances(image: ArrayLike, seed: ArrayLike, *, most: int) -> list[tuple[float, float]]:
    """Tolerances (CIELAB units) of up to `most` regions around a seed whose outlines stand out, in order of size.

    Each with its region's area over that of the region that `grow_image_region` chooses, which is among them. Arguments
    and errors as there.
    """
    given = _checked_image(image)
    x, y = _checked_seed(seed, given.shape)
    reduced, growth = _found(given, (x, y), None, None)
    start = int((y + 0.5) // reduced.factor), int((x + 0.5) // reduced.factor)
    steps, scores = _stepped(reduced.lab, start, growth.colour)
    areas = np.cumsum(np.bincount(steps.ravel(), minlength=len(scores) + 1))[: len(scores)]
    own = round(growth.tolerance / TOLERANCE_STEP)
    kept = [own]
    for step in np.argsort(-scores, kind="stable"):
        apart = all(max(areas[step], areas[other]) > OTHER_SIZE * min(areas[step], areas[other]) for other in kept)
        if len(kept) < most and scores[step] > 0.0 and apart:
            kept.append(int(step))
    return [(float(step * TOLERANCE_STEP), float(areas[step] / areas[own])) for step in sorted(kept)]


def _found(
    image: NDArray[np.generic], seed: tuple[float, float], tolerance: float | None, smoothing: float | None
) -> tuple[_Reduced, _Growth]:
    """The reduced image and the region grown in it."""
    reduced = _reduced(image, smoothing)
    x, y = seed
    return reduced, _grown(reduced, (int((y + 0.5) // reduced.factor), int((x + 0.5) // reduced.factor)), tolerance)


def _surroundings(mask: Mask, factor: int, shape: tuple[int, ...]) -> Window:
    """The box of a mask of the reduced image, with as much again on every side, in the image."""
    bounds = [np.flatnonzero(mask.any(axis=axis))[[0, -1]] for axis in (1, 0)]
    spans = [(max(int(2 * low - high - 1), 0), int(2 * high - low + 2)) for low, high in bounds]
    rows, columns = (
        slice(low * factor, min(high * factor, size)) for (low, high), size in zip(spans, shape[:2], strict=True)
    )
    return rows, columns


def _outlined(
    image: NDArray[np.generic],
    seed: tuple[float, float],
    reduced: _Reduced,
    growth: _Growth,
    fill_holes: bool,
    linear_light: bool,
) -> Floats:
    """Share (h, w) of each pixel of the image that a region grown in the reduced image covers."""
    if fill_holes:
        growth = growth._replace(mask=np.asarray(ndimage.binary_fill_holes(growth.mask)))
    near, window = _windows(growth.mask, reduced, image.shape)
    reduced, growth = reduced._replace(levels=reduced.levels[near]), growth._replace(mask=growth.mask[near])
    mask, textured = _full_size(image[window], reduced, growth, linear_light)
    radius = reduced.radius * reduced.factor
    mask = _smoothed(mask, max(radius if textured else radius // 2, 1))
    mask = _one_piece(mask, (round(seed[1]) - window[0].start, round(seed[0]) - window[1].start), fill_holes)
    shares = np.zeros(image.shape[:2], dtype=np.float32)
    shares[window] = mask if textured else _outline_shares(image[window], mask, linear_light)
    return shares


def _windows(mask: Mask, reduced: _Reduced, shape: tuple[int, ...]) -> tuple[Window, Window]:
    """The part of the reduced image, and that of the image, that decide where the outline of a mask runs."""
    margin = WINDOW_BANDS * (reduced.radius + 2)
    bounds = [np.flatnonzero(mask.any(axis=axis))[[0, -1]] for axis in (1, 0)]
    near = [(max(int(low) - margin, 0), int(high) + margin + 1) for low, high in bounds]
    factor = reduced.factor
    whole = [slice(low * factor, min(high * factor, size)) for (low, high), size in zip(near, shape[:2], strict=True)]
    return (slice(*near[0]), slice(*near[1])), (whole[0], whole[1])


def _checked_image(image: ArrayLike) -> NDArray[np.generic]:
    given = np.asarray(image)
    if given.ndim not in {2, 3} or 0 in given.shape or (given.ndim == 3 and given.shape[2] != 3):
        raise ValueError(f"image has shape {given.shape}; needed (h, w) or (h, w, 3)")
    if given.dtype not in (np.uint8, np.uint16) and given.dtype.kind != "f":
        raise ValueError(f"image has type {given.dtype}; needed uint8, uint16 or floats in [0, 1]")
    if given.dtype.kind == "f" and not (given.min() >= 0.0 and given.max() <= 1.0):
        raise ValueError(f"image holds values from {given.min()} to {given.max()}; needed floats in [0, 1]")
    return given


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


def _reduced(image: NDArray[np.generic], smoothing: float | None) -> _Reduced:
    """The image averaged to about `WORK_PIXELS` and smoothed."""
    height, width = image.shape[:2]
    factor = max(1, round(float(np.sqrt(height * width / WORK_PIXELS))))
    picture = Image.fromarray(_as_bytes(image)).convert("RGB")
    levels = np.asarray(picture.reduce(factor) if factor > 1 else picture)
    pixels = SMOOTHING_SHARE * float(np.hypot(height, width)) if smoothing is None else smoothing
    radius = round(pixels / factor)
    smooth = _median(levels, radius)
    return _Reduced(levels, rgb2lab(smooth).astype(np.float32), factor, radius)


def _as_bytes(image: NDArray[np.generic]) -> Bytes:
    if image.dtype == np.uint16:
        return (image.astype(np.uint16) >> 8).astype(np.uint8)
    if image.dtype == np.uint8:
        return image.astype(np.uint8, copy=False)
    return np.round(image.astype(np.float64) * 255.0).astype(np.uint8)


def _median(levels: Bytes, radius: int) -> Bytes:
    if radius == 0:
        return levels
    return np.stack([rank.median(levels[..., channel], disk(radius)) for channel in range(3)], axis=2)  # type: ignore[no-untyped-call]


def _grown(reduced: _Reduced, start: tuple[int, int], tolerance: float | None) -> _Growth:
    """The region at the working size, grown from the colour around the seed, then from the colour of what was found."""
    row, column = start
    near = (
        slice(max(row - reduced.radius, 0), row + reduced.radius + 1),
        slice(max(column - reduced.radius, 0), column + reduced.radius + 1),
    )
    once = _region_around(reduced.lab, start, np.median(reduced.lab[near].reshape(-1, 3), axis=0), tolerance)
    again = _region_around(reduced.lab, start, np.median(reduced.lab[once.mask], axis=0), tolerance)
    return again if again.score >= once.score and again.mask[start] else once


def _region_around(lab: Floats, start: tuple[int, int], colour: Floats, tolerance: float | None) -> _Growth:
    """The connected region within a tolerance of a colour."""
    distances = np.linalg.norm(lab - colour, axis=2)
    distances[start] = 0.0
    arrivals = _arrivals(distances, start)
    if tolerance is not None:
        return _Growth(np.asarray(arrivals <= tolerance), colour, tolerance, 0.0)
    steps = _steps(arrivals)
    scores = _scores(steps, lab)
    good = np.flatnonzero(scores >= GOOD_SHARE * scores.max())
    first = good[: np.append(np.flatnonzero(np.diff(good) > 1) + 1, len(good))[0]]
    best = first[scores[first] >= NEAR_BEST_SHARE * scores[first].max()][0]
    return _Growth(np.asarray(steps <= best), colour, float(best * TOLERANCE_STEP), float(scores[best]))


def _stepped(lab: Floats, start: tuple[int, int], colour: Floats) -> tuple[NDArray[np.int64], Array]:
    """The step of the tolerance at which growth arrives at each pixel, and the score of the region of each step."""
    distances = np.linalg.norm(lab - colour, axis=2)
    distances[start] = 0.0
    steps = _steps(_arrivals(distances, start))
    return steps, _scores(steps, lab)


def _steps(arrivals: Floats) -> NDArray[np.int64]:
    """Tolerances in steps, those that are too large by one beyond the last."""
    last = LARGEST_TOLERANCE / TOLERANCE_STEP + 1
    return np.asarray(np.minimum(np.ceil(arrivals / TOLERANCE_STEP), last), dtype=np.int64)


def _arrivals(distances: Floats, start: tuple[int, int]) -> Floats:
    """The least tolerance at which growth from the seed arrives at each pixel: the largest step on the best path."""
    marker = np.full_like(distances, distances.max())
    marker[start] = distances[start]
    return np.asarray(reconstruction(marker, distances, method="erosion"), dtype=np.float32)  # type: ignore[no-untyped-call]


def _scores(steps: NDArray[np.int64], lab: Floats) -> Array:
    """Score of the region {steps <= k} for every k: contrast on the outline, times compactness, less for growth.

    Every pair of neighbours lies on the outlines from the smaller step of the two to the larger, so that one pass over
    the pairs adds up all outlines.
    """
    count = int(LARGEST_TOLERANCE / TOLERANCE_STEP) + 1
    area = np.cumsum(np.bincount(steps.ravel(), minlength=count + 1))[:count]
    contrast, length = np.zeros(count + 1), np.zeros(count + 1)
    for axis in (0, 1):
        inner, outer, across = _outline_pairs(np.moveaxis(steps, axis, 0), np.moveaxis(lab, axis, 0))
        for sums, weights in ((contrast, across), (length, np.ones(len(across)))):
            sums += np.bincount(inner, weights, count + 1) - np.bincount(outer, weights, count + 1)
    total, edges = np.cumsum(contrast)[:count], np.cumsum(length)[:count]
    # Pixel edges overstate the length of an outline by 4 / pi on average over its directions.
    compactness = np.minimum(np.sqrt(4.0 * np.pi * area) / np.maximum(edges * np.pi / 4.0, 1.0), 1.0)
    index = np.arange(count)
    wider, narrower = np.minimum(index + STABILITY_SPAN, count - 1), np.maximum(index - STABILITY_SPAN, 0)
    growth = (area[wider] - area[narrower]) / np.maximum(area, 1)
    scores = total / np.maximum(edges, 1.0) * np.sqrt(compactness) / (1.0 + GROWTH_PENALTY * growth)
    within = (area >= SMALLEST_SHARE * steps.size) & (area <= LARGEST_SHARE * steps.size)
    return np.asarray(np.where(within, scores, 0.0) if within.any() else scores)


def _outline_pairs(steps: NDArray[np.int64], lab: Floats) -> tuple[NDArray[np.int64], NDArray[np.int64], Array]:
    """Neighbours along the first axis with different steps: both steps in order, and the contrast over three pixels."""
    first, second = steps[:-1], steps[1:]
    differs = first != second
    beyond = np.concatenate([lab[2:], lab[-1:]])
    before = np.concatenate([lab[:1], lab[:-2]])
    across = np.linalg.norm(beyond[differs] - before[differs], axis=1)
    return np.minimum(first, second)[differs], np.maximum(first, second)[differs], across


def _full_size(image: NDArray[np.generic], reduced: _Reduced, growth: _Growth, linear_light: bool) -> tuple[Mask, bool]:
    """The region at full size, and whether either side of its outline is textured.

    Near the coarse outline every pixel joins the side it is nearer to: a share above 1/2 in the mixture of both sides'
    colours nearby. A third colour (a shadow, say) stays where growth put it, and what joins keeps to the tolerance.
    """
    coarse = growth.mask
    band = reduced.radius + 2
    core = ndimage.minimum_filter(coarse, size=2 * band + 1)
    outside = ndimage.minimum_filter(~coarse, size=2 * band + 1)
    light = _linear(reduced.levels, linear_light)
    inner, _ = _nearby_mean(light, core, band, fallback=np.median(light[coarse], axis=0))
    outer, known = _nearby_mean(light, outside, band, fallback=np.zeros(3, dtype=np.float32))
    contrast = np.where(known, np.linalg.norm(inner - outer, axis=2), 0.0).astype(np.float32)
    fields = np.concatenate([inner, outer, contrast[..., None]], axis=2)
    mask = _enlarged(coarse, reduced.factor, image.shape)
    rows, columns = np.nonzero(_enlarged(~(core | outside), reduced.factor, image.shape))
    sampled = _sampled(fields, rows, columns, reduced.factor)
    share, stray = _mixture(_linear(image[rows, columns], linear_light), sampled[:, :3], sampled[:, 3:6])
    clear = (sampled[:, 6] > CONTRAST_FLOOR) & (stray < STRAY_SHARE)
    allowed = mask[rows, columns] | (_colour_distance(image[rows, columns], growth.colour) <= growth.tolerance)
    mask[rows, columns] = np.where(clear, (share >= 0.5) & allowed, mask[rows, columns])
    return mask, _is_textured(light, fields, core, outside, band)


def _linear(values: NDArray[np.generic], linear_light: bool) -> Floats:
    """Linear light in [0, 1] with three channels, of sRGB values (IEC 61966-2-1) or of linear values."""
    scale = {"uint8": 255.0, "uint16": 65535.0}.get(str(values.dtype), 1.0)
    level = np.asarray(values, dtype=np.float32) / np.float32(scale)
    if not linear_light:
        level = np.where(level <= 0.04045, level / 12.92, ((level + 0.055) / 1.055) ** 2.4).astype(np.float32)
    return np.asarray(level if level.shape[-1:] == (3,) else np.repeat(level[..., None], 3, axis=-1))


def _colour_distance(values: NDArray[np.generic], colour: Floats) -> Floats:
    """Distance (n,) in CIELAB of sRGB values from a colour (3,)."""
    levels = _as_bytes(values)
    colours = np.repeat(levels[:, None], 3, axis=1) if levels.ndim == 1 else levels
    return np.asarray(np.linalg.norm(rgb2lab(colours[None])[0] - colour, axis=1), dtype=np.float32)


def _nearby_mean(light: Floats, chosen: Mask, band: int, *, fallback: Floats) -> tuple[Floats, Mask]:
    """Weighted mean colour (h, w, 3) of the chosen pixels nearby, the fallback elsewhere, and where there are any."""
    reach = 1.5 * band
    weight = ndimage.gaussian_filter(chosen.astype(np.float32), reach)
    sums = ndimage.gaussian_filter(light * chosen[..., None], (reach, reach, 0))
    known = weight > 1e-3
    mean = sums / np.maximum(weight, 1e-3)[..., None]
    return np.where(known[..., None], mean, fallback).astype(np.float32), known


def _enlarged(mask: Mask, factor: int, shape: tuple[int, ...]) -> Mask:
    return mask.repeat(factor, axis=0).repeat(factor, axis=1)[: shape[0], : shape[1]]


def _sampled(fields: Floats, rows: NDArray[np.intp], columns: NDArray[np.intp], factor: int) -> Floats:
    """Fields (h, w, k) of the reduced image at full-size pixels, (n, k)."""
    places = np.stack([(rows + 0.5) / factor - 0.5, (columns + 0.5) / factor - 0.5])
    layers = [ndimage.map_coordinates(fields[..., k], places, order=1, mode="nearest") for k in range(fields.shape[2])]
    return np.stack(layers, axis=1)


def _mixture(light: Floats, inner: Floats, outer: Floats) -> tuple[Floats, Floats]:
    """How colours (n, 3) mix from two: `(I - out) . (in - out) / |in - out|^2`, and the rest over `|in - out|`."""
    step = inner - outer
    square = np.maximum(np.sum(step**2, axis=-1), 1e-12)
    share = np.sum((light - outer) * step, axis=-1) / square
    stray = np.linalg.norm(light - outer - share[..., None] * step, axis=-1) / np.sqrt(square)
    return share, stray


def _is_textured(light: Floats, fields: Floats, core: Mask, outside: Mask, band: int) -> bool:
    """Whether the mixing share of pixels known to lie on one side strays from 0 or 1 near the outline."""
    decided = core | outside
    near = decided & ndimage.maximum_filter(~decided, size=2 * band + 1) & (fields[..., 6] > CONTRAST_FLOOR)
    if not near.any():
        return False
    share, _ = _mixture(light[near], fields[near][:, :3], fields[near][:, 3:6])
    return bool(np.sqrt(np.mean((share - core[near]) ** 2)) > TEXTURE_SPREAD)


def _smoothed(mask: Mask, radius: int) -> Mask:
    """The mask after a median over a square, which takes out texture and spikes and leaves straight outlines."""
    means = ndimage.uniform_filter(mask.astype(np.float32), 2 * radius + 1)
    return np.asarray(means > 0.5)


def _outline_shares(image: NDArray[np.generic], mask: Mask, linear_light: bool) -> Floats:
    """Share (h, w) of each pixel that the region covers, from the mixture of the colours off its outline."""
    core = ndimage.minimum_filter(mask, size=2 * SOFT_PIXELS + 1)
    outside = ndimage.minimum_filter(~mask, size=2 * SOFT_PIXELS + 1)
    rows, columns = np.nonzero(~(core | outside))
    inner, inner_count = _local_mean(image, core, rows, columns, linear_light)
    outer, outer_count = _local_mean(image, outside, rows, columns, linear_light)
    share, stray = _mixture(_linear(image[rows, columns], linear_light), inner, outer)
    contrast = np.linalg.norm(inner - outer, axis=1)
    clear = (inner_count > 0) & (outer_count > 0) & (contrast > CONTRAST_FLOOR) & (stray < STRAY_SHARE)
    shares = mask.astype(np.float32)
    shares[rows, columns] = np.where(clear, np.clip(share, 0.0, 1.0), shares[rows, columns])
    return shares


def _local_mean(
    image: NDArray[np.generic], chosen: Mask, rows: NDArray[np.intp], columns: NDArray[np.intp], linear_light: bool
) -> tuple[Floats, NDArray[np.int64]]:
    """Mean colour (n, 3) of the chosen pixels around each of the pixels given, and how many there are."""
    sums, counts = np.zeros((len(rows), 3), dtype=np.float32), np.zeros(len(rows), dtype=np.int64)
    height, width = chosen.shape
    for down in range(-LOCAL_REACH, LOCAL_REACH + 1):
        for right in range(-LOCAL_REACH, LOCAL_REACH + 1):
            row, column = np.clip(rows + down, 0, height - 1), np.clip(columns + right, 0, width - 1)
            held = np.flatnonzero(chosen[row, column])
            sums[held] += _linear(image[row[held], column[held]], linear_light)
            counts[held] += 1
    means: Floats = (sums / np.maximum(counts, 1)[:, None]).astype(np.float32)
    return means, counts


def _one_piece(mask: Mask, seed: tuple[int, int], fill_holes: bool) -> Mask:
    """The piece of the mask that holds the seed, or the largest, with its holes filled when asked.

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
