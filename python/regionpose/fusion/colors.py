"""Image colors on a point cloud, with the points that the camera doesn't see left out."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import grey_closing, grey_dilation, minimum_filter
from scipy.spatial import cKDTree

from regionpose.cameras import Camera
from regionpose.geometry.pose import Pose
from regionpose.io.clouds import Cloud
from regionpose.validation.arguments import checked_arguments
from regionpose.validation.arrays import checked_image, real_rows

Floats = NDArray[np.float32]
Bytes = NDArray[np.uint8]
Mask = NDArray[np.bool_]

VISIBLE_FIELD = "visible"

BLOCK = 1 << 14
"""Points mapped at a time, so that their temporaries stay in the processor's cache: half the time of blocks of
2^18 (`python -m benchmarks.scale --stages colorize`)."""

DEPTH_TOLERANCE = 0.03
"""Fraction of the distance by which a point may lie behind the surface in front: range noise and the slope within a
cell."""

NEAREST = np.float32(1e-6)
"""Meters; a point in the camera's center would weigh without limit."""

LEAST_COSINE = np.float32(0.01)
"""Weight of a view along a surface, or of a normal that is zero: a point that only such views see is still colored."""

MOST_CELLS = 1_000_000
"""Cells of the depth image at the most; larger images share a cell among several pixels."""

LAYER_RATIO, LAYER_STEP = 1.5, 1.25
"""Far over near distance of a layer, and from layer to layer: a surface lies in one of them where it's up to 1.2 times
as far."""

GAP_SAMPLES, GAP_NEIGHBORS = 400, 64
"""Points of a layer whose gaps are measured, and neighbors looked at: a scan line's spacing and the next scan line."""

GAP_PERCENTILE, GAP_FACTOR = 75.0, 1.5
"""The layer's gap is this percentile of its points' gaps, times a slack for those above it."""

WIDEST_GAP_FRACTION = 1 / 16
"""Gap over the image's diagonal at the most; what is farther apart is no surface."""


class PosedImage(NamedTuple):
    """A camera with its photo and pose.

    Parameters
    ----------
    camera : Camera
        Of the photo.
    image : (h, w) or (h, w, 3) array
        uint8, uint16 or floats in [0, 1].
    pose : Pose
        `camera_from_world`.
    """

    camera: Camera
    image: ArrayLike
    pose: Pose


class SeenPoints(NamedTuple):
    """Pixels (n, 2) and distances (n,) of points, NaN where outside the image, and which of them (n,) no surface in
    front hides.
    """

    pixels: Floats
    distances: Floats
    visible: Mask


@checked_arguments
def colorize(
    camera: Camera, image: ArrayLike, points: ArrayLike, pose: Pose, *, depth_tolerance: float = DEPTH_TOLERANCE
) -> tuple[Bytes, Mask]:
    """Colors of world points in an image, and which points the camera sees.

    Bilinear interpolation; black where a point isn't seen: not finite, outside the image, or behind others. The surface
    that points sample closes the gaps between neighbors at a like distance, however sparse (a morphological closing of
    the depth image, layer by layer). Up to a gap beside its outermost points it still hides what is half as far again.

    Parameters
    ----------
    camera : Camera
        That took the image.
    image : (h, w) or (h, w, 3) array
        uint8, uint16 or floats in [0, 1].
    points : (n, 3) array
        World coordinates.
    pose : Pose
        `camera_from_world`.
    depth_tolerance : float
        Points hide what lies behind the surface they sample by more than this fraction of its distance.

    Returns
    -------
    (n, 3) array of uint8, (n,) array of bool
        Colors, and whether a point is seen.

    Raises
    ------
    ValueError
        For other shapes or types, and for an image of another size than the camera's.
    """
    return blend_colors([PosedImage(camera, image, pose)], points, depth_tolerance=depth_tolerance)


