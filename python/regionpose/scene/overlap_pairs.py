"""Pairs of image regions and planes of a cloud that overlap at a pose by edges."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import shapely
from scipy.optimize import linear_sum_assignment
from shapely.geometry.base import BaseGeometry

from regionpose.cameras import Camera
from regionpose.geometry.pose import Pose
from regionpose.regions.image import ImageRegion
from regionpose.regions.world import WorldRegion
from regionpose.scene.exposure import Matching, SceneData, Unpaired, checked
from regionpose.scene.models import PLANES
from regionpose.solve.estimate import PoseError, PoseEstimate
from regionpose.solve.prior import Prior
from regionpose.validation.arrays import Array
from regionpose.viz.projections import projected_rings

LEAST_WITHIN = 0.5
"""Fraction of a projected plane that lies in the image region of its pair: a convention, most of it. Scans show the
lower part of a house's wall, so that the two may share a sixth of their union."""

NEAR_DEG, NEAR_M = 1.0, 0.3
"""Standard deviations of what pairs by overlap leave the pose: conventions, within which a pose by edges counts as
right, several times its own."""

LEAST_CONFIDENCE = 0.9
"""Of a pose by edges that pairs follow from: odds of 9 to 1, a convention."""


def takes_edges(sides: SceneData) -> bool:
    """Whether planes are to be matched whose pairs edges may give: the scene has no pair, and wants edges to
    be used.
    """
    model = sides.scene.model
    can_match = sides.unpaired.can_match and not sides.names and sides.cloud is not None
    return can_match and model.world_regions == PLANES and model.solver.edges


def paired_by_overlap(sides: SceneData, calibrated: Callable[[], PoseEstimate]) -> SceneData:
    """The sides with the pairs that overlap at the pose by edges; the same where that is not sure, or nothing does."""
    try:
        found = calibrated()
    except PoseError:
        return sides
    if found.confidence < LEAST_CONFIDENCE:
        return sides
    unpaired = sides.unpaired
    worlds = [side.region for side in unpaired.world_sides]
    pairs = overlapping(sides.camera, found.pose, sides.image.shape[:2], unpaired.image_regions, worlds)
    return _paired(sides, pairs, found.pose.rebase(-sides.origin)) if pairs else sides


def near_edges(prior: Prior, pose: Pose) -> Prior:
    """The prior of a pose by regions whose pairs follow from a pose by edges: the pairs hold no farther from it."""
    return replace(prior, initial=pose, initial_rotation_sigma_deg=NEAR_DEG, initial_center_sigma_m=NEAR_M)


def overlapping(
    camera: Camera,
    pose: Pose,
    shape: tuple[int, ...],
    image_regions: Sequence[ImageRegion],
    world_regions: Sequence[WorldRegion],
) -> list[tuple[int, int]]:
    """Indices of image and world regions that are pairs at a pose, in a photo of a shape (h, w): most of what the photo
    shows of the world region lies in the image region. No region is in two pairs, whose intersections over unions add
    up to the largest sum.
    """
    height, width = shape
    photo = shapely.box(-0.5, -0.5, width - 0.5, height - 0.5)
    observed = [_polygon(region.rings) for region in image_regions]
    projected = [shapely.intersection(_polygon(projected_rings(camera, each, pose)), photo) for each in world_regions]
    shared = np.array([shapely.area(shapely.intersection(one, np.array(projected))) for one in observed])
    own, areas = shapely.area(np.array(observed))[:, None], shapely.area(np.array(projected))
    within = shared >= LEAST_WITHIN * np.maximum(areas, 1.0)
    overlaps = np.where(within, shared / np.maximum(own + areas - shared, 1.0), 0.0)
    rows, columns = linear_sum_assignment(overlaps, maximize=True)
    return [(int(i), int(j)) for i, j in zip(rows, columns, strict=True) if within[i, j]]


def _polygon(rings: Sequence[Array]) -> BaseGeometry:
    """What lies in an odd number of rings (n, 2), without those that the camera does not see as a whole."""
    found: BaseGeometry = shapely.Polygon()
    for ring in rings:
        if np.isfinite(ring).all():
            found = found.symmetric_difference(shapely.Polygon(ring).buffer(0.0))
    return found


def _paired(sides: SceneData, pairs: Sequence[tuple[int, int]], pose: Pose) -> SceneData:
    """The sides with pairs of their unpaired regions at a pose; the other regions are left without a partner."""
    unpaired = sides.unpaired
    images, worlds = {i for i, _ in pairs}, {j for _, j in pairs}
    names = tuple((unpaired.image_names[i], unpaired.world_names[j]) for i, j in pairs)
    matching = Matching(
        names,
        tuple(name for i, name in enumerate(unpaired.image_names) if i not in images),
        tuple(name for j, name in enumerate(unpaired.world_names) if j not in worlds),
        (),
        pose,
    )
    return checked(
        replace(
            sides,
            names=tuple(image for image, _ in names),
            image_regions=tuple(unpaired.image_regions[i] for i, _ in pairs),
            world_sides=tuple(unpaired.world_sides[j] for _, j in pairs),
            unpaired=Unpaired(),
            matching=matching,
        )
    )
