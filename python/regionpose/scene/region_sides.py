"""The two sides of each region of a scene: grown from seeds, read from files, or written out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from regionpose.io.clouds import Cloud, read_cloud
from regionpose.io.reading import read_array
from regionpose.progress import Progress
from regionpose.regions.image import ImageRegion
from regionpose.regions.outline import sparse_sampling_handler
from regionpose.regions.world import WorldRegion
from regionpose.scene.document import Place
from regionpose.scene.loading import Scene, named_regions
from regionpose.scene.models import (
    ImageMask,
    ImageSeed,
    ImageSide,
    InlineEquirectangular,
    WorldMesh,
    WorldPoints,
    WorldPolygonSide,
    WorldSeed,
)
from regionpose.scene.models import WorldSide as WorldItem
from regionpose.scene.sensors import Picture, SensorOrigin, at_location
from regionpose.segment.segmenters import Segmenter, segmented
from regionpose.validation.arrays import Array

Indices = NDArray[np.intp]

FAR = 10_000.0
"""A world polygon further than this from zero (meters) is solved about a local origin, as a cloud is."""

ORIGIN_STEP = 100.0
"""A local origin is a multiple of this (meters), so that taking it off rounds nothing."""

SAME_PLACE = 4.0 * float(np.finfo(np.float32).eps)
"""Distance over their largest coordinate up to which two points are one: four roundings to the numbers of a file."""

OUTSIDE_MARGIN = 1.0
"""Pixels that a polygon may reach beyond the image: drawn along its border, it may be off by one but not by more."""

SEED_NEIGHBORS = 9
"""Points around a seed whose median intensity is the region's: enough to outvote an outlier, few enough to lie on
it."""


class Scan(NamedTuple):
    """What the world sides are cut from: the cloud, about `origin` (3,), and where its scanner stood about the same.

    `absent` (k, 3): directions of its beams without a return, where these are given.
    """

    cloud: Cloud | None
    origin: Array
    scanner: Array | None
    absent: Array | None = None

    @classmethod
    def of(cls, cloud: Cloud | None, origin: Array, scanner: SensorOrigin | None) -> Scan:
        """The scan of a cloud whose scanner is given in the scene's world."""
        if cloud is None or scanner is None:
            return cls(cloud, origin, None if scanner is None else scanner.place - origin)
        place = scanner.place - origin
        return cls(cloud, origin, place, _absent(cloud, place))


def _absent(cloud: Cloud, scanner: Array) -> Array | None:
    """Directions (k, 3) of the beams without a return of a scanner at (3,) about the cloud's origin; None of a cloud
    that does not name these.

    Rings imply them, too, but in real scans up to a third of those met surfaces that give no return, such as
    dark glass: of five natural frames the poses of two are then a degree worse.
    """
    from regionpose.regions.absent_beams import absent_beams

    if cloud.grid_shape is None:
        return None
    return absent_beams(cloud.local_points, scanner, grid_shape=cloud.grid_shape, grid_indices=cloud.grid_indices)


@dataclass(frozen=True, eq=False)
class WorldSide:
    """A region's world side and the cloud points it was made from.

    `region` is about the scene's local origin. `indices`: into the cloud, None where the region is not made of its
    points. `outline_because`: why the region is an outline, None where its scan's samples are known. `remarks`: what
    its outline was warned of.
    """

    region: WorldRegion
    indices: Indices | None = None
    outline_because: str | None = None
    remarks: tuple[str, ...] = ()


def scene_origin(scene: Scene, cloud: Cloud | None) -> Array:
    """The local origin (3,), meters: the cloud's, or near the first far polygon, else zero."""
    if cloud is not None:
        return cloud.origin
    for item in named_regions(scene):
        if isinstance(item.world, WorldPolygonSide):
            first = np.concatenate([np.atleast_2d(ring) for ring in item.world.polygon])[0]
            return np.where(np.abs(first) > FAR, np.round(first / ORIGIN_STEP) * ORIGIN_STEP, 0.0)
    return np.zeros(3)


def image_side(scene: Scene, place: Place, item: ImageSide, image: Picture) -> ImageRegion:
    """The region of an image side that stands at `place`; SceneError that names its line when it gives no region."""
    if isinstance(item, ImageSeed):
        return at_location(scene, (*place, "seed"), lambda: _grown(image, item, scene.segmenter))
    if isinstance(item, ImageMask):
        return _masked(scene, place, item, image)
    hidden = (*place, "hidden_edges") if item.hidden_edges else (*place, "polygon")
    drawn = at_location(scene, hidden, lambda: ImageRegion.from_polygon(item.polygon, hidden_edges=item.hidden_edges))
    return at_location(scene, (*place, "polygon"), lambda: _within(scene, drawn, image))