def blend_colors(
    views: Iterable[PosedImage | tuple[Camera, ArrayLike, Pose]],
    points: ArrayLike,
    *,
    normals: ArrayLike | None = None,
    depth_tolerance: float = DEPTH_TOLERANCE,
) -> tuple[Bytes, Mask]:
    """Colors of world points in several images, and which points any of the cameras sees.

    The weighted mean of the images' colors. An image weighs `cos(angle) / distance^2`, its fraction of pixels per area
    up to the focal length; the angle is the one between the ray and the point's normal, and counts as 0 without a
    normal. Visibility as in `colorize`.

    Parameters
    ----------
    views : iterable of tuples
        Camera, image and pose, as of `colorize`; taken one by one, so that they needn't be in memory together.
    points : (n, 3) array
        World coordinates.
    normals : (n, 3) array, optional
        Of the points, of either side.
    depth_tolerance : float
        As of `colorize`.

    Returns
    -------
    (n, 3) array of uint8, (n,) array of bool
        Colors, and whether a point is seen.

    Raises
    ------
    ValueError
        Without a view, for other shapes or types, and for an image of another size than its camera's.
    """
    given = real_rows(points, "points", 3)
    facing = None if normals is None else _checked_normals(normals, len(given))
    tolerance = _checked_tolerance(depth_tolerance)
    if not isinstance(views, Iterable):
        raise ValueError(f"views is a {type(views).__name__}; needed a list of (camera, image, pose)")

    def checked() -> Iterator[SeenColors]:
        count = 0
        for view in views:
            camera, image, pose = _checked_view(view, f"view {count}")
            colors = checked_image(image)
            camera.check_size(colors.shape, f"image of view {count}")
            count += 1
            seen = seen_points(camera, given, pose, colors.shape[:2], depth_tolerance=tolerance)
            indices = np.flatnonzero(seen.visible)
            rays = given[indices] - pose.camera_center
            yield colors, seen, None if facing is None else _cosines(rays, facing[indices])
        if count == 0:
            raise ValueError("there are 0 views; needed a camera, its image and its pose at least")

    return _blended(len(given), checked())


SeenColors = tuple[Bytes, SeenPoints, Floats | None]
"""An image, what its camera sees of some points, and the cosines (k,) by which the visible ones face it, if known."""


def _blended(count: int, views: Iterable[SeenColors]) -> tuple[Bytes, Mask]:
    """The weighted mean colors of so many points, and which of them any view sees, as of `blend_colors`."""
    sums, weights = np.zeros((count, 3), dtype=np.float32), np.zeros(count, dtype=np.float32)
    for colors, seen, cosines in views:
        indices = np.flatnonzero(seen.visible)
        weight = np.maximum(seen.distances[indices], NEAREST) ** np.float32(-2.0)
        if cosines is not None:
            weight *= cosines
        sums[indices] += weight[:, None] * _sampled(colors, seen.pixels[indices])
        weights[indices] += weight
    visible = weights > 0.0
    blended = np.zeros((count, 3), dtype=np.uint8)
    blended[visible] = np.round(sums[visible] / weights[visible, None])
    return blended, visible


@checked_arguments
def colored_cloud(
    views: Iterable[PosedImage | tuple[Camera, ArrayLike, Pose]], cloud: Cloud, *, normals: ArrayLike | None = None
) -> tuple[Cloud, Mask]:
    """The cloud with the colors of images, and which points (n,) any of the cameras sees.

    Points that aren't seen keep their color, or are black; the field `visible` holds 0 and 1.

    Parameters
    ----------
    views : iterable of PosedImage or tuples
        Camera, image and pose of each.
    cloud : Cloud
        In the world of the poses.
    normals : (n, 3) array, optional
        As of `blend_colors`.

    Raises
    ------
    ValueError
        As of `blend_colors`.
    """
    near = ((camera, image, pose.rebase(cloud.origin)) for camera, image, pose in views)
    colors, visible = blend_colors(near, cloud.local_points, normals=normals)
    return _recolored(cloud, colors, visible), visible


def cloud_with_colors(image: ArrayLike, seen: SeenPoints, cloud: Cloud) -> Cloud:
    """As `colored_cloud`, of one image and what its camera sees of the cloud."""
    return _recolored(cloud, *_blended(len(cloud), [(checked_image(image), seen, None)]))


def _recolored(cloud: Cloud, colors: Bytes, visible: Mask) -> Cloud:
    if cloud.colors is not None:
        colors[~visible] = cloud.colors[~visible]
    return replace(cloud, colors=colors, fields={**cloud.fields, VISIBLE_FIELD: visible.astype(np.uint8)})


