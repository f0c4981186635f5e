"""What one click proposes: masks in the photo and patches of the cloud, small ones first."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from regionpose.app.parts import Choices, ImagePart, WorldPart, only
from regionpose.regions.image import ImageRegion
from regionpose.scene.loading import Scene
from regionpose.scene.region_sides import Scan, points_side, world_side
from regionpose.scene.sensors import Picture
from regionpose.segment.chessboard import chessboard_around
from regionpose.segment.cloud import grow_plane
from regionpose.segment.image import grow_image_region, stable_tolerances
from regionpose.segment.quads import quads_around
from regionpose.segment.segmenters import Segmenter, segmented
from regionpose.segment.whole_plane import whole_plane
from regionpose.validation.arrays import Array

MOST_MASKS = 3
"""Grown masks that a click proposes: as many as a glance takes in."""

SHADES = (1 / 16, 1 / 8, 1 / 4)
"""Tolerances of the intensity that are tried, over the cloud's range of intensities; from noise to plain contrast."""

RANGE_PERCENTILES = (2.0, 98.0)
"""The range of intensities leaves reflectors out."""

LEAST_PURITY = 0.9
"""Fraction of like points among the neighbors of a patch's points, on the same plane, from which its intensity marks a
region of its own, as of a sign on a wall. Of the demo's six regions it is 0.93 to 1.0; a face whose intensity only
varies has less."""

SAME_SET = 0.95
"""Intersection over union from which two sets of points are one choice: a twentieth is what edges and noise make."""

NEIGHBORS = 8
"""Nearest points on the plane that are searched, and across which a patch is connected: those around a point."""

NEAREST_AND_SELF = NEIGHBORS + 1


def mask_choices(image: Picture, seed: Sequence[float]) -> Choices[ImagePart]:
    """Masks around a pixel (x, y), and outlines that the photo shows there, in order of size.

    The outlines are those of a chessboard, or quadrilaterals where there's none. The largest of a chessboard is taken,
    else the mask that `grow_image_region` would choose, or the clearest quadrilateral where nothing grows. ValueError
    for a seed outside the image, or one around which there is nothing.
    """
    place = (float(seed[0]), float(seed[1]))
    tolerances = stable_tolerances(image, place, most=MOST_MASKS)
    board = [only(part) for part in _outlined_parts(image, chessboard_around(image, place), "chessboard")]
    drawn = board or [only(part) for part in _outlined_parts(image, quads_around(image, place), "edges of the photo")]
    masks = Choices(tuple(partial(_mask, image, place, tolerance) for tolerance, _ in tolerances))
    own = masks.at(min(range(len(masks)), key=lambda index: abs(tolerances[index][1] - 1.0)))
    areas = [part.chosen.region.area for part in drawn]
    try:
        area = own.chosen.region.area
    except ValueError:
        if not drawn:
            raise
        return _by_size(drawn, areas, drawn[-1 if board else 0])
    sized = [ratio * area for _, ratio in tolerances] + areas
    grown = [own if k == own.index else masks.at(k) for k in range(len(masks))]
    return _by_size(grown + drawn, sized, drawn[-1] if board else own)


def _by_size(parts: list[Choices[ImagePart]], areas: list[float], taken: Choices[ImagePart]) -> Choices[ImagePart]:
    """The chosen ones of some proposals as one list, in order of their areas; one of them is taken."""
    order = np.argsort(areas, kind="stable").tolist()
    makers = tuple(partial(_chosen_part, parts[index]) for index in order)
    return Choices(makers, order.index(next(k for k, part in enumerate(parts) if part is taken)))


def _chosen_part(choices: Choices[ImagePart]) -> ImagePart:
    return choices.chosen


def _outlined_parts(image: Picture, outlines: list[Array], label: str) -> list[ImagePart]:
    """Outlines (n, 2) as polygons within the photo; those that cross themselves or that it cuts up are left out."""
    import shapely

    height, width = image.shape[:2]
    photo = shapely.box(-0.5, -0.5, width - 0.5, height - 0.5)
    parts = []
    for outline in outlines:
        whole = shapely.Polygon(outline)
        inside = whole.intersection(photo) if whole.is_valid else shapely.Point()
        if inside.geom_type != "Polygon":
            continue
        ring = shapely.get_coordinates(shapely.get_exterior_ring(inside))[:-1]
        written = [[round(float(value), 2) for value in vertex] for vertex in ring]
        parts.append(ImagePart({"polygon": written}, ImageRegion.from_polygon(written), label=label))
    return parts


def segmenter_choices(segmenter: Segmenter, image: Picture, seed: Sequence[float]) -> Choices[ImagePart]:
    """Masks that a segmenter finds around a pixel (x, y), in order of size; the one that it puts first is taken."""
    masks = segmented(segmenter, image, [seed], [1])
    order = np.argsort([float(mask.sum()) for mask in masks], kind="stable").tolist()
    makers = tuple(partial(ImagePart.of_fractions, masks[index], "segmenter") for index in order)
    return Choices(makers, order.index(0))


