"""Synthetic scenes: a camera, its true pose, and planar template regions that it sees whole.

The first plane's frame is the "first" world frame: its first region's centroid is the origin. Every other plane is
placed relative to it. A scene is a pure function of its arguments and one integer seed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, TypedDict, Unpack

import numpy as np
import shapely
from numpy.typing import NDArray
from regionpose.cameras import Camera
from scipy.spatial.transform import Rotation

from benchmarks.synthetic.masks import (
    Array,
    ProjectionError,
    area_coverage,
    binary_mask,
    image_size,
    project_region,
    to_camera,
)
from benchmarks.synthetic.planar import region_centroid, view_angle
from benchmarks.synthetic.setups import (
    PoseSource,
    Setup,
    any_rotation,
    fisheye_setup,
    omnidirectional_setup,
    perspective_setup,
    random_direction,
    turn_within,
)
from benchmarks.synthetic.templates import Template, TemplateSet, load_templates, polygon_template

WorldFrame = Literal["first", "arbitrary"]

PLANE_ANGLE_DEG = 30.0
# m; distance between the centroids of the first region and of another plane's, and of two regions on a plane.
PLANE_DISTANCE_M = (1.0, 2.0)
# m; each coordinate of an arbitrary world frame's origin is drawn from +- this, "a few meters".
WORLD_OFFSET_M = 5.0

# px; regions stay so far from the image border, so that a mask never touches it.
BORDER_MARGIN_PX = 2.0
# px; least gap between the images of two regions, so that their masks never touch.
REGION_GAP_PX = 4.0
# px; precision of the outlines that gaps and margins are checked with, well inside both.
OUTLINE_TOLERANCE_PX = 0.1
# deg; between a region's normal and the line of sight.
MAX_VIEW_ANGLE_DEG = 75.0
# m; every point lies so far before the camera's own plane z = 0, within the 180 deg field.
MIN_DEPTH_M = 0.05

POSE_TRIES = 2000
PLANE_TRIES = 40


class ScenePlacementError(ValueError):
    """No arrangement of the regions that fits the image was found."""


@dataclass(frozen=True)
class SyntheticScene:
    """One problem of the benchmark with its answer.

    `rotation` (3, 3), `translation` (3,): the true `camera_from_world`, `P = R X + t`, meters.
    `regions`: the rings, (n, 3) world meters, of each region; an outer ring first, counter-clockwise in the image when
    the region is seen from its front, holes the other way.
    `names`: the template of each region. `planes`: the index of the plane each region lies on.
    """

    camera: Camera
    rotation: Array
    translation: Array
    regions: list[list[Array]]
    names: list[str]
    planes: list[int]

    @cached_property
    def image_rings(self) -> list[list[Array]]:
        """The exact (m, 2) pixel rings of each region, densified where the camera bends edges."""
        return [project_region(self.camera, self.rotation, self.translation, rings) for rings in self.regions]

    @property
    def anchor(self) -> Array:
        """(3,) world point at which translation errors are taken: the first region's area centroid."""
        return region_centroid(self.regions[0])

    def masks(self) -> list[NDArray[np.bool_]]:
        """The (height, width) mask of each region: pixels whose center is inside."""
        return [binary_mask(rings, *image_size(self.camera)) for rings in self.image_rings]

    def coverages(self) -> list[Array]:
        """The (height, width) share in [0, 1] of each pixel's area that each region covers."""
        return [area_coverage(rings, *image_size(self.camera)) for rings in self.image_rings]

    def view_angles(self) -> Array:
        """(regions,) angle in degrees between line of sight and normal; above 90 a region is seen from behind."""
        return np.array([view_angle(rings, self.rotation, self.translation) for rings in self.regions])


def problem_generator(seed: int, study: str = "") -> np.random.Generator:
    """The random generator of one problem: the same for the same seed and study name, on any machine or worker."""
    if seed < 0:
        raise ValueError(f"seed is {seed}; it must be 0 or more")
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=tuple(study.encode())))


class LayoutOptions(TypedDict, total=False):
    """Fields of `Layout` beside the number of planes."""

    regions_per_plane: int
    templates: TemplateSet
    world: WorldFrame
    front: bool
    max_view_angle_deg: float


def perspective_scene(
    seed: int, planes: int = 1, *, study: str = "", **layout: Unpack[LayoutOptions]
) -> SyntheticScene:
    """A scene of the pinhole camera, 4 to 6 m away; `layout` as of `Layout`."""
    return setup_scene(perspective_setup(), Layout(planes, **layout), seed, study)


def omnidirectional_scene(
    seed: int, planes: int = 1, *, study: str = "", **layout: Unpack[LayoutOptions]
) -> SyntheticScene:
    """A scene of the polynomial fisheye of 180 deg field, 1 to 3 m away; `layout` as of `Layout`."""
    return setup_scene(omnidirectional_setup(), Layout(planes, **layout), seed, study)


