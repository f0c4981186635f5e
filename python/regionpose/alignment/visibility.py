"""Whether a cloud hides the regions that a photo shows, at a pose (docs/math.md, eq. 18.4 and 18.5)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.ndimage import binary_closing

from regionpose.alignment.photo_cloud import PhotoCloud
from regionpose.alignment.views import EDGE_FRACTION
from regionpose.cameras import Camera
from regionpose.geometry.pose import Pose
from regionpose.regions.image import ImageRegion
from regionpose.regions.world import WorldRegion
from regionpose.solve.edge_diagnostics import Occlusion

Array = NDArray[np.float64]

CELLS = 400
"""Cells that a region is cut into: a fraction known to some hundredths."""

GAP_CELLS = 5
"""Width of the gaps that a surface closes between its samples, a quarter of the region's: convention. With 3 to 11
cells 104 to 163 of 964 wrong poses hide a region, and none of 104 right ones (`python -m benchmarks.visibility`)."""

LEAST_CELLS = 20
"""Fewest cells in the photo for an occlusion test: a twentieth of the region; below, the overlap error shows it."""

MOSTLY = 0.5
"""Fraction above which a region counts as hidden: convention. At the true poses at most 0.09 of one is hidden, at those
of estimates that count as right 0.38 (the same command)."""

MOST_POINTS = 500_000
"""Most points that are projected, evenly drawn: more lie closer together than a cell of most regions."""


class _Cells(NamedTuple):
    """Squares of a region's plane: the corner (2,) of the first and their size, meters; indices (n, 2) of those that
    the photo shows, and of how many there are along each side, (2,).
    """

    corner: Array
    size: float
    visible: NDArray[np.int64]
    shape: NDArray[np.int64]


def occlusions(photo_cloud: PhotoCloud, pose: Pose) -> tuple[Occlusion, ...]:
    """How much of each world region of a frame its points hide at a pose, where its image region shows it; nothing
    without world regions.

    ValueError for another number of regions in the world than in the image.
    """
    places, frame = photo_cloud.points, photo_cloud.frame
    image_regions, world_regions = frame.image_regions, frame.world_regions
    if not world_regions:
        return ()
    if len(image_regions) != len(world_regions):
        raise ValueError(
            f"there are {len(world_regions)} world regions; needed {len(image_regions)}, one for each image region"
        )
    some = places[:: max(1, -(-len(places) // MOST_POINTS))]
    pairs = zip(image_regions, world_regions, strict=True)
    return tuple(_occlusion(observed, world, some, photo_cloud.camera, pose) for observed, world in pairs)


def _occlusion(observed: ImageRegion, world: WorldRegion, points: Array, camera: Camera, pose: Pose) -> Occlusion:
    cells = _cells(observed, world, camera, pose)
    if len(cells.visible) < LEAST_CELLS:
        return Occlusion(np.nan, np.nan, np.nan, is_hidden=False)
    nearer, shadows = _shadows(world, points, pose.camera_center)
    hidden, above = _covered(cells, shadows)
    before = np.linalg.norm(points[nearer[above]] - pose.camera_center, axis=1)
    middle = cells.corner + (cells.visible.mean(axis=0) + 0.5) * cells.size
    away = np.linalg.norm(world.core.origin + middle @ world.core.axes[:2] - pose.camera_center)
    fraction, distance_m = float(hidden.mean()), float(np.median(before)) if len(before) else np.nan
    return Occlusion(fraction, distance_m, float(away), is_hidden=fraction > MOSTLY)


def _covered(cells: _Cells, shadows: Array) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which of the visible cells (n,) surfaces cover whose samples have these shadows (m, 2), and which of the
    shadows (m,) fall on such cells.
    """
    ends = cells.shape + 2 * GAP_CELLS
    indices = np.floor((shadows - cells.corner) / cells.size) + GAP_CELLS
    beside = np.asarray(((indices >= 0) & (indices < ends)).all(axis=1))
    places = tuple(indices[beside].astype(np.int64).T)
    surface, covered = np.zeros((2, *ends), dtype=np.bool_)
    surface[places] = True
    closed = np.asarray(binary_closing(surface, np.ones((GAP_CELLS, GAP_CELLS), dtype=np.bool_)))
    visible = tuple((cells.visible + GAP_CELLS).T)
    covered[visible] = closed[visible]
    beside[beside] = covered[places]
    return closed[visible], beside


def _shadows(world: WorldRegion, points: Array, center: Array) -> tuple[NDArray[np.intp], Array]:
    """The numbers (m,) of the points before a region as seen from a center, and where the rays through them meet its
    plane, (m, 2).
    """
    origin, (*flat, normal), surface = world.core.origin, world.core.axes, world.core.surface
    height = float(normal @ (origin - center))
    with np.errstate(invalid="ignore", divide="ignore"):
        # 0 at the camera, 1 on the plane; a curved surface begins before its mean plane.
        way = (points @ normal - normal @ center) / height
        begins = 1.0 if surface is None else min(1.0, float(((surface[0] - center) @ normal / height).min()))
        nearer = np.flatnonzero((way > 0.0) & (way < (1.0 - EDGE_FRACTION) * begins))
    shadows = (points[nearer] - center) / way[nearer, None] + (center - origin)
    return nearer, shadows @ np.transpose(flat)


def _cells(observed: ImageRegion, world: WorldRegion, camera: Camera, pose: Pose) -> _Cells:
    """The cells of a world region whose middles the camera sees within the observed region."""
    rings = world.core.outline
    vertices = np.concatenate(rings)
    corner, extent = vertices.min(axis=0), np.ptp(vertices, axis=0)
    # Of a narrow region fewer: no side has more than CELLS.
    size = max(float(np.sqrt(world.area / CELLS)), float(extent.max()) / CELLS)
    shape = np.ceil(extent / size).astype(np.int64)
    indices = np.indices(tuple(shape.tolist())).reshape(2, -1).T
    flat = corner + (indices + 0.5) * size
    within = _inside(rings, flat)
    indices, flat = indices[within], flat[within]
    pixels = camera.project(pose.transform(world.core.origin + flat @ world.core.axes[:2]))
    shown = _inside(observed.rings, pixels)
    if camera.period is not None:
        shown |= _inside(observed.rings, pixels + np.array([camera.period, 0.0]))
    return _Cells(corner, size, indices[shown], shape)


def _inside(rings: Sequence[Array], places: Array) -> NDArray[np.bool_]:
    """Which places (n, 2) lie in a region: within an odd number of its rings; NaN does not."""
    within = [shapely.contains_xy(shapely.Polygon(ring), *places.T) for ring in rings]
    return np.asarray(np.logical_xor.reduce(within))
