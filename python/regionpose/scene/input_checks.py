"""Checks of regions and cameras before the pose search: duplicates, leaked masks, odd units and sizes."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence
from functools import reduce
from itertools import combinations
from typing import TypeVar

import numpy as np
import shapely

from regionpose.cameras import Camera, FisheyeCamera, PinholeCamera
from regionpose.io.clouds import Cloud
from regionpose.regions.image import ImageRegion
from regionpose.regions.world import WorldRegion
from regionpose.solve.warning import PoseWarning
from regionpose.solve.warning_code import WarningCode
from regionpose.validation.arguments import checked_arguments
from regionpose.validation.arrays import Array

Region = TypeVar("Region", ImageRegion, WorldRegion)

SAME_FRACTION = 0.9
"""Intersection over union above which two regions are taken for one: a frame of a fortieth of the width around a square
leaves as much, and few things are framed by less."""

SAME_PLANE_FRACTION = 0.1
"""Distance of a world region from another's plane, over the root of its area, up to which both may be one: what
`SAME_FRACTION` leaves free in the plane, across it."""

LEAK_FRACTION = 0.5
"""Fraction of the photo that a mask covers when it may have leaked: most of it. Of clicks on 37 faces of 25 real photos
five masks get the warning, with the sides below; all have leaked, to an overlap of less than a tenth with the face."""

LEAK_SIDES = 3
"""Sides of the photo that a leaked mask reaches; a convention. A surface that goes on beyond three sides shows little
of its own outline anyway."""

LARGEST_REGION_M = 200.0
"""Root of the area of the largest planar region, meters. Between the largest faces that stand in a photo and the
smallest: a football ground has 85 m, an aircraft hangar's front 190 m; in millimeters this is a plate of 20 cm."""

WIDEST_SPACING = 1.0
"""Median distance of neighboring points, in the cloud's unit, from which it hardly is the meter: terrestrial scans of
1 km have 0.05 to 0.5 m, airborne ones 0.1 to 0.7 m; scans in millimeters have 1 to 50."""

LEAST_EXTENT = 1000.0
"""Diagonal of a cloud, in its unit, below which such a spacing means few points; in millimeters this is 1 m."""

MIDDLE_THIRD = (1.0 / 3.0, 2.0 / 3.0)
"""Where in the photo, as a fraction of each side, the optical axis is looked for. Of a photo made smaller or larger by
half and more than the calibrated one it is elsewhere; cameras have it within a twentieth of the middle."""

CIRCLE_ANGLE = math.radians(60.0)
"""Angle off the axis beyond which the picture of a fisheye or omnidirectional lens may end as a circle in the photo:
those that are made so see 140 degrees across or more. A convention."""

FOLD_GRID = 65
"""Pixels along each side of the photo at which a lens is tried: a fold is a circle, and the corners are among them."""

COMES_BACK_PX = 1e-3
"""Largest distance of a pixel from the projection of its bearing: far above rounding, far below any contour's noise."""

RECTIFIED = re.compile(r"(?<![a-z])rect(ified)?(?![a-z])", re.IGNORECASE)
"""What ROS calls rectified photos (image_rect, image_rect_color), and what people do; not `direct` or `rectangle`."""

MILLIMETER = 0.001

SAME_UNIT = 1e-6
"""Relative difference of two units that are one: the US survey foot and the international one differ by 2e-6."""


@checked_arguments
def check_regions(
    image_regions: Sequence[ImageRegion],
    world_regions: Sequence[WorldRegion],
    image_shape: tuple[int, int] | None = None,
) -> tuple[PoseWarning, ...]:
    """Warnings about regions before a pose is estimated: doubles, leaked masks, odd units.

    `duplicate-regions`: two image regions, or two world regions, share over 90 % of their union. `leaked-mask`: a mask
    covers most of the photo or reaches three of its sides. `suspicious-unit`: the world regions are as large as meters
    hardly make them.

    Parameters
    ----------
    image_regions : sequence of ImageRegion
        One side.
    world_regions : sequence of WorldRegion
        The other.
    image_shape : tuple of 2 int, optional
        The photo's height and width, pixels; that of each mask without it.

    Returns
    -------
    tuple of PoseWarning
    """
    return (
        *_coincident("image", image_regions, _image_overlap),
        *_coincident("world", world_regions, _world_overlap),
        *(warning for index, region in enumerate(image_regions) for warning in _leaks(index, region, image_shape)),
        *_odd_unit(world_regions),
    )


