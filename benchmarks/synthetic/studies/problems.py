"""One problem of a study: a scene, disturbed as its condition says, as the estimate is given it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import shapely
from numpy.typing import NDArray
from regionpose.cameras import Camera
from regionpose.geometry.pose import Pose
from regionpose.regions.image import ImageRegion
from regionpose.regions.mask import MaskWindow, traced_mask
from regionpose.regions.world import WorldRegion
from regionpose.solve.prior import Prior
from scipy.spatial.transform import Rotation

from benchmarks.synthetic.lidar import LidarScan, SpinningLidar, lidar_scan, mislabeled
from benchmarks.synthetic.masks import (
    MaskPatch,
    Window,
    binary_mask,
    binary_patch,
    coverage_patch,
    image_size,
    project_region,
)
from benchmarks.synthetic.measures import overlap_error
from benchmarks.synthetic.noise import (
    miscalibrate,
    occlude_mask,
    occlude_region,
    square_side,
    squares_on_mask,
    squares_on_region,
    squares_painted,
    truncate_masks,
)
from benchmarks.synthetic.planar import PlaneFrame, area_vector, region_centroid
from benchmarks.synthetic.scenes import MAX_VIEW_ANGLE_DEG, Layout, SyntheticScene, draw_scene, problem_generator
from benchmarks.synthetic.setups import GrazingPoses, PoseSource, Setup, TurnedPoses
from benchmarks.synthetic.studies.conditions import Condition, Scan, Value
from benchmarks.synthetic.studies.drawn import OUTLINE_TOLERANCE_PX, ROUGH_CORNER_PX, by_hand, drawn_region
from benchmarks.synthetic.studies.wrong_regions import with_wrong_region

Array = NDArray[np.float64]

LIDAR_OFFSET_M = 0.3
"""A lidar stands so far from the camera along each of the camera's axes, at the most: both are on one vehicle."""

BOX_DEPTH = 0.9
"""A box that hides a part of a region stands at this share of its distance."""

LEAST_KEPT_SHARE = 0.5
"""A region that a border cuts to less than this share of its area is left out, as nobody would mark it."""

UP_SIGMA_DEG = 5.0
"""Standard deviation of a known up direction about each axis: a camera held upright."""

INITIAL_ROTATION_SIGMA_DEG = 10.0
INITIAL_CENTER_SIGMA_M = 0.5
"""Standard deviations along each axis of a rough pose: read off a map, or guessed."""

NEAR_SIGMA_M = 1.0
"""Standard deviation, meters along each axis, of a place that the camera is near: beside a scanner on a vehicle."""

GRAZING_VIEW_ANGLE_DEG = 90.0
"""Every angle of view is taken where the study asks for grazing ones."""


@dataclass(frozen=True, eq=False)
class StudyProblem:
    """What an estimate is given, and the scene that it comes from.

    `camera`: as it is believed to be. `kept`: the scene's regions that are given: not those that a border cuts in
    halves or that a lidar hits too rarely. `image_change`, `world_change`: area of the symmetric difference between the
    given and the true regions over the true area, as measured; a wrong region counts by its own disturbance alone.
    `wrong`: places of the wrong regions among those given. `prior`: what is known of the pose beforehand. `drawn`:
    fields of the condition that the seed decided.
    """

    scene: SyntheticScene
    camera: Camera
    image_regions: list[ImageRegion]
    world_regions: list[WorldRegion]
    kept: list[int]
    image_change: float
    world_change: float
    wrong: tuple[int, ...] = ()
    prior: Prior | None = None
    drawn: Mapping[str, Value] = field(default_factory=dict)


