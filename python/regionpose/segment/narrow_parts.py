"""Patches without their narrow parts: a tailgate without the posts that stand on it in the same plane."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely.geometry.base import BaseGeometry

from regionpose.regions.outline import outline_of_points

ARC_SEGMENTS = 16
"""Segments of a quarter turn where the opening rounds a corner: they lie within 0.3 % of the radius of its arc."""

RIM_FRACTION = 0.15
"""Margin over the width within which points beside the opened outline stay: the corners that a disc doesn't reach are
`(sqrt(2) - 1) / 2 = 0.21` widths away for a right angle, noise and rounding take the rest."""


def without_narrow_parts(points: ArrayLike, seed: ArrayLike, min_width_m: float) -> NDArray[np.bool_]:
    """Which of the points (n, 3) on a plane belong to the part around `seed` (3,) that is `min_width_m` wide.

    The outline of the points is opened: what no disc of that diameter reaches from within is cut off, and of the
    pieces left the one nearest to the seed stays. ValueError for a width that isn't positive, for points without an
    outline, and when no part is as wide.
    """
    if not (np.isfinite(min_width_m) and min_width_m > 0.0):
        raise ValueError(f"min_width_m is {min_width_m}; needed a positive number of meters")
    given = np.asarray(points, dtype=np.float64)
    outline = outline_of_points(given, correct_sampling=False)
    flat, place = ((np.asarray(p, dtype=np.float64) - outline.origin) @ outline.axes.T for p in (given, seed))
    opened = _opened(shapely.Polygon(outline.rings[0], outline.rings[1:]), 0.5 * min_width_m)
    pieces = [piece for piece in shapely.get_parts(opened) if piece.area > 0.0]
    if not pieces:
        raise ValueError(f"no part of the patch of {len(given)} points is {min_width_m} m wide; needed a smaller width")
    nearest = min(pieces, key=shapely.Point(place).distance)
    kept: NDArray[np.bool_] = shapely.contains_xy(nearest.buffer(RIM_FRACTION * min_width_m), flat[:, 0], flat[:, 1])
    return kept


def _opened(shape: BaseGeometry, radius: float) -> BaseGeometry:
    return shape.buffer(-radius, quad_segs=ARC_SEGMENTS).buffer(radius, quad_segs=ARC_SEGMENTS)
