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
from regionpose.validation.arguments import checked_arguments
from regionpose.validation.arrays import Array

Region = TypeVar("Region", ImageRegion, WorldRegion)

SAME_SHARE = 0.9
"""Intersection over union above which two regions are taken for one: a frame of a fortieth of the width around a square
leaves as much, and few things are framed by less."""

SAME_PLANE_SHARE = 0.1
"""Distance of a world region from another's plane, over the root of its area, up to which both may be one: what
`SAME_SHARE` leaves free in the plane, across it."""

LEAK_SHARE = 0.5
"""Share of the photo that a mask covers when it may have leaked: most of it. Of clicks on 37 faces of 25 real photos
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
"""Where in the photo, as a share of each side, the optical axis is looked for. Of a photo made smaller or larger by
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
    image_size: tuple[int, int] | None = None,
) -> tuple[PoseWarning, ...]:
    """Warnings about regions before a pose is estimated: doubles, leaked masks, odd units.

    `coincident-regions`: two image regions, or two world regions, share over 90 % of their union. `leaked-mask`: a mask
    covers most of the photo or reaches three of its sides. `odd-unit`: the world regions are as large as meters hardly
    make them. Each names its regions by their places in the lists, and what to do.

    Parameters
    ----------
    image_regions : sequence of ImageRegion
        One side.
    world_regions : sequence of WorldRegion
        The other.
    image_size : tuple of 2 int, optional
        The photo's width and height, pixels; that of each mask without it.

    Returns
    -------
    tuple of PoseWarning
    """
    return (
        *_coincident("image", image_regions, _image_overlap),
        *_coincident("world", world_regions, _world_overlap),
        *(warning for index, region in enumerate(image_regions) for warning in _leaks(index, region, image_size)),
        *_odd_unit(world_regions),
    )


@checked_arguments
def check_camera(camera: Camera, image_size: tuple[int, int]) -> tuple[PoseWarning, ...]:
    """Warnings where a calibration does not seem to be that of a photo, or to be one at all.

    `odd-center`: the optical axis of a calibration without a size meets the photo outside of the middle third, as that
    of a calibration for photos of another size. `folding-lens`: pixels of the photo have no bearing, or one that the
    model does not distinguish from others, as its distortion folds inside the photo.

    Parameters
    ----------
    camera : Camera
        The camera.
    image_size : tuple of 2 int
        The photo's width and height, pixels.

    Returns
    -------
    tuple of PoseWarning
    """
    return (*_odd_center(camera, image_size), *_folding(camera, image_size))


def _odd_center(camera: Camera, image_size: tuple[int, int]) -> Iterator[PoseWarning]:
    """A warning where a calibration without a size has its axis far from the photo's middle."""
    if camera.width is not None and camera.height is not None:
        return
    center = camera.project([[0.0, 0.0, 1.0]])[0]
    share = (center + 0.5) / image_size
    if (share >= MIDDLE_THIRD[0]).all() and (share <= MIDDLE_THIRD[1]).all():
        return
    text = (
        "the camera's optical axis meets the photo of {width_px} x {height_px} pixels at ({x_px:.0f}, {y_px:.0f}), far"
        " from its middle: the calibration seems to be for photos of about {calibrated_width_px:.0f} x"
        " {calibrated_height_px:.0f}; use a photo of the calibrated size, scale the calibration, or give its width and"
        " height if the photo was cut"
    )
    x, y = center.tolist()
    values = {"width_px": image_size[0], "height_px": image_size[1], "x_px": x, "y_px": y}
    calibrated = {"calibrated_width_px": 2.0 * x + 1.0, "calibrated_height_px": 2.0 * y + 1.0}
    yield PoseWarning("odd-center", text, values={**values, **calibrated})


def _folding(camera: Camera, image_size: tuple[int, int]) -> Iterator[PoseWarning]:
    """A warning where the lens model folds inside the photo."""
    if not isinstance(camera, PinholeCamera) and camera.max_angle > CIRCLE_ANGLE:
        return
    sides = (np.linspace(-0.5, size - 0.5, FOLD_GRID) for size in image_size)
    pixels = np.stack(np.meshgrid(*sides), axis=-1).reshape(-1, 2)
    bearings = camera.bearings(pixels)
    back = np.linalg.norm(camera.project(bearings) - pixels, axis=1)
    angles = np.arctan2(np.hypot(bearings[:, 0], bearings[:, 1]), bearings[:, 2])
    unique = (back <= COMES_BACK_PX) & (angles <= camera.max_angle)
    if unique.all():
        return
    text = (
        "the lens model folds {angle_deg:.3g} deg off the axis, inside the photo: {percent:.3g} % of its pixels see"
        " beyond that, where a direction is not sure or missing; check the coefficients and their order, calibrate with"
        " targets out to the corners, or keep regions away from there"
    )
    values = {"angle_deg": math.degrees(camera.max_angle), "percent": 100.0 * float(np.mean(~unique))}
    yield PoseWarning("folding-lens", text, values=values)


