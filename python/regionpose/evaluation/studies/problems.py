"""One problem of a study: a scene, disturbed as its condition says, as the estimate is given it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from regionpose.cameras import Camera
from regionpose.evaluation.masks import Patch, Window, binary_patch, coverage_patch, image_size
from regionpose.evaluation.measures import overlap_error
from regionpose.evaluation.noise import (
    SpinningLidar,
    lidar_points,
    miscalibrate,
    occlude_mask,
    occlude_region,
    square_side,
    squares_on_mask,
    squares_on_region,
    truncate_masks,
)
from regionpose.evaluation.planar import PlaneFrame
from regionpose.evaluation.scenes import MAX_VIEW_ANGLE_DEG, Layout, Scene, draw_scene, problem_generator
from regionpose.evaluation.setups import GrazingPoses, PoseSource, Setup, TurnedPoses
from regionpose.evaluation.studies.conditions import Condition, solver_options
from regionpose.regions import ImageRegion, WorldRegion

Array = NDArray[np.float64]

LIDAR_OFFSET_M = 0.3
"""A lidar stands so far from the camera along each of the camera's axes, at the most: both are on one vehicle."""

LEAST_KEPT_SHARE = 0.5
"""A region that a border cuts to less than this share of its area is left out, as nobody would mark it."""

GRAZING_VIEW_ANGLE_DEG = 90.0
"""Every angle of view is taken where the study asks for grazing ones."""


@dataclass(frozen=True, eq=False)
class Problem:
    """What an estimate is given, and the scene that it comes from.

    `camera`: as it is believed to be. `kept`: the scene's regions that are given. `image_change`, `world_change`: area
    of the symmetric difference between the given and the true regions over the true area, as measured.
    """

    scene: Scene
    camera: Camera
    image_regions: list[ImageRegion]
    world_regions: list[WorldRegion]
    kept: list[int]
    image_change: float
    world_change: float


def draw_problem(setup: Setup, condition: Condition, seed: int) -> Problem:
    """The problem of a seed. Scenes of one seed and layout are the same whatever disturbs them."""
    scene = draw_scene(setup.camera, pose_source(setup, condition), layout(condition), problem_generator(seed))
    rng = problem_generator(seed, "disturbance")
    true, given, shown = image_patches(scene, condition, rng)
    kept = [i for i, patch in enumerate(given) if patch.values.sum() > LEAST_KEPT_SHARE * true[i].values.sum()]
    keep_masks = solver_options(condition.solver).get("integration") == "pixels"
    worlds = [world_side(scene, index, condition, rng) for index in kept]
    changes = [_world_change(scene.regions[index], world) for index, world in zip(kept, worlds, strict=True)]
    return Problem(
        scene,
        given_camera(setup.camera, condition, rng),
        [image_region(given[index], scene.camera, keep_masks, shown) for index in kept],
        worlds,
        kept,
        _image_change([true[index] for index in kept], [given[index] for index in kept]),
        float(np.mean(changes)),
    )


def pose_source(setup: Setup, condition: Condition) -> PoseSource:
    """What the condition draws true poses from."""
    if condition.grazing_deg is not None:
        return GrazingPoses(setup.poses, condition.grazing_deg)
    if condition.turn_deg is not None:
        return TurnedPoses(setup.poses, condition.turn_deg)
    return setup.poses


def layout(condition: Condition) -> Layout:
    """What the condition's scenes hold."""
    limit = MAX_VIEW_ANGLE_DEG if condition.grazing_deg is None else GRAZING_VIEW_ANGLE_DEG
    held = (condition.planes, condition.regions_per_plane, condition.templates, condition.world)
    return Layout(*held, max_view_angle_deg=limit)


def given_camera(camera: Camera, condition: Condition, rng: np.random.Generator) -> Camera:
    """The camera as a calibration with the condition's errors has it."""
    if condition.focal_error == 0.0 and condition.center_error_px == 0.0:
        return camera
    return miscalibrate(camera, condition.focal_error, condition.center_error_px, rng)


def image_patches(
    scene: Scene, condition: Condition, rng: np.random.Generator
) -> tuple[list[Patch], list[Patch], Window]:
    """The true masks and those that the condition makes of them, each in a window, and what the image shows."""
    size = image_size(scene.camera)
    shown = Window(0, 0, *size)
    noisy = condition.noise > 0.0 and condition.side == "2d"
    grows = noisy and condition.disturbance == "squares"
    margins = [_margin(rings, condition.noise) if grows else 0 for rings in scene.image_rings]
    sides = list(zip(scene.image_rings, margins, strict=True))
    binary = [binary_patch(rings, *size, margin) for rings, margin in sides]
    given = binary
    if noisy and condition.disturbance == "truncation":
        given, shown = truncated(binary, condition.noise, rng, shown)
    elif noisy:
        given = disturbed(binary, scene.image_rings, condition, rng)
    if condition.masks == "binary":
        return binary, given, shown
    coverage = [coverage_patch(rings, *size, margin) for rings, margin in sides]
    changed = [
        Patch(np.where(before.values == after.values, whole.values, after.values), whole.window)
        for before, after, whole in zip(binary, given, coverage, strict=True)
    ]
    return coverage, changed, shown