def draw_problem(setup: Setup, condition: Condition, seed: int) -> StudyProblem:
    """The problem of a seed. Scenes of one seed and layout are the same whatever disturbs them."""
    scene = draw_scene(setup.camera, pose_source(setup, condition), layout(condition), problem_generator(seed))
    wrong, told = with_wrong_region(scene, condition, problem_generator(seed, "wrong"))
    seen, known = (told, scene) if condition.side == "2d" else (scene, told)
    rng = problem_generator(seed, "disturbance")
    true, given, shown = image_patches(seen, condition, rng)
    kept = [i for i, patch in enumerate(given) if patch.values.sum() > LEAST_KEPT_SHARE * true[i].values.sum()]
    box = box_before(scene, problem_generator(seed, "box")) if condition.cut == "box" else None
    worlds = world_sides(known, kept, condition, rng, box)
    changes = [_world_change(known.regions[index], world) for index, world in worlds.items()]
    if condition.masks == "drawn":
        errors = by_hand(problem_generator(seed, "drawn"), ROUGH_CORNER_PX)
        images = [drawn_region(seen, seen.regions[index], errors) for index in worlds]
    else:
        boxes = [box if index == 0 else None for index in worlds]
        images = [given_region(seen, i, given[i], condition, shown, b) for i, b in zip(worlds, boxes, strict=True)]
    if "side" in condition.prior:
        viewpoint = Pose.from_parts(scene.rotation, scene.translation).camera_center
        worlds = {index: world.with_viewpoint(viewpoint) for index, world in worlds.items()}
    return StudyProblem(
        scene,
        given_camera(setup.camera, condition, rng),
        images,
        list(worlds.values()),
        list(worlds),
        _image_change([true[index] for index in worlds], [given[index] for index in worlds]),
        float(np.mean(changes)),
        (list(worlds).index(wrong),) if wrong in worlds else (),
        known_beforehand(scene, condition, problem_generator(seed, "prior")),
    )


def known_beforehand(scene: SyntheticScene, condition: Condition, rng: np.random.Generator) -> Prior | None:
    """What the condition lets be known of the pose beforehand, with its errors."""
    if condition.prior == "initial":
        turn = Rotation.from_rotvec(rng.normal(0.0, INITIAL_ROTATION_SIGMA_DEG, size=3), degrees=True)
        true = Pose.from_parts(scene.rotation, scene.translation)
        moved = turn.as_matrix() @ true.translation + rng.normal(0.0, INITIAL_CENTER_SIGMA_M, size=3)
        return Prior(
            initial=Pose(turn * true.rotation, moved),
            initial_rotation_sigma_deg=INITIAL_ROTATION_SIGMA_DEG,
            initial_center_sigma_m=INITIAL_CENTER_SIGMA_M,
        )
    if condition.prior == "near":
        place = Pose.from_parts(scene.rotation, scene.translation).camera_center
        return Prior(camera_near=place + rng.normal(0.0, NEAR_SIGMA_M, size=3), camera_near_sigma_m=NEAR_SIGMA_M)
    if "up" in condition.prior:
        turn = Rotation.from_rotvec(rng.normal(0.0, UP_SIGMA_DEG, size=3), degrees=True)
        return Prior(up=scene.rotation.T @ turn.apply([0.0, -1.0, 0.0]), up_sigma_deg=UP_SIGMA_DEG)
    return None


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
    scene: SyntheticScene, condition: Condition, rng: np.random.Generator
) -> tuple[list[MaskPatch], list[MaskPatch], Window]:
    """The true masks and those that the condition makes of them, each in a window, and what the image shows."""
    size = image_size(scene.camera)
    shown = Window(0, 0, *size)
    noisy = condition.noise > 0.0 and condition.side == "2d"
    grows = noisy and condition.disturbance in ("squares", "painted")
    margins = [_margin(rings, condition) if grows else 0 for rings in scene.image_rings]
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
        MaskPatch(np.where(before.values == after.values, whole.values, after.values), whole.window)
        for before, after, whole in zip(binary, given, coverage, strict=True)
    ]
    return coverage, changed, shown


def _margin(rings: Sequence[Array], condition: Condition) -> int:
    """Pixels beside a region that squares on its boundary may reach."""
    low, high = (bound(np.concatenate(rings), axis=0) for bound in (np.min, np.max))
    return int(np.ceil(square_side(condition.noise, float(np.prod(high - low)), condition.squares))) + 1