@checked_arguments
def check_camera(camera: Camera, image_shape: tuple[int, int]) -> tuple[PoseWarning, ...]:
    """Warnings where a calibration does not seem to be that of a photo, or to be one at all.

    `off-center-principal-point`: the optical axis of a calibration without a size meets the photo outside of the middle
    third, as that of a calibration for photos of another size. `non-invertible-distortion`: pixels of the photo have no
    bearing, or an ambiguous one, as its distortion folds inside the photo.

    Parameters
    ----------
    camera : Camera
        The camera.
    image_shape : tuple of 2 int
        The photo's height and width, pixels.

    Returns
    -------
    tuple of PoseWarning
    """
    return (*_odd_center(camera, image_shape), *_folding(camera, image_shape))


def _odd_center(camera: Camera, image_shape: tuple[int, int]) -> Iterator[PoseWarning]:
    """A warning where a calibration without a size has its axis far from the photo's middle."""
    if camera.width is not None and camera.height is not None:
        return
    center = camera.project([[0.0, 0.0, 1.0]])[0]
    height, width = image_shape
    fraction = (center + 0.5) / np.array([width, height])
    if (fraction >= MIDDLE_THIRD[0]).all() and (fraction <= MIDDLE_THIRD[1]).all():
        return
    x, y = center.tolist()
    values = {"width_px": width, "height_px": height, "x_px": x, "y_px": y}
    calibrated = {"calibrated_width_px": 2.0 * x + 1.0, "calibrated_height_px": 2.0 * y + 1.0}
    yield PoseWarning(WarningCode.OFF_CENTER_PRINCIPAL_POINT, values={**values, **calibrated})


def _folding(camera: Camera, image_shape: tuple[int, int]) -> Iterator[PoseWarning]:
    """A warning where the lens model folds inside the photo."""
    if not isinstance(camera, PinholeCamera) and camera.max_angle > CIRCLE_ANGLE:
        return
    sides = (np.linspace(-0.5, size - 0.5, FOLD_GRID) for size in image_shape[::-1])
    pixels = np.stack(np.meshgrid(*sides), axis=-1).reshape(-1, 2)
    bearings = camera.bearings(pixels)
    back = np.linalg.norm(camera.project(bearings) - pixels, axis=1)
    angles = np.arctan2(np.hypot(bearings[:, 0], bearings[:, 1]), bearings[:, 2])
    unique = (back <= COMES_BACK_PX) & (angles <= camera.max_angle)
    if unique.all():
        return
    values = {"angle_deg": math.degrees(camera.max_angle), "pixel_fraction": float(np.mean(~unique))}
    yield PoseWarning(WarningCode.NON_INVERTIBLE_DISTORTION, values=values)


def check_photo_name(camera: Camera, name: str) -> tuple[PoseWarning, ...]:
    """A warning where a photo is called rectified, as ROS' image_rect is, and its camera has distortion.

    `rectified-photo`: rectified photos have none; their camera is not that of the photos as they were taken.
    """
    if not (isinstance(camera, PinholeCamera | FisheyeCamera) and any(camera.distortion) and RECTIFIED.search(name)):
        return ()
    return (PoseWarning(WarningCode.RECTIFIED_PHOTO, values={"name": name}),)


def check_unit(cloud: Cloud) -> tuple[PoseWarning, ...]:
    """`suspicious-unit` for a cloud whose file states a unit other than the meter, with the factor to use."""
    factor = cloud.unit_m
    if factor is None or abs(factor - 1.0) < SAME_UNIT:
        return ()
    return (PoseWarning(WarningCode.SUSPICIOUS_UNIT, values={"unit_m": factor}),)


