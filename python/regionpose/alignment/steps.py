"""Steps of a cloud as a photo shows them: where near surfaces end before far ones, and where their shade changes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from regionpose import _core
from regionpose.alignment.photo import DIRECTIONS, Photo
from regionpose.arrays import check_coordinates, real_array, row_array
from regionpose.cameras import Camera
from regionpose.pose import Pose
from regionpose.regions.image import ImageRegion

Array = NDArray[np.float64]
Known = Callable[[Array], NDArray[np.bool_]]
"""Which of pixels (n, 2) of the original photo tell nothing that the regions haven't."""

BLOCK_ROWS = 1 << 14
"""Points that are looked at together: half a megabyte."""

STEP_SHARE = 0.1
"""A step goes beyond the near surface's plane by this share of the inverse distance: several times range noise."""

CELL_PX = 2.0
"""Pixels within which the nearest point hides others: less than what edges are looked for within."""

WIDEST_GAP_DEG = 0.7
"""Neighbors farther apart leave open where between them a surface ends: two lines of 64 beams are 0.4 apart."""

GAP_SPACINGS = 4.0
"""Gap over the mean spacing of points: neighbors on all sides, where lines are five times as far apart as samples."""

MOST_STEPS = 2000
"""Steps that are looked at, drawn evenly: of more the mean is no surer, since neighbors show the same edges."""

TURNS = np.cross(np.eye(3)[:, None], np.eye(3))
"""Matrices (3, 3, 3) that take rows to the ways that turns about x, y, z move them, a radian."""

DIFFERENCE = 1e-4
"""Rotation, rad, over which derivatives of pixels are taken: their error is far below a pixel."""

BESIDE_PX = 10.0
"""Steps within so many pixels of an observed region tell what the region has told already."""

TURNED_DEG, TURNED_COUNT = (3.0, 8.0), 40
"""How far turned poses are turned that a pose is compared with, and how many: beyond what a pose may be off, to like
parts of the photo; enough for a deviation known to a tenth."""

SEED = 1


class Steps(NamedTuple):
    """Bearings (n, 3) in the camera's axes: of the near side of steps, and of the far side; distances (n,) of the near
    side, meters.
    """

    near: Array
    far: Array
    distances: Array

    def turned(self, rotation: Rotation) -> Steps:
        """The same for a camera turned by a rotation of its axes."""
        return Steps(rotation.apply(self.near), rotation.apply(self.far), self.distances)


class SeenSteps(NamedTuple):
    """Places (n, 2) of steps in a photo, how turns about x, y, z move their x and y (n, 6), directions (n,) across
    them, and their numbers (n,) among the steps.
    """

    places: Array
    moved: Array
    directions: NDArray[np.int64]
    numbers: NDArray[np.intp]


@cache
def far_turns() -> Array:
    """Rotation vectors (t, 3), rad, to the poses that a pose is compared with."""
    rng = np.random.default_rng(SEED)
    axes = rng.normal(size=(TURNED_COUNT, 3))
    angles = np.radians(rng.uniform(*TURNED_DEG, TURNED_COUNT))
    return np.asarray(axes / np.linalg.norm(axes, axis=1, keepdims=True) * angles[:, None])


def checked_points(points: ArrayLike) -> Array:
    """Points (n, 3); ValueError for another shape, or one that is too far away to be calculated with."""
    places = row_array(points, "points", 3)
    check_coordinates(places)
    return places


def checked_intensity(intensity: ArrayLike | None, points: Array) -> Array | None:
    """One value (n,) a point, if there are any; ValueError for another shape."""
    if intensity is None:
        return None
    values = real_array(intensity, "intensity", "(n,)").astype(np.float64)
    if values.shape != points.shape[:1]:
        raise ValueError(f"intensity has shape {values.shape}; needed ({len(points)},), one value a point")
    return values


def steps_at(pose: Pose, points: ArrayLike, camera: Camera, photo: Photo, intensity: ArrayLike | None) -> Steps:
    """The steps of points (n, 3) of the world that the photo shows at a pose, or would, from the turned poses; of their
    intensity (n,), too, if there is one. ValueError for other shapes.
    """
    places = checked_points(points)
    values = checked_intensity(intensity, places)
    rotation = pose.rotation.as_matrix()
    margin = float(np.radians(TURNED_DEG[1]))
    reach = float(np.cos(min(half_field(camera, photo) + margin, np.pi)))
    shown, local = _within(places, pose.camera_center, rotation[2], reach)
    seen = local @ rotation.T
    cell, gap = cell_and_gap(camera, photo, len(seen), 2.0 * np.pi * (1.0 - reach))
    shades = None if values is None else values[shown]
    return Steps(*_core.scene_steps(seen, cell, gap, STEP_SHARE, shades))


def cell_and_gap(camera: Camera, photo: Photo, count: int, solid_angle: float) -> tuple[float, float]:
    """Angles within which the nearest point hides others, and beyond which neighbors are none, rad, of so many points
    in a solid angle.
    """
    spacing = float(np.sqrt(solid_angle / max(count, 1)))
    cell = CELL_PX * pixel_angle(camera, photo)
    return cell, max(2.0 * cell, min(float(np.radians(WIDEST_GAP_DEG)), GAP_SPACINGS * spacing))