def check_photo_name(camera: Camera, name: str) -> tuple[PoseWarning, ...]:
    """A warning where a photo is called rectified, as ROS' image_rect is, and its camera has distortion.

    `rectified-photo`: rectified photos have none; their camera is not that of the photos as they were taken.
    """
    if not (isinstance(camera, PinholeCamera | FisheyeCamera) and any(camera.distortion) and RECTIFIED.search(name)):
        return ()
    text = (
        "the photo is called {name}, as rectified ones are, but its camera has distortion: where it is rectified, set"
        " rectified (camera: {{file, rectified: true}} in a scene); otherwise rename it"
    )
    return (PoseWarning("rectified-photo", text, values={"name": name}),)


def check_unit(cloud: Cloud) -> tuple[PoseWarning, ...]:
    """`odd-unit` for a cloud whose file states a unit other than the meter, with the factor to use."""
    factor = cloud.unit_m
    if factor is None or abs(factor - 1.0) < SAME_UNIT:
        return ()
    text = (
        "the cloud's file states a unit of {unit_m:.7g} m: multiply its coordinates, and those of the scene, by that,"
        " otherwise all lengths in meters are wrong"
    )
    return (PoseWarning("odd-unit", text, values={"unit_m": factor}),)


def check_intensity(cloud: Cloud) -> tuple[PoseWarning, ...]:
    """What a cloud lost on its way: `no-intensity`, where its file holds one without a single finite number."""
    if "intensity" not in cloud.empty:
        return ()
    text = (
        "the intensity of the cloud's file holds no finite number and is left out: seeds can't keep to it, and photo"
        " and cloud are compared by depth alone; export the cloud with its intensity, if the scanner measures one"
    )
    return (PoseWarning("no-intensity", text),)


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
        share = _overlap_share(regions[first], regions[second], overlap)
        if share > SAME_SHARE:
            text = (
                f"on the {side} side {{0}} and {{1}} are the same, by {100.0 * share:.1f} % of their union: two clicks"
                " grew one surface, or one was marked twice; mark {1} again, or leave it out"
            )
            yield PoseWarning("coincident-regions", text, (first, second), {"side": side, "share": share})


def _overlap_share(first: Region, second: Region, overlap: Callable[[Region, Region], float]) -> float:
    """Intersection over union; 0 without work where the areas alone rule out `SAME_SHARE`."""
    small, large = sorted((first.area, second.area))
    if small <= SAME_SHARE * large:
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
    if height > SAME_PLANE_SHARE * np.sqrt(first.area):
        return 0.0
    return _shared_area([ring[:, :2] for ring in flat], [ring[:, :2] for ring in laid])


def _shared_area(first: Sequence[Array], second: Sequence[Array]) -> float:
    return float(shapely.area(shapely.intersection(_polygon(first), _polygon(second))))


def _polygon(rings: Sequence[Array]) -> shapely.Geometry:
    """What an odd number of the rings (n, 2) surrounds."""
    faces = [shapely.make_valid(shapely.Polygon(ring)) for ring in rings]
    return reduce(shapely.symmetric_difference, faces)


def _leaks(index: int, region: ImageRegion, image_size: tuple[int, int] | None) -> Iterator[PoseWarning]:
    """A warning where a region's mask covers more of the photo than a face does."""
    if region.mask is None:
        return
    width, height = region.mask.shape[::-1] if image_size is None else image_size
    (rows, columns), (left, top) = region.mask.size, region.mask.offset
    sides = sum((left == 0, top == 0, left + columns == width, top + rows == height))
    share = region.area / (width * height)
    if share <= LEAK_SHARE and sides < LEAK_SIDES:
        return
    reached = f" and reaches {sides} of its sides" if sides else ""
    cure = "lower its tolerance, click elsewhere, or draw it as a polygon, unless the surface is that large"
    text = f"the mask of {{0}} covers {100.0 * share:.0f} % of the photo{reached}: it seems to have leaked; {cure}"
    yield PoseWarning("leaked-mask", text, (index,), {"share": share, "sides": sides})


def _odd_unit(regions: Sequence[WorldRegion]) -> Iterator[PoseWarning]:
    """A warning where the largest world region is larger than a face is in meters."""
    if not regions:
        return
    index = int(np.argmax([region.area for region in regions]))
    size = float(np.sqrt(regions[index].area))
    if size > LARGEST_REGION_M:
        text = (
            "the world side of {0} would be {size_m:.0f} m across (the root of its area): the coordinates look like"
            " millimeters, of which it would be {in_millimeters_m:.2g} m; multiply those of the cloud and of the scene"
            " by {unit_m:g}, otherwise all lengths in meters are wrong"
        )
        values = {"size_m": size, "in_millimeters_m": MILLIMETER * size, "unit_m": MILLIMETER}
        yield PoseWarning("odd-unit", text, (index,), values)