def seen_points(
    camera: Camera,
    points: ArrayLike,
    pose: Pose,
    size: tuple[int, int],
    *,
    depth_tolerance: float = DEPTH_TOLERANCE,
) -> SeenPoints:
    """What a camera sees of world points (n, 3) in an image of `size` (h, w), as of `colorize`."""
    given = real_rows(points, "points", 3)
    pixels, distances = np.empty((len(given), 2), dtype=np.float32), np.empty(len(given), dtype=np.float32)
    for start in range(0, len(given), BLOCK):
        part = slice(start, start + BLOCK)
        inside = pose.transform(given[part])
        (u, v), (x, y, z) = camera.project(inside).T, inside.T
        within = (u >= -0.5) & (u < size[1] - 0.5) & (v >= -0.5) & (v < size[0] - 0.5)
        with np.errstate(invalid="ignore", over="ignore"):
            ranges = np.sqrt(x * x + y * y + z * z)
        for values, target in ((u, pixels[part, 0]), (v, pixels[part, 1]), (ranges, distances[part])):
            target[:] = np.where(within, values, np.nan)
    return SeenPoints(pixels, distances, _visible(pixels, distances, size, depth_tolerance))


def _checked_view(view: object, item: str) -> PosedImage:
    """The view, if it is an image, a camera and a pose; ValueError for others."""
    if not isinstance(view, tuple) or len(view) != len(PosedImage._fields):
        raise ValueError(f"{item} is a {type(view).__name__}; needed a tuple (camera, image, pose)")
    camera, image, pose = view
    for name, value, kind in (("camera", camera, Camera), ("pose", pose, Pose)):
        if not isinstance(value, kind):
            raise ValueError(f"{name} of {item} is a {type(value).__name__}; needed a {kind.__name__}")
    return PosedImage(camera, image, pose)


def _checked_normals(normals: ArrayLike, count: int) -> Floats:
    given = np.asarray(normals, dtype=np.float32)
    if given.shape != (count, 3):
        raise ValueError(f"normals have shape {given.shape}; needed ({count}, 3), one for each point")
    lengths = np.linalg.norm(given, axis=1, keepdims=True)
    return np.asarray(given / np.where(lengths > 0.0, lengths, 1.0))


def _checked_tolerance(value: float) -> float:
    if not (np.isfinite(value) and value >= 0.0):
        raise ValueError(f"depth_tolerance is {value}; needed a finite fraction of at least 0")
    return value


def _cosines(rays: NDArray[np.floating], normals: Floats) -> Floats:
    """Cosines (n,) between rays (n, 3) and unit normals (n, 3) of either side."""
    lengths = np.maximum(np.linalg.norm(rays, axis=1), NEAREST)
    fractions = np.abs(np.sum(rays * normals, axis=1)) / lengths
    return np.asarray(np.maximum(fractions.astype(np.float32), LEAST_COSINE))


def _visible(pixels: Floats, distances: Floats, size: tuple[int, int], tolerance: float) -> Mask:
    """Which points at pixels (n, 2) and distances (n,) no surface in front of them hides."""
    visible = np.isfinite(distances)
    kept = np.flatnonzero(visible)
    if len(kept) == 0:
        return visible
    side = max(1.0, float(np.sqrt(size[0] * size[1] / MOST_CELLS)))
    shape = int(np.ceil(size[0] / side)), int(np.ceil(size[1] / side))
    columns, rows = np.floor((pixels[kept] + 0.5) / side).astype(np.int32).T
    cells = np.minimum(rows, shape[0] - 1) * np.int32(shape[1]) + np.minimum(columns, shape[1] - 1)
    ranges = np.maximum(distances[kept], np.finfo(np.float32).tiny)
    inverse_distances = np.asarray(1.0 / ranges, dtype=np.float32)
    front = _front_surface(cells, inverse_distances, shape)
    # A cell beside the end of a surface doesn't count as behind it: its own pixels may see past.
    hidden = inverse_distances * (1.0 + tolerance) < minimum_filter(front, size=3).ravel()[cells]
    visible[kept[hidden]] = False
    return visible