def _within(points: Array, center: Array, axis: Array, cosine: float) -> tuple[NDArray[np.bool_], Array]:
    """Which of points (n, 3) lie about an axis through a center, by the least cosine of the angle to it; these (m, 3),
    from the center.
    """
    shown, parts = np.empty(len(points), dtype=np.bool_), [np.empty((0, 3))]
    for start in range(0, len(points), BLOCK_ROWS):
        # Block by block, since what is kept between the steps of this then stays in the processor's cache.
        local = points[start : start + BLOCK_ROWS] - center
        with np.errstate(invalid="ignore"):
            within = local @ axis > cosine * np.sqrt(np.einsum("ij,ij->i", local, local))
        shown[start : start + BLOCK_ROWS] = within
        parts.append(local[within])
    return shown, np.concatenate(parts)


def seen_steps(photo: Photo, camera: Camera, steps: Steps, known: Known | None = None) -> SeenSteps:
    """The steps that the photo shows half-way between their sides, as many as are looked at, without known ones."""
    near, far = (photo.places(camera.project(side)) for side in steps[:2])
    middle = 0.5 * (near + far)
    last = np.array(photo.luminance.shape[::-1]) - 0.5
    # NaN, out of view, is in no range.
    shown = np.flatnonzero(((middle >= -0.5) & (middle < last)).all(axis=1))
    if known is not None:
        shown = shown[~known(photo.pixels(middle[shown]))]
    chosen = _evenly(shown)
    across = (far - near)[chosen]
    directions = np.round(np.arctan2(across[:, 1], across[:, 0]) / np.pi * DIRECTIONS).astype(np.int64) % DIRECTIONS
    bearings = 0.5 * (steps.near[chosen] + steps.far[chosen])
    _, moved = places_moved(photo, camera, bearings, bearings @ TURNS)
    return SeenSteps(middle[chosen], moved, directions, chosen)


def _evenly(numbers: NDArray[np.intp]) -> NDArray[np.intp]:
    """As many of the numbers as are looked at."""
    if len(numbers) <= MOST_STEPS:
        return numbers
    return np.random.default_rng(SEED).choice(numbers, MOST_STEPS, replace=False)


def places_moved(photo: Photo, camera: Camera, points: Array, ways: Array) -> tuple[Array, Array]:
    """Places (n, 2) of points (n, 3) in the camera's axes, and the derivatives (n, 2 k) of x, then y, by moves along
    ways (k, n, 3); 0 where unknown.
    """
    pixels = camera.project(np.concatenate([points, *(points + DIFFERENCE * ways)])).reshape(1 + len(ways), -1, 2)
    moved = ((pixels[1:] - pixels[0]) / (DIFFERENCE * photo.reduction)).transpose(1, 2, 0)
    return photo.places(pixels[0]), np.nan_to_num(moved.reshape(len(points), 2 * len(ways)), copy=False)


def beside(regions: Sequence[ImageRegion]) -> Known | None:
    """Which pixels lie in or beside the regions; None without any."""
    if not regions:
        return None
    shapes = [shapely.Polygon(ring).buffer(BESIDE_PX) for region in regions for ring in region.rings]
    near = shapely.union_all(shapes)
    shapely.prepare(near)
    return lambda pixels: np.asarray(shapely.contains_xy(near, pixels[:, 0], pixels[:, 1]))


def pixel_angle(camera: Camera, photo: Photo) -> float:
    """The angle of a pixel of the photo in its middle, rad; ValueError where the camera sees no ray there."""
    x, y = photo.pixels(0.5 * np.array(photo.luminance.shape[::-1]))
    ends = camera.bearings([[x, y], [x + photo.reduction, y]])
    if not np.isfinite(ends).all():
        height, width = photo.shape
        found = f"no ray at the middle of {width} x {height} pixels, ({x:g}, {y:g})"
        raise ValueError(f"camera: found {found}; needed the camera that took the photo")
    return float(np.linalg.norm(ends[1] - ends[0]))


def half_field(camera: Camera, photo: Photo) -> float:
    """The largest angle between the optical axis and what the photo shows, rad."""
    height, width = (photo.reduction * size for size in photo.luminance.shape)
    x, y = np.linspace(-0.5, width - 0.5, 17), np.linspace(-0.5, height - 0.5, 17)
    sides = [np.column_stack([x, np.full(17, end)]) for end in (-0.5, height - 0.5)]
    sides += [np.column_stack([np.full(17, end), y]) for end in (-0.5, width - 0.5)]
    cosines = camera.bearings(np.concatenate(sides))[:, 2]
    # A fisheye's photo may show more than the lens does: there are no bearings at its corners.
    return camera.max_angle if np.isnan(cosines).any() else float(np.arccos(np.clip(cosines.min(), -1.0, 1.0)))