def is_panorama(scene: Scene) -> bool:
    """Whether the left side of the scene's photo continues its right side."""
    return isinstance(scene.model.camera, InlineEquirectangular)


def _within(scene: Scene, drawn: ImageRegion, image: Picture) -> ImageRegion:
    """The region of a polygon that stays in the image; ValueError where it was drawn on a larger one."""
    vertices = np.concatenate(drawn.rings) + 0.5
    size = np.array([image.shape[1], image.shape[0]])
    # The columns of a panorama go on beyond its sides.
    limited = slice(1, 2) if is_panorama(scene) else slice(0, 2)
    beyond = np.maximum(-vertices, vertices - size)[:, limited].max(axis=1)
    if beyond.max() <= OUTSIDE_MARGIN:
        return drawn
    x, y = vertices[np.argmax(beyond)] - 0.5
    larger = float((vertices / size)[:, limited].max())
    cure = "a polygon cut at the photo's border"
    if larger > 1.0:
        cure += f", or, if it was drawn on a photo at least {larger:.3g} times as large, that photo"
    raise ValueError(f"found [{x:g}, {y:g}] outside the photo of {size[0]} x {size[1]} pixels; needed {cure}")


def world_side(
    scene: Scene, place: Place, item: WorldItem, scan: Scan, *, progress: Progress | None = None
) -> WorldSide:
    """The world side that stands at `place`, about the origin; SceneError that names its line where it gives none.

    `progress` gets the fraction that is grown.
    """
    return _with_remarks(
        lambda: _with_viewpoint(scene, place, item, _unremarked_side(scene, place, item, scan, progress), scan.origin)
    )


def plane_sides(scene: Scene, scan: Scan, *, progress: Progress | None = None) -> dict[str, WorldSide]:
    """The world sides of all planes that the scene's cloud holds, the largest first, by names that count them.

    `progress` as of `find_planes`. SceneError where it holds none.
    """
    from regionpose.segment.planes import find_planes

    assert scan.cloud is not None
    points = scan.cloud.local_points
    found = at_location(scene, ("world_regions",), lambda: find_planes(points, progress=progress))
    sides = [side for indices in found for side in _plane_side(indices, scan)]
    if not sides:
        raise scene.error(("world_regions",), "found no plane in the cloud; needed regions written out")
    return {f"plane {number}": side for number, side in enumerate(sides, start=1)}


def points_side(indices: Indices, scan: Scan) -> WorldSide:
    """The world side of some of the scan's points, ascending, as of a scene file that names them; ValueError where they
    are none.
    """
    assert scan.cloud is not None
    points = scan.cloud.local_points
    return _with_remarks(lambda: _scanned(points, indices, WorldPoints.model_construct(points=[]), scan))


def _plane_side(indices: Indices, scan: Scan) -> list[WorldSide]:
    """The side of a plane's points; none where they are too few across to have an outline, or on one scan line."""
    try:
        side = points_side(indices, scan)
    except ValueError:
        return []
    return [] if side.region.is_line else [side]


def _with_remarks(made: Callable[[], WorldSide]) -> WorldSide:
    """The side that is made, with what its outline was warned of."""
    messages: list[str] = []
    with sparse_sampling_handler(messages.append):
        side = made()
    return replace(side, remarks=tuple(messages))


def _with_viewpoint(scene: Scene, place: Place, item: WorldItem, side: WorldSide, origin: Array) -> WorldSide:
    """The side whose region knows the viewpoint that the scene gives it, if any."""
    if item.viewpoint is None:
        return side
    viewpoint = np.asarray(item.viewpoint) - origin
    return at_location(
        scene, (*place, "viewpoint"), lambda: replace(side, region=side.region.with_viewpoint(viewpoint))
    )


def _unremarked_side(scene: Scene, place: Place, item: WorldItem, scan: Scan, progress: Progress | None) -> WorldSide:
    if isinstance(item, WorldPolygonSide):
        return at_location(scene, (*place, "polygon"), lambda: _polygon(item, scan.origin))
    if isinstance(item, WorldMesh):
        return at_location(scene, (*place, "mesh"), lambda: _mesh(scene.file(item.mesh), scan.origin))
    if isinstance(item, WorldSeed):
        return at_location(scene, (*place, "seed"), lambda: _grown_plane(item, scan, progress))
    return at_location(scene, (*place, "points"), lambda: _points(scene, item, scan))


