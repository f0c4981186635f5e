"""Problems with what users get wrong, of random polygons whose corners were marked by hand."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from regionpose.cameras import Camera
from regionpose.regions.image import ImageRegion

from benchmarks.synthetic.noise import MiscalibratedCamera, another_shape
from benchmarks.synthetic.planar import PlaneFrame, region_centroid
from benchmarks.synthetic.scenes import Layout, draw_scene, problem_generator
from benchmarks.synthetic.setups import GrazingPoses, PoseSource, Setup
from benchmarks.synthetic.studies.conditions import Condition, Mistake
from benchmarks.synthetic.studies.drawn import CAREFUL_CORNER_PX, ROUGH_CORNER_PX, Errors, by_hand, drawn_region
from benchmarks.synthetic.studies.problems import StudyProblem, world_region
from benchmarks.synthetic.templates import polygon_template

Array = NDArray[np.float64]

PLANES: dict[Mistake, tuple[int, ...]] = {
    "frontal": (1,),
    "mirrored": (2, 3, 4),
    "swapped-2": (2,),
    "swapped-3": (3,),
    "swapped-4": (4,),
    "replaced": (3,),
}
ANY_PLANES = (1, 2, 3, 4)
"""Planes of one region each, by mistake: a mirrored region alone is a right one seen from behind."""

FRONTAL_DEG = 8.0
"""Largest angle between normal and line of sight of a plane that is seen nearly from the front."""

SIDES_M = (0.15, 1.0)
"""Longer sides of regions, drawn by their logarithm: 60 to 400 px in the pinhole camera, 30 to 200 in the fisheye."""

SMALL_PX = (16.0, 60.0)
"""Longer sides of small regions, whose corners are whole pixels, at the middle distance."""

FOCAL_ERROR = 0.03
"""Share by which a focal length is too long or too short."""


def draw_mistaken_problem(setup: Setup, condition: Condition, seed: int) -> StudyProblem:
    """The problem of a seed with the condition's mistake; no two mistakes or cameras have a scene in common."""
    mistake = condition.mistake
    rng = problem_generator(seed, f"{condition.camera} {mistake}")
    planes = int(rng.choice(PLANES.get(mistake, ANY_PLANES)))
    side = small_side_m(setup, rng) if mistake == "rounded" else float(np.exp(rng.uniform(*np.log(SIDES_M))))
    layout = Layout(planes, templates="polygons", world="arbitrary", front=False, longer_side_m=side)
    scene = draw_scene(setup.camera, _poses(setup, mistake, rng), layout, rng)
    errors = corner_errors(mistake, rng)
    images = [drawn_region(scene, rings, errors) for rings in scene.regions]
    known, wrong = _mistaken(scene.regions, mistake, rng)
    seen = _exchanged(images, wrong) if mistake.startswith("swapped") else images
    worlds = [world_region(rings) for rings in known]
    camera = _given_camera(setup.camera, mistake, rng)
    every = list(range(planes))
    return StudyProblem(scene, camera, seen, worlds, every, 0.0, 0.0, wrong, drawn={"planes": planes})


def small_side_m(setup: Setup, rng: np.random.Generator) -> float:
    """Length that is seen as a small region's at the middle distance."""
    near = setup.camera.project(np.array([[0.0, 0.0, 1.0], [1e-3, 0.0, 1.0]]))
    pixels_per_rad = float(np.linalg.norm(near[1] - near[0])) / 1e-3
    return float(rng.uniform(*SMALL_PX) * np.mean(setup.poses.depth) / pixels_per_rad)


def _poses(setup: Setup, mistake: Mistake, rng: np.random.Generator) -> PoseSource:
    if mistake != "frontal":
        return setup.poses
    return GrazingPoses(setup.poses, 90.0 - rng.uniform(0.0, FRONTAL_DEG))


def _mistaken(
    regions: list[list[Array]], mistake: Mistake, rng: np.random.Generator
) -> tuple[list[list[Array]], tuple[int, ...]]:
    """The regions as they are believed to be in the world, and places of those whose pair is wrong."""
    count = {"mirrored": 1, "replaced": 2}.get(mistake, 2 if mistake.startswith("swapped") else 0)
    wrong = tuple(sorted(rng.permutation(len(regions))[:count].tolist()))
    changed = list(regions)
    for place in wrong:
        if mistake == "mirrored":
            changed[place] = mirrored(regions[place], rng)
        elif mistake == "replaced":
            changed[place] = another_shape(regions[place], polygon_template(rng).region(), rng)
    return changed, wrong


def mirrored(rings: list[Array], rng: np.random.Generator) -> list[Array]:
    """(n, 3) rings of a planar region mirrored in its plane about a line through its centroid, turning as before."""
    frame = PlaneFrame.of_region(rings)
    center = frame.flat(region_centroid(rings)[None])
    angle = rng.uniform(0.0, np.pi)
    axis = np.array([np.cos(angle), np.sin(angle)])
    mirror = 2.0 * np.outer(axis, axis) - np.eye(2)
    return [frame.lifted((frame.flat(ring) - center) @ mirror + center)[::-1] for ring in rings]


def _exchanged(images: list[ImageRegion], places: tuple[int, ...]) -> list[ImageRegion]:
    first, second = places
    seen = list(images)
    seen[first], seen[second] = images[second], images[first]
    return seen


def corner_errors(mistake: Mistake, rng: np.random.Generator) -> Errors:
    """Errors of corners that are marked with the mistake."""
    if mistake == "rounded":
        return lambda corners: np.round(corners) - corners
    return by_hand(rng, ROUGH_CORNER_PX if mistake == "rough" else CAREFUL_CORNER_PX)


def _given_camera(camera: Camera, mistake: Mistake, rng: np.random.Generator) -> Camera:
    if mistake != "focal":
        return camera
    return MiscalibratedCamera(camera, 1.0 + FOCAL_ERROR * float(rng.choice((-1.0, 1.0))), np.zeros(2))