def _mask(image: Picture, seed: tuple[float, float], tolerance: float) -> ImagePart:
    """The mask grown with a tolerance."""
    fractions = grow_image_region(image, seed, tolerance=tolerance, coverage=True)
    return ImagePart.of_fractions(fractions, f"colors within {tolerance:.3g}")


def plane_choices(scan: Scan, scene_with: Callable[[dict[str, Any]], Scene], seed: Array) -> Choices[WorldPart]:
    """What lies on the plane around a point (3,) of the world, in order of size; the whole plane is taken.

    Narrower: the patch that grows from there, and where the intensity marks a region of its own, as of a sign on a
    wall, that one. `scene_with` makes a scene of one region whose world side is given. ValueError where no plane is.
    """
    assert scan.cloud is not None
    points, local = scan.cloud.local_points, seed - scan.origin
    place = {"seed": [float(value) for value in seed]}
    patch, whole = grow_plane(points, local), whole_plane(points, local)
    made: list[tuple[int, Callable[[], WorldPart]]] = []
    shade = _shade(scan, local, patch)
    if shade is not None:
        with suppress(ValueError):
            marked = {**place, "intensity_tolerance": shade}
            part = _patch(scan, scene_with, marked, "points of like intensity")
            made.append((_count(part), partial(_loaded, part)))
    same = len(np.intersect1d(patch, whole, assume_unique=True)) >= SAME_SET * len(np.union1d(patch, whole))
    if not same and len(patch) < len(whole):
        made.append((len(patch), partial(_patch, scan, scene_with, place, "the patch around the click")))
    taken = partial(picked_points, scan, whole, "the whole plane")
    made.append((len(whole), taken))
    makers = tuple(maker for _, maker in sorted(made, key=lambda one: one[0]))
    choices = Choices(makers, makers.index(taken), (place["seed"][0], place["seed"][1], place["seed"][2]))
    _ = choices.chosen
    return choices


def picked_points(scan: Scan, indices: NDArray[np.intp], label: str) -> WorldPart:
    """The side of some of the cloud's points, ascending, which `save` writes to a file of their own."""
    written = indices if scan.cloud is None else scan.cloud.to_file_indices(indices)
    return WorldPart({"points": written}, points_side(indices, scan), label, picked=True)


def _count(part: WorldPart) -> int:
    return 0 if part.side.indices is None else len(part.side.indices)


def _loaded(part: WorldPart) -> WorldPart:
    return part


def picked_world(scene: Scene, written: dict[str, Any], scan: Scan, label: str = "") -> WorldPart:
    """What is written of the side in the cloud of a scene's only region, and the side."""
    return WorldPart(written, world_side(scene, ("regions", 0, "world"), scene.model.regions[0].world, scan), label)


def _patch(scan: Scan, scene_with: Callable[[dict[str, Any]], Scene], written: dict[str, Any], label: str) -> WorldPart:
    return picked_world(scene_with(written), written, scan, label)


def _shade(scan: Scan, seed: Array, indices: NDArray[np.intp]) -> float | None:
    """The tolerance of the intensity that marks a region of its own around a seed (3,), about the cloud's local origin,
    on the patch of its plane; None where none does.
    """
    cloud = scan.cloud
    if cloud is None or cloud.intensity is None:
        return None
    low, high = np.percentile(cloud.intensity, RANGE_PERCENTILES)
    places, levels = cloud.local_points[indices], cloud.intensity[indices]
    neighbors = np.asarray(cKDTree(places).query(places, NEAREST_AND_SELF)[1], dtype=np.intp)
    start = int(np.argmin(np.sum((places - seed) ** 2, axis=1)))
    found = [(_purity(levels, neighbors, start, fraction * (high - low)), fraction) for fraction in SHADES]
    purity, fraction = max(found)
    return float(f"{fraction * (high - low):.4g}") if purity >= LEAST_PURITY else None


def _purity(levels: Array, neighbors: NDArray[np.intp], start: int, tolerance: float) -> float:
    """Fraction of like points among the neighbors of those connected with the start; 0 where all are like it."""
    alike = np.abs(levels - np.median(levels[neighbors[start]])) <= tolerance
    alike[start] = True
    rows, columns = np.repeat(np.arange(len(levels)), neighbors.shape[1]), neighbors.ravel()
    linked = alike[rows] & alike[columns]
    graph = coo_array((linked[linked], (rows[linked], columns[linked])), shape=(len(levels),) * 2)
    labels = connected_components(graph, directed=False)[1]
    members = labels == labels[start]
    return 0.0 if members.all() else float(members[neighbors[members]].mean())