def _front_surface(cells: NDArray[np.int32], inverse_distances: Floats, shape: tuple[int, int]) -> Floats:
    """Nearness (1 / distance) of the foremost surface in each cell, 0 where there is none.

    Points at a like distance form a layer; a gray closing as wide as the layer's gaps fills them with the farther of
    their sides. Beside the layer's outermost points the surface ends somewhere within a gap: there it hides only what
    is farther by the ratio of a layer: less may be the next scan line on the same surface.
    """
    front = np.zeros(shape, dtype=np.float32)
    np.maximum.at(front.ravel(), cells, inverse_distances)
    near, far = float(inverse_distances.max()), float(inverse_distances.min())
    while True:
        layer = np.flatnonzero((inverse_distances <= near) & (inverse_distances * LAYER_RATIO > near))
        if len(layer) > 1:
            _add_layer(front, cells[layer], inverse_distances[layer])
        if near <= far * LAYER_STEP:
            return front
        # A step ends at the next point behind it, so that empty ranges cost nothing.
        near = float(inverse_distances[inverse_distances <= near / LAYER_STEP].max(initial=far))


def _add_layer(front: Floats, cells: NDArray[np.int32], inverse_distances: Floats) -> None:
    """Raise the front to the closed surface of one layer's points, and to the margin beside its end."""
    layer = np.zeros_like(front)
    np.maximum.at(layer.ravel(), cells, inverse_distances)
    places = np.column_stack(np.nonzero(layer)).astype(np.float32)
    gap = _gap(places, int(WIDEST_GAP_FRACTION * np.hypot(*front.shape)))
    size, reach = int(np.ceil(GAP_FACTOR * gap)), int(np.ceil(gap)) + 1
    if size <= 1:
        return
    low, high = (places.min(axis=0) - size).astype(int), (places.max(axis=0) + size + 1).astype(int)
    window = slice(max(low[0], 0), high[0]), slice(max(low[1], 0), high[1])
    closed = grey_closing(layer[window], size=(size, size))
    beside = grey_dilation(closed, size=(2 * reach + 1, 2 * reach + 1)) / np.float32(LAYER_RATIO)
    np.maximum(front[window], np.where(closed > 0.0, closed, beside), out=front[window])


def _gap(places: Floats, widest: int) -> float:
    """Cells between neighboring places (n, 2) of a layer: along the wider spaced of its two directions, as scan lines
    have them.

    Each sampled place's nearest neighbors upwards, downwards, left and right are sorted; the third is the wider
    spacing also on a side of the layer, where one direction has none.
    """
    if len(places) < 4:
        return 0.0
    samples = places[:: max(1, len(places) // GAP_SAMPLES)]
    count = min(GAP_NEIGHBORS + 1, len(places))
    # Of a grid's places halves of cells hold about as many as halves of places, and are found without sorting.
    tree = cKDTree(places, balanced_tree=False, compact_nodes=False)
    apart, index = tree.query(samples, k=count, distance_upper_bound=widest)
    steps = np.concatenate([places, [[np.inf, np.inf]]])[index] - samples[:, None]
    with np.errstate(invalid="ignore"):
        sector = np.where(np.abs(steps[..., 0]) > np.abs(steps[..., 1]), 0, 2) + (steps.sum(axis=2) > 0.0)
    apart = np.where(apart > 0.0, apart, np.inf)
    nearest = np.stack([np.where(sector == k, apart, np.inf).min(axis=1) for k in range(4)], axis=1)
    third = np.sort(nearest, axis=1)[:, 2]
    finite = third[np.isfinite(third)]
    return float(np.percentile(finite, GAP_PERCENTILE)) if len(finite) else 0.0


def _sampled(image: Bytes, pixels: Floats) -> Floats:
    """Bilinear colors (n, 3) at pixels (n, 2); beyond the outermost pixel centers, the nearest."""
    height, width = image.shape[:2]
    flat = image.reshape(-1, 3)
    last = np.array([width - 1, height - 1], dtype=np.float32)
    colors = np.empty((len(pixels), 3), dtype=np.float32)
    for start in range(0, len(pixels), BLOCK):
        places = np.clip(pixels[start : start + BLOCK], 0.0, last)
        corner = places.astype(np.intp)
        (left, top), (across, down) = corner.T, (places - corner.astype(np.float32)).T[..., None]
        right, below = np.minimum(left + 1, width - 1), np.minimum(top + 1, height - 1)
        upper, lower = (
            flat.take(row * width + left, axis=0) * (1.0 - across) + flat.take(row * width + right, axis=0) * across
            for row in (top, below)
        )
        colors[start : start + BLOCK] = upper * (1.0 - down) + lower * down
    return colors