def _grown(image: Picture, item: ImageSeed, segmenter: Segmenter | None) -> ImageRegion:
    from regionpose.segment.image import grow_image_region

    x, y = item.seed
    height, width = image.shape[:2]
    if not (-0.5 <= x < width - 0.5 and -0.5 <= y < height - 0.5):
        raise ValueError(f"found [{x:g}, {y:g}] outside the image; needed a pixel of its {width} x {height}")
    if segmenter is not None and item.tolerance is None:
        return ImageRegion.from_mask(segmented(segmenter, image, [item.seed], [1])[0])
    return ImageRegion.from_mask(grow_image_region(image, (x, y), tolerance=item.tolerance, coverage=True))


def _masked(scene: Scene, place: Place, item: ImageMask, image: Picture) -> ImageRegion:
    from regionpose.io.masks.readers import coverage_from_file, mask_from_file, region_from_file

    path, size = scene.file(item.mask), (image.shape[0], image.shape[1])
    panorama = is_panorama(scene)
    from_mask = partial(ImageRegion.from_mask, panorama=panorama)
    if item.coverage:
        return at_location(scene, (*place, "mask"), lambda: from_mask(coverage_from_file(path, size)))
    whole = at_location(
        scene,
        (*place, "mask"),
        lambda: region_from_file(path, item.label, image=item.image, size=size, panorama=panorama),
    )
    if item.unknown is None:
        return whole
    unknown = scene.file(item.unknown)
    return at_location(
        scene,
        (*place, "unknown"),
        lambda: from_mask(
            mask_from_file(path, item.label, image=item.image),
            unknown=mask_from_file(unknown, item.unknown_label, image=item.image),
        ),
    )


def _polygon(item: WorldPolygonSide, origin: Array) -> WorldSide:
    nested = isinstance(item.polygon[0][0], list)
    rings = item.polygon if nested else [item.polygon]
    region = WorldRegion.from_polygon([np.asarray(ring, dtype=np.float64) - origin for ring in rings])
    return WorldSide(region, outline_because="it is given as a polygon")


def _mesh(path: Path, origin: Array) -> WorldSide:
    cloud = read_cloud(path)
    if cloud.triangles is None:
        raise ValueError(f"{path}: found points without triangles; needed a mesh")
    surface = SimpleNamespace(vertices=cloud.local_points + (cloud.origin - origin), faces=cloud.triangles)
    return WorldSide(WorldRegion.from_mesh(surface), outline_because="it is given as a mesh")


def _grown_plane(item: WorldSeed, scan: Scan, progress: Progress | None) -> WorldSide:
    from regionpose.segment.cloud import grow_plane

    if scan.cloud is None:
        raise ValueError("found a seed without a cloud; needed the key cloud in the scene")
    points, seed = scan.cloud.local_points, np.asarray(item.seed) - scan.origin
    grow = partial(grow_plane, seed=seed, min_width_m=item.min_width_m, progress=progress)
    if item.intensity_tolerance is None:
        indices = grow(points)
    else:
        alike = _similar_in_intensity(scan.cloud, seed, item.intensity_tolerance)
        indices = alike[grow(points[alike])]
    return _scanned(points, indices, item, scan)


def _scanned(points: Array, indices: Indices, item: WorldSeed | WorldPoints, scan: Scan) -> WorldSide:
    """The side of the returns `indices` of a scan's points (n, 3): its samples, or the outline and why."""
    if item.radius_m is not None:
        return replace(_outlined(points[indices], item, scan, "its radius_m is given"), indices=indices)
    region = WorldRegion.from_scan(
        points, indices, sensor_origin=scan.scanner, extends=item.extends, absent_beams=scan.absent
    )
    if region.samples is not None:
        return WorldSide(region, indices)
    if scan.scanner is None:
        return WorldSide(region, indices, "sensor_origin is missing, and no points on its plane surround it")
    return WorldSide(region, indices, "no beam passed its plane beside it")


def _outlined(points: Array, item: WorldSeed | WorldPoints, scan: Scan, because: str) -> WorldSide:
    """The side of points (n, 3) by their outline."""
    region = WorldRegion.from_points(points, radius_m=item.radius_m, sensor_origin=scan.scanner)
    return WorldSide(region, outline_because=because)