def _margin(rings: Sequence[Array], share: float) -> int:
    """Pixels beside a region that squares on its boundary may reach."""
    low, high = (bound(np.concatenate(rings), axis=0) for bound in (np.min, np.max))
    return int(np.ceil(square_side(share, float(np.prod(high - low))))) + 1


def disturbed(
    patches: list[Patch], rings: list[list[Array]], condition: Condition, rng: np.random.Generator
) -> list[Patch]:
    """The masks, of regions with those pixel rings, with the share `noise` of their area changed."""
    changed = []
    for patch, outline in zip(patches, rings, strict=True):
        if condition.disturbance == "occlusion":
            mask = occlude_mask(patch.values, condition.noise, rng)
        else:
            boundary = [ring - (patch.window.left, patch.window.top) for ring in outline]
            mask = squares_on_mask(patch.values, condition.noise, rng, boundary=boundary)
        changed.append(Patch(mask, patch.window))
    return changed


def truncated(
    patches: list[Patch], share: float, rng: np.random.Generator, image: Window
) -> tuple[list[Patch], Window]:
    """The masks cut by one border of a smaller image, and what that shows of the whole one."""
    windows = np.array([patch.window for patch in patches])
    left, top = windows[:, :2].min(axis=0).tolist()
    right, bottom = windows[:, 2:].max(axis=0).tolist()
    common = [Patch(p.values, p.window.seen_from(left, top)).whole(right - left, bottom - top) for p in patches]
    masks, cut = truncate_masks(common, share, rng)
    cut_patches = [
        Patch(mask[patch.window.seen_from(left, top).block], patch.window)
        for mask, patch in zip(masks, patches, strict=True)
    ]
    # The masks' common window ends at the regions; of its sides only one is the border.
    common_window, at = Window(left, top, right, bottom), cut.seen_from(-left, -top)
    sides = [new if new != old else own for new, old, own in zip(at, common_window, image, strict=True)]
    return cut_patches, Window(*sides)


def image_region(patch: Patch, camera: Camera, keep_mask: bool, shown: Window | None = None) -> ImageRegion:
    """The region that the mask's contour bounds, in an image of which a window is shown (all of it without).

    With the whole mask only where pixels are to be summed.
    """
    size = image_size(camera)
    left, top, right, bottom = shown if shown is not None else Window(0, 0, *size)
    window = patch.window
    seen = Window(max(window.left, left), max(window.top, top), min(window.right, right), min(window.bottom, bottom))
    # Empty pixels around tell what is not the image's border.
    around = ((seen.top > top, seen.bottom < bottom), (seen.left > left, seen.right < right))
    values = patch.values[seen.seen_from(window.left, window.top).block]
    region = ImageRegion.from_mask(np.pad(values, np.array(around, dtype=int)))
    corner = np.array([seen.left - around[1][0], seen.top - around[0][0]], dtype=np.float64)
    mask = patch.whole(*size).astype(np.float64) if keep_mask else None
    border = (left - 0.5, top - 0.5, right - 0.5, bottom - 0.5)
    return ImageRegion(tuple(ring + corner for ring in region.rings), mask, border)


def world_side(scene: Scene, index: int, condition: Condition, rng: np.random.Generator) -> WorldRegion:
    """The world region as the condition disturbs and samples it."""
    rings = scene.regions[index]
    if condition.noise > 0.0 and condition.side == "3d":
        change = squares_on_region if condition.disturbance == "squares" else occlude_region
        rings = change(rings, condition.noise, rng)
    if condition.lidar_beams is None:
        return world_region(rings)
    lidar = SpinningLidar(beams=condition.lidar_beams, range_noise_m=condition.range_noise_m)
    offset = rng.uniform(-LIDAR_OFFSET_M, LIDAR_OFFSET_M, size=3)
    position = scene.rotation.T @ (offset - scene.translation)
    points = lidar_points(rings, position, rng, lidar, up=scene.rotation.T @ np.array([0.0, -1.0, 0.0]))
    return WorldRegion.from_points(points, sensor_origin=position)


def world_region(rings: Sequence[Array]) -> WorldRegion:
    """The region of (n, 3) rings: outer ones, each followed by its holes, which turn the other way."""
    frame = PlaneFrame.of_region(rings)
    polygons: list[list[Array]] = []
    for ring in rings:
        if not polygons or shapely.LinearRing(frame.flat(ring)).is_ccw:
            polygons.append([])
        polygons[-1].append(ring)
    return WorldRegion.from_polygons(polygons)


def _image_change(true: Sequence[Patch], given: Sequence[Patch]) -> float:
    changed = sum(float(np.abs(t.values.astype(float) - g.values).sum()) for t, g in zip(true, given, strict=True))
    whole = sum(float(t.values.sum()) for t in true)
    return changed / whole if whole > 0.0 else float("nan")


def _world_change(rings: Sequence[Array], world: WorldRegion) -> float:
    frame = PlaneFrame.of_region(rings)
    return overlap_error([frame.flat(ring) for ring in world.rings], [frame.flat(ring) for ring in rings])