def check_intensity(cloud: Cloud) -> tuple[PoseWarning, ...]:
    """What a cloud lost on its way: `no-intensity`, where its file holds one without a single finite number."""
    if "intensity" not in cloud.empty:
        return ()
    return (PoseWarning(WarningCode.NO_INTENSITY),)


def unit_remark(spacing: float, extent: float) -> str | None:
    """The factor to meters that a cloud's size suggests; None where its unit may well be the meter.

    `spacing`: median distance of neighboring points; `extent`: diagonal of the cloud; both in its unit. A foot is too
    like a meter for a warning: `check_unit` reads it.
    """
    if spacing <= WIDEST_SPACING or extent <= LEAST_EXTENT:
        return None
    return (
        f"points {spacing:.3g} apart over {extent:.4g} look like millimeters: multiply the coordinates by"
        f" {MILLIMETER:g} for meters"
    )


def _coincident(
    side: str, regions: Sequence[Region], overlap: Callable[[Region, Region], float]
) -> Iterator[PoseWarning]:
    """A warning for each two regions that are one."""
    for first, second in combinations(range(len(regions)), 2):
        fraction = _overlap_fraction(regions[first], regions[second], overlap)
        if fraction > SAME_FRACTION:
            yield PoseWarning(WarningCode.DUPLICATE_REGIONS, (first, second), {"side": side, "fraction": fraction})


def _overlap_fraction(first: Region, second: Region, overlap: Callable[[Region, Region], float]) -> float:
    """Intersection over union; 0 without work where the areas alone rule out `SAME_FRACTION`."""
    small, large = sorted((first.area, second.area))
    if small <= SAME_FRACTION * large:
        return 0.0
    shared = overlap(first, second)
    return shared / (small + large - shared)


def _image_overlap(first: ImageRegion, second: ImageRegion) -> float:
    return _shared_area(first.rings, second.rings)


def _world_overlap(first: WorldRegion, second: WorldRegion) -> float:
    """The area that a region shares with another laid on its plane; 0 where that lies elsewhere."""
    origin, axes = first.core.origin, first.core.axes
    flat, laid = ([(ring - origin) @ axes.T for ring in region.rings] for region in (first, second))
    height = max(float(np.abs(ring[:, 2]).max()) for ring in laid)
    if height > SAME_PLANE_FRACTION * np.sqrt(first.area):
        return 0.0
    return _shared_area([ring[:, :2] for ring in flat], [ring[:, :2] for ring in laid])


def _shared_area(first: Sequence[Array], second: Sequence[Array]) -> float:
    return float(shapely.area(shapely.intersection(_polygon(first), _polygon(second))))


def _polygon(rings: Sequence[Array]) -> shapely.Geometry:
    """What an odd number of the rings (n, 2) surrounds."""
    faces = [shapely.make_valid(shapely.Polygon(ring)) for ring in rings]
    return reduce(shapely.symmetric_difference, faces)


def _leaks(index: int, region: ImageRegion, image_shape: tuple[int, int] | None) -> Iterator[PoseWarning]:
    """A warning where a region's mask covers more of the photo than a face does."""
    if region.mask is None:
        return
    height, width = region.mask.shape if image_shape is None else image_shape
    (rows, columns), (left, top) = region.mask.size, region.mask.offset
    sides = sum((left == 0, top == 0, left + columns == width, top + rows == height))
    fraction = region.area / (width * height)
    if fraction <= LEAK_FRACTION and sides < LEAK_SIDES:
        return
    yield PoseWarning(WarningCode.LEAKED_MASK, (index,), {"fraction": fraction, "sides": sides})


def _odd_unit(regions: Sequence[WorldRegion]) -> Iterator[PoseWarning]:
    """A warning where the largest world region is larger than a face is in meters."""
    if not regions:
        return
    index = int(np.argmax([region.area for region in regions]))
    size = float(np.sqrt(regions[index].area))
    if size > LARGEST_REGION_M:
        values = {"size_m": size, "scaled_size_m": MILLIMETER * size, "unit_m": MILLIMETER}
        yield PoseWarning(WarningCode.SUSPICIOUS_UNIT, (index,), values)
