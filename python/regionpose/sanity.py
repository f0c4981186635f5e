"""What speaks against regions and cameras before any pose is looked for: doubles, leaks, odd sizes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import reduce
from itertools import combinations
from typing import TypeVar

import numpy as np
import shapely
from numpy.typing import NDArray

from regionpose.cameras import Camera
from regionpose.clouds import Cloud
from regionpose.image_region import ImageRegion
from regionpose.solver import PoseWarning
from regionpose.world_region import WorldRegion

Array = NDArray[np.float64]
Region = TypeVar("Region", ImageRegion, WorldRegion)

SAME_SHARE = 0.9
"""Intersection over union above which two regions are taken for one: a frame of a fortieth of the width around a square
leaves as much, and few things are framed by less."""

SAME_PLANE_SHARE = 0.1
"""Distance of a world region from another's plane, over the root of its area, up to which both may be one: what
`SAME_SHARE` leaves free in the plane, across it."""

LEAK_SHARE = 0.5
"""Share of the photo that a mask covers when it may have leaked: most of it."""

LEAK_SIDES = 3
"""Sides of the photo that a leaked mask reaches; a convention. A surface that goes on beyond three sides shows little
of its own outline anyway."""

LARGEST_REGION_M = 200.0
"""Root of the area of the largest planar region, metres. Between the largest faces that stand in a photo and the
smallest: a football ground has 85 m, an aircraft hangar's front 190 m; in millimetres this is a plate of 20 cm."""

WIDEST_SPACING = 1.0
"""Median distance of neighbouring points, in the cloud's unit, from which it hardly is the metre: terrestrial scans of
1 km have 0.05 to 0.5 m, airborne ones 0.1 to 0.7 m; scans in millimetres have 1 to 50."""

LEAST_EXTENT = 1000.0
"""Diagonal of a cloud, in its unit, below which such a spacing means few points; in millimetres this is 1 m."""

MIDDLE_THIRD = (1.0 / 3.0, 2.0 / 3.0)
"""Where in the photo, as a share of each side, the optical axis is looked for. Of a photo made smaller or larger by
half and more than the calibrated one it is elsewhere; cameras have it within a twentieth of the middle."""

MILLIMETRE = 0.001

SAME_UNIT = 1e-6
"""Relative difference of two units that are one: the US survey foot and the international one differ by 2e-6."""


def check_regions(
    image_regions: Sequence[ImageRegion],
    world_regions: Sequence[WorldRegion],
    image_size: tuple[int, int] | None = None,
) -> tuple[PoseWarning, ...]:
    """What speaks against the two sides of each pair of regions, before a pose is looked for.

    `coincident-regions`: two image regions, or two world regions, share over 90 % of their union. `leaked-mask`: a mask
    covers most of the photo or reaches three of its sides; `image_size` is the photo's (width, height), that of each
    mask without it. `odd-unit`: the world regions are as large as metres hardly make them. Each names its regions by
    their places in the lists, and what to do.
    """
    return (
        *_coincident("image", image_regions, _image_overlap),
        *_coincident("world", world_regions, _world_overlap),
        *(warning for index, region in enumerate(image_regions) for warning in _leaks(index, region, image_size)),
        *_odd_unit(world_regions),
    )


def check_camera(camera: Camera, image_size: tuple[int, int]) -> tuple[PoseWarning, ...]:
    """What speaks against a camera without a size having taken a photo of `image_size` (width, height).

    `odd-centre`: its optical axis meets the photo outside of the middle third, as that of a calibration for photos of
    another size.
    """
    if camera.width is not None and camera.height is not None:
        return ()
    centre = camera.project([[0.0, 0.0, 1.0]])[0]
    share = (centre + 0.5) / image_size
    if (share >= MIDDLE_THIRD[0]).all() and (share <= MIDDLE_THIRD[1]).all():
        return ()
    message = (
        f"the camera's optical axis meets the photo of {image_size[0]} x {image_size[1]} pixels at ({centre[0]:.0f},"
        f" {centre[1]:.0f}), far from its middle: the calibration seems to be for photos of about"
        f" {2.0 * centre[0] + 1.0:.0f} x {2.0 * centre[1] + 1.0:.0f}; use a photo of the calibrated size, scale the"
        f" calibration, or give its width and height if the photo was cut"
    )
    return (PoseWarning("odd-centre", message),)


def check_unit(cloud: Cloud) -> tuple[PoseWarning, ...]:
    """What the file of a cloud says against its coordinates being metres: `odd-unit`, with the factor to use."""
    factor = cloud.metres_per_unit
    if factor is None or abs(factor - 1.0) < SAME_UNIT:
        return ()
    message = (
        f"the cloud's file states a unit of {factor:.7g} m: multiply its coordinates, and those of the scene, by that,"
        " else what is said in metres is wrong"
    )
    return (PoseWarning("odd-unit", message),)


def unit_remark(spacing: float, extent: float) -> str | None:
    """What a cloud's size says of its unit: None where it may well be the metre, else the factor to use.

    `spacing`: median distance of neighbouring points; `extent`: diagonal of the cloud; both in its unit. A foot is too
    like a metre to be told so: `check_unit` reads it.
    """
    if spacing <= WIDEST_SPACING or extent <= LEAST_EXTENT:
        return None
    return (
        f"points {spacing:.3g} apart over {extent:.4g} look like millimetres: multiply the coordinates by"
        f" {MILLIMETRE:g} for metres"
    )


def _coincident(
    side: str, regions: Sequence[Region], overlap: Callable[[Region, Region], float]
) -> Iterator[PoseWarning]:
    """A warning for each two regions that are one."""
    for first, second in combinations(range(len(regions)), 2):
        share = _overlap_share(regions[first], regions[second], overlap)
        if share > SAME_SHARE:
            message = (
                f"on the {side} side region {first} and region {second} are the same, by {100.0 * share:.1f} % of"
                f" their union: two clicks grew one surface, or one was marked twice; mark region {second} anew, or"
                " leave it out"
            )
            yield PoseWarning("coincident-regions", message)


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
    (rows, columns), (left, top) = region.mask.coverage.shape, region.mask.offset
    sides = sum((left == 0, top == 0, left + columns == width, top + rows == height))
    share = region.area / (width * height)
    if share <= LEAK_SHARE and sides < LEAK_SIDES:
        return
    found = f"covers {100.0 * share:.0f} % of the photo" + (f" and reaches {sides} of its sides" if sides else "")
    cure = "lower its tolerance, click elsewhere, or draw it as a polygon, unless the surface is that large"
    yield PoseWarning("leaked-mask", f"the mask of region {index} {found}: it seems to have leaked; {cure}")


def _odd_unit(regions: Sequence[WorldRegion]) -> Iterator[PoseWarning]:
    """A warning where the largest world region is larger than a face is in metres."""
    if not regions:
        return
    index = int(np.argmax([region.area for region in regions]))
    size = float(np.sqrt(regions[index].area))
    if size > LARGEST_REGION_M:
        message = (
            f"the world side of region {index} would be {size:.0f} m across (the root of its area): the coordinates"
            f" look like millimetres, of which it would be {MILLIMETRE * size:.2g} m; multiply those of the cloud and"
            f" of the scene by {MILLIMETRE:g}, else what is said in metres is wrong"
        )
        yield PoseWarning("odd-unit", message)