def fisheye_scene(seed: int, planes: int = 1, *, study: str = "", **layout: Unpack[LayoutOptions]) -> SyntheticScene:
    """A scene of the equidistant fisheye at half the perspective distances; `layout` as of `Layout`."""
    return setup_scene(fisheye_setup(), Layout(planes, **layout), seed, study)


def setup_scene(setup: Setup, layout: Layout, seed: int, study: str = "") -> SyntheticScene:
    """The scene of a seed."""
    return draw_scene(setup.camera, setup.poses, layout, problem_generator(seed, study))


@dataclass(frozen=True)
class Layout:
    """What a scene holds.

    `planes`, `regions_per_plane`: counts. `templates`: the set that shapes are drawn from, without
    repetition while it lasts.
    `world`: "first" (the first plane's frame) or "arbitrary" (any rotation, the origin up to 5 m off along each axis).
    `front`: False turns each plane over with probability 1/2, so that it is seen from behind.
    `max_view_angle_deg`: no region is seen at a larger angle between its normal and the line of sight; from 75 to 90
    deg a 1 m region is but a few tens of pixels wide. `longer_side_m`: of random polygons; templates have 1 m.
    """

    planes: int = 1
    regions_per_plane: int = 1
    templates: TemplateSet = "all"
    world: WorldFrame = "first"
    front: bool = True
    max_view_angle_deg: float = MAX_VIEW_ANGLE_DEG
    longer_side_m: float = 1.0

    def __post_init__(self) -> None:
        """Check the counts and the name of the world frame."""
        for name in ("planes", "regions_per_plane"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} is {getattr(self, name)}; it must be 1 or more")
        if self.world not in ("first", "arbitrary"):
            raise ValueError(f'world frame is {self.world!r}; it must be "first" or "arbitrary"')


def draw_scene(camera: Camera, poses: PoseSource, layout: Layout, rng: np.random.Generator) -> SyntheticScene:
    """A random scene whose regions lie wholly in the image, apart from one another, none nearly edge-on.

    Poses and planes are drawn again until all fits; ScenePlacementError says what could not be placed.
    """
    shapes = _draw_templates(layout, rng)
    flips = [not layout.front and bool(rng.random() < 0.5) for _ in range(layout.planes)]
    furthest = 0
    for _ in range(POSE_TRIES):
        view = PosedCamera(camera, *poses.draw(rng), layout.max_view_angle_deg)
        placed = _place_all(view, shapes, flips, rng)
        if len(placed) == layout.planes:
            scene = _assembled(view, placed, shapes)
            return in_arbitrary_world(scene, rng) if layout.world == "arbitrary" else scene
        furthest = max(furthest, len(placed))
    raise ScenePlacementError(
        f"plane {furthest + 1} of {layout.planes} ({', '.join(t.name for t in shapes[furthest])}) could not be"
        f" placed at any of {POSE_TRIES} poses; fewer planes, fewer regions on a plane or a wider camera are needed"
    )


@dataclass(frozen=True)
class PosedCamera:
    """A camera at a pose, and the largest angle between normal and line of sight at which it sees a region well."""

    camera: Camera
    rotation: Array
    translation: Array
    max_view_angle_deg: float

    def outlines(self, regions: Sequence[list[Array]]) -> list[shapely.Polygon] | None:
        """The outer boundary of each region's image; None when one isn't wholly visible, in the image and well seen."""
        width, height = image_size(self.camera)
        edge = BORDER_MARGIN_PX - 0.5
        frame = shapely.box(edge, edge, width - 1 - edge, height - 1 - edge)
        if not all(self._well_seen(rings) and self._vertices_within(frame, rings) for rings in regions):
            return None
        outlines = []
        for rings in regions:
            try:
                outer = project_region(self.camera, self.rotation, self.translation, rings[:1], OUTLINE_TOLERANCE_PX)[0]
            except ProjectionError:
                return None
            outline = shapely.Polygon(outer)
            if not frame.contains(outline):
                return None
            outlines.append(outline)
        return outlines

    def _well_seen(self, rings: list[Array]) -> bool:
        depth = to_camera(rings[0], self.rotation, self.translation)[:, 2]
        angle = view_angle(rings, self.rotation, self.translation)
        return bool(depth.min() > MIN_DEPTH_M and min(angle, 180.0 - angle) < self.max_view_angle_deg)

    def _vertices_within(self, frame: shapely.Polygon, rings: list[Array]) -> bool:
        """Whether the outer ring's vertices fall in the frame: spares most misfits the costly outline."""
        pixels = self.camera.project(to_camera(rings[0], self.rotation, self.translation))
        left, top, right, bottom = frame.bounds
        return bool(((pixels >= (left, top)) & (pixels <= (right, bottom))).all())

    def sees_front(self, rings: list[Array]) -> bool:
        """Whether the front of a region faces the camera."""
        return view_angle(rings, self.rotation, self.translation) < 90.0


