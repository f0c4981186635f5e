"""The published algorithm beside `regionpose.estimate_pose` on the very same scenes, in one run.

Scenes are the paper's: the world's frame is the first region's; binary masks, squares along the boundary changing the
share `--noise` of their area; perspective camera for the plane's system, fisheye of 180 deg for the sphere's. The
published algorithm starts from its own initial pose, which takes the seen side as known and the in-plane turn as small;
`regionpose` knows nothing of the pose, and a row each says what it does with the published start handed to it and with
its native driver. Of its answers to a symmetric shape the first counts, or in "any" the nearest of all.
Solved: rotation < 1 deg and delta < 5 %. Times: of the processor, from masks to pose; numpy and scipy drive the
published equations, compiled code ours. The ratio is of the medians, `regionpose` over the method of the line.

    OMP_NUM_THREADS=1 python -m benchmarks.published [--scenes 100] [--planes 1 2 3] [--templates all] [--noise 0]
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
import regionpose as rp
from numpy.typing import NDArray
from regionpose.evaluation import (
    Scene,
    is_solved,
    omnidirectional_scene,
    overlap_error,
    perspective_scene,
    problem_generator,
    squares_on_mask,
)
from regionpose.evaluation.masks import ProjectionError, project_region
from regionpose.evaluation.measures import rotation_error, translation_error
from regionpose.evaluation.planar import even_odd_shape
from regionpose.evaluation.templates import TemplateSet

from benchmarks import published

MAKERS: dict[published.System, Callable[..., Scene]] = {
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


def outcome(scene: Scene, poses: Sequence[rp.Pose], seconds: float, evaluations: int) -> Outcome:
    """The errors of the nearest of some poses."""
    pose = min(poses, key=lambda pose: rotation_error(pose.rotation.as_matrix(), scene.rotation))
    rotation = pose.rotation.as_matrix()
    shift = translation_error(rotation, pose.translation, scene.rotation, scene.translation, scene.anchor)
    turn = rotation_error(rotation, scene.rotation)
    return Outcome(turn, shift, scene_overlap_error(scene, pose), seconds, evaluations)


def scene_overlap_error(scene: Scene, pose: rp.Pose) -> float:
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

    scene: Scene
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
    found["regionpose with start"], _ = package_outcomes(problem, initial=initial)
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
    estimate = rp.estimate_pose(scene.camera, images, worlds, **options)
    seconds = time.process_time() - begin
    answers = [estimate.pose, *estimate.alternatives]
    first, nearest = (outcome(scene, poses, seconds, estimate.evaluations) for poses in (answers[:1], answers))
    return first, nearest


HEADER = (
    f"{'system':7} {'planes':6} {'method':22} {'solved':>6}  {'rotation deg':>22}  {'translation mm':>20}"
    f"  {'solved ones: deg, mm':>20}  {'equations':>9}  {'ms':>8}  {'ratio':>6}"
)


def line(name: str, outcomes: Sequence[Outcome], ours: float) -> str:
    """Medians (95 %) of one method, medians over what it solved, its time and the ratio of `ours` (ms) to it."""
    rotation, translation, overlap, seconds, evaluations = np.array(outcomes).T
    solved = is_solved(rotation, overlap)
    among = f"{np.median(rotation[solved]):.4f}, {1e3 * np.median(translation[solved]):.2f}" if solved.any() else "-"
    time_ms = 1e3 * np.median(seconds)
    return (
        f"{name:22} {100 * solved.mean():5.0f}%"
        f"  {np.median(rotation):10.4f} ({np.percentile(rotation, 95):9.3f})"
        f"  {1e3 * np.median(translation):9.2f} ({1e3 * np.percentile(translation, 95):8.1f})  {among:>20}"
        f"  {np.median(evaluations):9.0f}  {time_ms:8.1f}  {ours / time_ms:6.3f}"
    )


def print_rows(system: published.System, planes: int, problems: Iterable[Problem], start: published.Start) -> None:
    """A line for each method on the same problems."""
    rows = [outcomes(problem, system, start) for problem in problems]
    ours = 1e3 * float(np.median([row["regionpose"].seconds for row in rows]))
    for name in rows[0]:
        print(f"{system:7} {planes:6} " + line(name, [row[name] for row in rows], ours), flush=True)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=100)
    parser.add_argument("--planes", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--systems", choices=list(MAKERS), nargs="+", default=list(MAKERS))
    parser.add_argument("--templates", choices=["all", "asymmetric", "symmetric"], default="all")
    parser.add_argument("--noise", type=float, default=0.0, help="share of each mask that segmentation error changes")
    parser.add_argument("--start", choices=["parallel", "turned"], default="parallel")
    arguments = parser.parse_args()
    if os.environ.get("OMP_NUM_THREADS") != "1":
        print("OMP_NUM_THREADS isn't 1: times may be of several threads")
    print(HEADER)
    for system in arguments.systems:
        for planes in arguments.planes:
            problems = (
                drawn_problem(system, seed, planes, arguments.templates, arguments.noise)
                for seed in range(arguments.scenes)
            )
            print_rows(system, planes, problems, arguments.start)


if __name__ == "__main__":
    main()