def _similar_in_intensity(cloud: Cloud, seed: Array, tolerance: float) -> Indices:
    """Indices of the points whose intensity is within `tolerance` of the median around the seed."""
    if cloud.intensity is None:
        raise ValueError(
            "found intensity_tolerance with a cloud without intensity; needed a cloud that has it, or no such key"
        )
    count = min(SEED_NEIGHBORS, len(cloud))
    squares = np.sum((cloud.local_points - seed) ** 2, axis=1)
    around = np.argpartition(squares, count - 1)[:count]
    levels = cloud.intensity[around]
    if not np.isfinite(levels).any():
        raise ValueError("found no intensity of the points around the seed; needed some that have it, or no such key")
    return np.flatnonzero(np.abs(cloud.intensity - np.median(levels[np.isfinite(levels)])) <= tolerance)


def _points(scene: Scene, item: WorldPoints, scan: Scan) -> WorldSide:
    if isinstance(item.points, list):
        _refuse_label(item, "indices in the scene file")
        return _indexed(np.asarray(item.points), item, scan)
    path = scene.file(item.points)
    if path.suffix.lower() not in {".npy", ".npz"}:
        _refuse_label(item, f"the points of {path}")
        other = read_cloud(path)
        return _placed(other.local_points + (other.origin - scan.origin), item, scan)
    values = read_array(path)
    if values.ndim == 2 and values.shape[1] == 3 and values.dtype.kind in "iuf":
        _refuse_label(item, f"the points of {path}")
        other = Cloud.from_points(values, source=path)
        return _placed(other.local_points + (other.origin - scan.origin), item, scan)
    return _indexed(_chosen(path, values, item, scan.cloud), item, scan)


def _refuse_label(item: WorldPoints, beside: str) -> None:
    if item.label is not None:
        raise ValueError(f"found label {item.label} beside {beside}; needed it with a file of labels alone")


def _placed(points: Array, item: WorldPoints, scan: Scan) -> WorldSide:
    """The side of points (n, 3) about the origin, which may be some of the cloud's."""
    indices = None if scan.cloud is None else _found_in(scan.cloud.local_points, points)
    if scan.cloud is None or indices is None:
        return _outlined(points, item, scan, "its points aren't the cloud's")
    return _scanned(scan.cloud.local_points, indices, item, scan)


def _found_in(cloud: Array, points: Array) -> Indices | None:
    """Indices, ascending, of the points (n, 3) in a cloud (m, 3); None where one isn't there."""
    if points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all() or not len(points):
        return None
    low, high = points.min(axis=0), points.max(axis=0)
    same = SAME_PLACE * float(np.abs([low, high]).max())
    around = np.flatnonzero(((cloud >= low - same) & (cloud <= high + same)).all(axis=1))
    if not len(around):
        return None
    distances, nearest = cKDTree(cloud[around]).query(points)
    found: Indices = np.unique(around[nearest])
    return found if float(np.max(distances)) <= same else None


def _chosen(path: Path, values: NDArray[np.generic], item: WorldPoints, cloud: Cloud | None) -> Indices:
    """Indices from a file of indices, of a mask (bool), or of labels."""
    if values.ndim != 1 or values.dtype.kind not in "biu":
        found = f"{values.dtype} of shape {values.shape}"
        raise ValueError(f"{path}: found {found}; needed points (n, 3), or indices, a mask or labels (n,)")
    if values.dtype.kind != "b" and item.label is None:
        return values.astype(np.intp)
    if cloud is not None and len(values) != len(cloud) + cloud.dropped:
        raise ValueError(
            f"{path}: found {len(values)} values; needed {len(cloud) + cloud.dropped}, one for each point of the cloud"
        )
    chosen = np.flatnonzero(values if item.label is None else values == item.label)
    if not len(chosen):
        raise ValueError(f"{path}: found no point of the label {item.label}; needed at least 3")
    return chosen


def _indexed(indices: Indices, item: WorldPoints, scan: Scan) -> WorldSide:
    cloud = scan.cloud
    if cloud is None:
        raise ValueError("found indices without a cloud; needed the key cloud in the scene")
    kept = cloud.from_file_indices(indices)
    if len(kept) < 3:
        raise ValueError(f"found {len(indices)} indices, of {len(kept)} points; needed at least 3")
    return _scanned(cloud.local_points, kept, item, scan)