Placed = tuple[list[list[Array]], list[shapely.Polygon]]


def _draw_templates(layout: Layout, rng: np.random.Generator) -> list[tuple[Template, ...]]:
    """The templates of each plane."""
    count = layout.planes * layout.regions_per_plane
    if layout.templates == "polygons":
        drawn = [polygon_template(rng, layout.longer_side_m) for _ in range(count)]
        each = layout.regions_per_plane
        return [tuple(drawn[first : first + each]) for first in range(0, count, each)]
    pool = load_templates(layout.templates)
    rounds = [rng.permutation(len(pool)) for _ in range(-(-count // len(pool)))]
    picked = np.concatenate(rounds)[:count].reshape(layout.planes, layout.regions_per_plane)
    return [tuple(pool[i] for i in row) for row in picked.tolist()]


def _place_all(
    view: PosedCamera, shapes: list[tuple[Template, ...]], flips: list[bool], rng: np.random.Generator
) -> list[Placed]:
    """Planes placed one after the other at one pose, as many as fit."""
    placed: list[Placed] = []
    for index, (templates, flip) in enumerate(zip(shapes, flips, strict=True)):
        taken = [outline for _, outlines in placed for outline in outlines]
        plane = _place_plane(view, templates, flip, taken, index == 0, rng)
        if plane is None:
            break
        placed.append(plane)
    return placed


def _place_plane(
    view: PosedCamera,
    templates: tuple[Template, ...],
    flip: bool,
    taken: list[shapely.Polygon],
    first: bool,
    rng: np.random.Generator,
) -> Placed | None:
    """One plane's regions where they fit beside what is taken; None when no try does.

    The first plane is fixed by the pose, so it has more than one try only when it holds several regions.
    """
    for _ in range(PLANE_TRIES if not first or len(templates) > 1 else 1):
        rotation = np.eye(3) if first else turn_within(PLANE_ANGLE_DEG, rng)
        offset = np.zeros(3) if first else rng.uniform(*PLANE_DISTANCE_M) * random_direction(3, rng)
        if flip:
            rotation = rotation @ np.diag([1.0, -1.0, -1.0])
        regions = [[ring @ rotation.T + offset for ring in rings] for rings in _plane_regions(templates, rng)]
        outlines = view.outlines(regions)
        if outlines is None or any(view.sees_front(rings) == flip for rings in regions):
            continue
        if all_apart(outlines, taken):
            return regions, outlines
    return None


def _plane_regions(templates: tuple[Template, ...], rng: np.random.Generator) -> list[list[Array]]:
    """Regions in the plane z = 0: the first as drawn, the others moved by 1 to 2 m and turned within +-30 deg."""
    regions = [templates[0].region()]
    for template in templates[1:]:
        turn = Rotation.from_euler("z", rng.uniform(-PLANE_ANGLE_DEG, PLANE_ANGLE_DEG), degrees=True).as_matrix()
        offset = np.append(rng.uniform(*PLANE_DISTANCE_M) * random_direction(2, rng), 0.0)
        regions.append([ring @ turn.T + offset for ring in template.region()])
    return regions


def all_apart(outlines: list[shapely.Polygon], taken: list[shapely.Polygon]) -> bool:
    """Whether the new outlines keep the least gap from one another and from those already taken."""
    for i, outline in enumerate(outlines):
        others = taken + outlines[:i]
        if others and float(np.min(shapely.distance(outline, np.array(others)))) < REGION_GAP_PX:
            return False
    return True


def _assembled(view: PosedCamera, placed: list[Placed], shapes: list[tuple[Template, ...]]) -> SyntheticScene:
    """The scene of all placed planes, in the first plane's frame."""
    return SyntheticScene(
        camera=view.camera,
        rotation=view.rotation,
        translation=view.translation,
        regions=[rings for regions, _ in placed for rings in regions],
        names=[template.name for templates in shapes for template in templates],
        planes=[index for index, templates in enumerate(shapes) for _ in templates],
    )


def in_arbitrary_world(scene: SyntheticScene, rng: np.random.Generator) -> SyntheticScene:
    """The same scene with its world frame changed by any rotation and an offset up to 5 m along each axis."""
    turn = any_rotation(rng)
    offset = rng.uniform(-WORLD_OFFSET_M, WORLD_OFFSET_M, size=3)
    rotation = scene.rotation @ turn.T
    return replace(
        scene,
        rotation=rotation,
        translation=scene.translation - rotation @ offset,
        regions=[[ring @ turn.T + offset for ring in rings] for rings in scene.regions],
    )