def disturbed(
    patches: list[MaskPatch], rings: list[list[Array]], condition: Condition, rng: np.random.Generator
) -> list[MaskPatch]:
    """The masks, of regions with those pixel rings, with the share `noise` of their area changed."""
    changed = []
    for patch, outline in zip(patches, rings, strict=True):
        if condition.disturbance == "occlusion":
            mask = occlude_mask(patch.values, condition.noise, rng)
        else:
            boundary = [ring - (patch.window.left, patch.window.top) for ring in outline]
            side = square_side(condition.noise, float(patch.values.sum()), condition.squares)
            change = squares_painted if condition.disturbance == "painted" else squares_on_mask
            mask = change(patch.values, condition.noise, rng, side=side, boundary=boundary)
        changed.append(MaskPatch(mask, patch.window))
    return changed


def truncated(
    patches: list[MaskPatch], share: float, rng: np.random.Generator, image: Window
) -> tuple[list[MaskPatch], Window]:
    """The masks cut by one border of a smaller image, and what that shows of the whole one."""
    windows = np.array([patch.window for patch in patches])
    left, top = windows[:, :2].min(axis=0).tolist()
    right, bottom = windows[:, 2:].max(axis=0).tolist()
    common = [MaskPatch(p.values, p.window.seen_from(left, top)).whole(right - left, bottom - top) for p in patches]
    masks, cut = truncate_masks(common, share, rng)
    cut_patches = [
        MaskPatch(mask[patch.window.seen_from(left, top).block], patch.window)
        for mask, patch in zip(masks, patches, strict=True)
    ]
    # The masks' common window ends at the regions; of its sides only one is the border.
    common_window, at = Window(left, top, right, bottom), cut.seen_from(-left, -top)
    sides = [new if new != old else own for new, old, own in zip(at, common_window, image, strict=True)]
    return cut_patches, Window(*sides)


def given_region(
    scene: SyntheticScene,
    index: int,
    patch: MaskPatch,
    condition: Condition,
    shown: Window | None,
    box: Array | None = None,
) -> ImageRegion:
    """The image side of a region: from its mask, beside what a box (n, 3) hides, or its true outline."""
    if box is not None:
        size = image_size(scene.camera)
        hidden = project_region(scene.camera, scene.rotation, scene.translation, [box], OUTLINE_TOLERANCE_PX)
        return ImageRegion.from_mask(patch.whole(*size), unknown=binary_mask(hidden, *size))
    if condition.masks == "polygon":
        pose = scene.rotation, scene.translation
        return ImageRegion.from_polygon(project_region(scene.camera, *pose, scene.regions[index], OUTLINE_TOLERANCE_PX))
    return image_region(patch, scene.camera, shown)


def image_region(patch: MaskPatch, camera: Camera, shown: Window | None = None) -> ImageRegion:
    """The region that the mask's contour bounds, in an image of which a window is shown (all of it without)."""
    width, height = image_size(camera)
    left, top, right, bottom = shown if shown is not None else Window(0, 0, width, height)
    window = patch.window
    seen = Window(max(window.left, left), max(window.top, top), min(window.right, right), min(window.bottom, bottom))
    # Empty pixels around tell what is not the image's border.
    around = ((seen.top > top, seen.bottom < bottom), (seen.left > left, seen.right < right))
    values = patch.values[seen.seen_from(window.left, window.top).block]
    rings, held = traced_mask(np.pad(values, np.array(around, dtype=int)))
    corner = np.array([seen.left - around[1][0], seen.top - around[0][0]])
    x, y = (corner + held.offset).tolist()
    mask = MaskWindow(held.coverage, (x, y), (height, width))
    border = (left - 0.5, top - 0.5, right - 0.5, bottom - 0.5)
    return ImageRegion(tuple(ring + corner for ring in rings), mask, border)


def box_before(scene: SyntheticScene, rng: np.random.Generator) -> Array:
    """The face (4, 3) of a box before the first region that hides the half of it that lies on a random side."""
    rings = scene.regions[0]
    frame = PlaneFrame.of_region(rings)
    flat = [frame.flat(ring) for ring in rings]
    angle = rng.uniform(0.0, 2.0 * np.pi)
    ahead = np.array([np.cos(angle), np.sin(angle)])
    aside = np.array([-ahead[1], ahead[0]])
    middle = frame.flat(region_centroid(rings)[None])[0]
    reach = 2.0 * float(max(np.linalg.norm(ring - middle, axis=1).max() for ring in flat))
    sides = [-reach * aside, reach * aside, reach * (aside + ahead), reach * (ahead - aside)]
    corners = frame.lifted(middle + np.array(sides))
    camera = Pose.from_parts(scene.rotation, scene.translation).camera_center
    face: Array = camera + BOX_DEPTH * (corners - camera)
    return face


