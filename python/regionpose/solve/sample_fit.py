"""How the samples of a region fit its observed contour at a pose."""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from regionpose.cameras import Camera
from regionpose.geometry.pose import Pose
from regionpose.regions.image import ImageRegion
from regionpose.regions.world import WorldRegion
from regionpose.validation.arrays import signed_area

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SampleFit:
    """Samples that a pose shows on the wrong side of the contour, pixels, and how many there are at all.

    `beyond` (n, 2): inside the region, projected beyond its contour; `within` (m, 2): outside the region, projected
    within. `count`: of the samples that are nearest to an edge of the region's own; the others are uninformative.
    """

    beyond: Array
    within: Array
    count: int

    @property
    def consistent_fraction(self) -> float:
        """Fraction of the informative samples that lie on their side; NaN without any."""
        return 1.0 - (len(self.beyond) + len(self.within)) / self.count if self.count else float("nan")


def sample_fit(camera: Camera, image: ImageRegion, world: WorldRegion, pose: Pose) -> SampleFit | None:
    """On which sides of its contour a region's samples project at a pose; None for a region that has none.

    Samples in a window of a region whose contour has no hole count for nothing, nor those nearest to the image's border
    or to a hidden edge.
    """
    known = world.core.samples
    if known is None:
        return None
    column = float(np.mean([ring[:, 0].mean() for ring in image.rings]))
    inside, outside, enclosed = (camera.project_near(pose.transform(places), column) for places in known)
    if any(signed_area(ring) < 0.0 for ring in image.rings):
        outside = np.concatenate([outside, enclosed])
    region: BaseGeometry = shapely.Polygon()
    for ring in image.rings:
        region = shapely.symmetric_difference(region, shapely.Polygon(ring))
    edges = np.concatenate([np.stack([ring, np.roll(ring, -1, axis=0)], axis=1) for ring in image.rings])
    nearest = shapely.STRtree(cast(NDArray[np.object_], shapely.linestrings(edges)))
    foreign = np.concatenate(image.excluded_edges(camera))
    places = [_informative(pixels, nearest, foreign) for pixels in (inside, outside)]
    is_within = [shapely.contains_xy(region, pixels[:, 0], pixels[:, 1]) for pixels in places]
    return SampleFit(places[0][~is_within[0]], places[1][is_within[1]], sum(map(len, places)))


def _informative(pixels: Array, edges: shapely.STRtree, foreign: NDArray[np.bool_]) -> Array:
    """The pixels (n, 2) in view that are nearer to an edge of the region's own than to another."""
    visible: Array = pixels[np.isfinite(pixels).all(axis=1)]
    points, nearest = edges.query_nearest(shapely.points(visible))
    uninformative = np.zeros(len(visible), dtype=np.bool_)
    uninformative[points[foreign[nearest]]] = True
    return visible[~uninformative]
