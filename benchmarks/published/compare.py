"""One problem through the published algorithm and through `regionpose`: the same masks, errors and times of each."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import regionpose as rp
from numpy.typing import NDArray

from benchmarks import published
from benchmarks.synthetic import (
    SyntheticScene,
    omnidirectional_scene,
    overlap_error,
    perspective_scene,
    problem_generator,
    squares_on_mask,
)
from benchmarks.synthetic.masks import ProjectionError, project_region
from benchmarks.synthetic.measures import rotation_error, translation_error
from benchmarks.synthetic.planar import even_odd_shape
from benchmarks.synthetic.templates import TemplateSet

MAKERS: dict[published.System, Callable[..., SyntheticScene]] = {
    "plane": perspective_scene,
    "sphere": omnidirectional_scene,
}


class Outcome(NamedTuple):
    """Rotation (deg), translation (m) and overlap error of an answer, seconds and evaluations it took."""

    rotation: float
    translation: float
    overlap: float
    seconds: float
    evaluations: float


def outcome(scene: SyntheticScene, poses: Sequence[rp.Pose], seconds: float, evaluations: int) -> Outcome:
    """The errors of the nearest of some poses."""
    pose = min(poses, key=lambda pose: rotation_error(pose.rotation.as_matrix(), scene.rotation))
    rotation = pose.rotation.as_matrix()
    shift = translation_error(rotation, pose.translation, scene.rotation, scene.translation, scene.anchor)
    turn = rotation_error(rotation, scene.rotation)
    return Outcome(turn, shift, scene_overlap_error(scene, pose), seconds, evaluations)


def scene_overlap_error(scene: SyntheticScene, pose: rp.Pose) -> float:
    """The paper's delta over all regions in pixels; infinite where a region leaves the view."""
    areas = np.array([even_odd_shape(rings).area for rings in scene.image_rings])
    try:
        predicted = [
            project_region(scene.camera, pose.rotation.as_matrix(), pose.translation, rings, tolerance=0.1)
            for rings in scene.regions
        ]
    except ProjectionError:
        return float("inf")
    deltas = [overlap_error(*sides) for sides in zip(predicted, scene.image_rings, strict=True)]
    return float(areas @ deltas / areas.sum())


class Problem(NamedTuple):
    """A scene and the masks that the methods get."""

    scene: SyntheticScene
    masks: list[NDArray[np.bool_]]


def drawn_problem(system: published.System, seed: int, planes: int, templates: TemplateSet, noise: float) -> Problem:
    """The problem of a seed, its masks disturbed by segmentation error of that share."""
    scene = MAKERS[system](seed, planes, templates=templates)
    rng = problem_generator(seed, "published")
    masks = scene.masks()
    return Problem(scene, [squares_on_mask(mask, noise, rng) for mask in masks] if noise else masks)


def outcomes(problem: Problem, system: published.System, start: published.Start) -> dict[str, Outcome]:
    """What each method makes of one problem."""
    found = {}
    for integration in (scheme[1] for scheme in published.SCHEMES if scheme[0] == system):
        found[f"published {integration}"], initial = published_outcome(problem, system, integration, start)
    found["regionpose"], found["regionpose any"] = package_outcomes(problem)
    found["regionpose native"], _ = package_outcomes(problem, driver="native")
    found["regionpose with start"], _ = package_outcomes(problem, prior=rp.Prior(initial=initial))
    return found


def published_outcome(
    problem: Problem, system: published.System, integration: published.Integration, start: published.Start
) -> tuple[Outcome, rp.Pose]:
    """What the published algorithm makes of a problem, and its initial pose."""
    scene, masks = problem
    begin = time.process_time()
    images = [rp.ImageRegion.from_mask(mask) for mask in masks]
    pose, info = published.estimate(
        scene.camera, images, scene.regions, system=system, integration=integration, start=start
    )
    return outcome(scene, [pose], time.process_time() - begin, info.evaluations), info.start


def package_outcomes(problem: Problem, **options: Any) -> tuple[Outcome, Outcome]:
    """What `regionpose` makes of a problem: its first answer, and the nearest to the truth."""
    scene, masks = problem
    begin = time.process_time()
    images = [rp.ImageRegion.from_mask(mask) for mask in masks]
    worlds = [rp.WorldRegion.from_polygon(rings) for rings in scene.regions]
    estimate = rp.estimate_pose(scene.camera, images, worlds, solver=rp.Solver(**options))
    seconds = time.process_time() - begin
    answers = [estimate.pose, *(other.pose for other in estimate.diagnostics.alternatives)]
    first, nearest = (
        outcome(scene, poses, seconds, estimate.diagnostics.evaluations) for poses in (answers[:1], answers)
    )
    return first, nearest