def world_sides(
    scene: SyntheticScene, kept: Sequence[int], condition: Condition, rng: np.random.Generator, box: Array | None = None
) -> dict[int, WorldRegion]:
    """The world side of each region, by its number; a box (n, 3) may stand before them.

    A region that a lidar hits by one scan line has no outline, and one that it hits less no samples either: it is left
    out while there are others. ValueError says why none is left.
    """
    regions = [disturbed_rings(rings, condition, rng) for rings in scene.regions]
    if condition.lidar_beams is None:
        return {index: world_region(regions[index]) for index in kept}
    beams, noise = condition.lidar_beams, condition.range_noise_m
    lidar = SpinningLidar(beams, range_noise_m=noise, divergence_mrad=condition.divergence_mrad)
    offset = rng.uniform(-LIDAR_OFFSET_M, LIDAR_OFFSET_M, size=3)
    position = scene.rotation.T @ (offset - scene.translation)
    up = scene.rotation.T @ np.array([0.0, -1.0, 0.0])
    if condition.cut == "scanner":
        way = region_centroid(regions[0]) - position
        lidar = lidar.below(float(np.degrees(np.arcsin(way @ up / np.linalg.norm(way)))))
    scan = lidar_scan([*regions, *([] if box is None else [[box]])], position, rng, lidar, up=up)
    members = {index: mislabeled(scan, index, condition.mislabeled, rng) for index in kept}
    return scanned_regions(scan, members, condition.scan)


def disturbed_rings(rings: list[Array], condition: Condition, rng: np.random.Generator) -> list[Array]:
    """The rings of a world region as the condition disturbs them."""
    if condition.noise == 0.0 or condition.side == "2d":
        return rings
    if condition.disturbance == "occlusion":
        return occlude_region(rings, condition.noise, rng)
    side = square_side(condition.noise, float(np.linalg.norm(area_vector(rings))), condition.squares)
    return squares_on_region(rings, condition.noise, rng, side=side)


def scanned_regions(scan: LidarScan, members: Mapping[int, NDArray[np.intp]], known: Scan) -> dict[int, WorldRegion]:
    """Regions of a scan with these returns (k,), by number, but those hit too rarely; ValueError where all are."""
    worlds: dict[int, WorldRegion] = {}
    refused = None
    for index, own in members.items():
        try:
            if known == "samples":
                worlds[index] = WorldRegion.from_scan(scan.points, own, sensor_origin=scan.origin)
            else:
                worlds[index] = WorldRegion.from_points(scan.points[own], sensor_origin=scan.origin)
        except ValueError as error:
            refused = error
    if refused is not None and not worlds:
        raise refused
    return worlds


def world_region(rings: Sequence[Array]) -> WorldRegion:
    """The region of (n, 3) rings: outer ones, each followed by its holes, which turn the other way."""
    frame = PlaneFrame.of_region(rings)
    polygons: list[list[Array]] = []
    for ring in rings:
        if not polygons or shapely.LinearRing(frame.flat(ring)).is_ccw:
            polygons.append([])
        polygons[-1].append(ring)
    return WorldRegion.from_polygons(polygons)


def _image_change(true: Sequence[MaskPatch], given: Sequence[MaskPatch]) -> float:
    changed = sum(float(np.abs(t.values.astype(float) - g.values).sum()) for t, g in zip(true, given, strict=True))
    whole = sum(float(t.values.sum()) for t in true)
    return changed / whole if whole > 0.0 else float("nan")


def _world_change(rings: Sequence[Array], world: WorldRegion) -> float:
    frame = PlaneFrame.of_region(rings)
    return overlap_error([frame.flat(ring) for ring in world.rings], [frame.flat(ring) for ring in rings])
