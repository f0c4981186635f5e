"""How well a pose can be known from the boundary that nothing disturbed, as a yardstick for errors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from regionpose import _core
from regionpose.cameras import Camera
from regionpose.geometry.pose import Pose
from regionpose.solve.contours import (
    Contours,
    contours_of,
    distance_derivatives,
    distances_of,
    outline_derivatives,
)
from scipy.spatial.transform import Rotation

from benchmarks.synthetic.studies.problems import StudyProblem, world_region

Array = NDArray[np.float64]

UNDISTURBED_PX = 0.6
"""Distance from the true outline's image up to which a piece of contour is undisturbed: rounding to pixels moves it by
half a pixel at the most."""

SAME_OUTLINE_PX = 0.05
"""Distance between the true and the given outline's image up to which they are the same there: twice what split edges
may miss a curve by."""


@dataclass(frozen=True)
class PoseBound:
    """Least root-mean-square errors: of the rotation in degrees, of the translation at the first region in meters.

    Infinite where the undisturbed boundary leaves a direction free.
    """

    rotation_deg: float
    translation_m: float


def pose_bound(problem: StudyProblem) -> PoseBound:
    """The bound of a problem's errors by the pieces of its observed contours that nothing disturbed.

    At the true pose each piece has a distance from the true outline, and these scatter with the variance `s^2`; were
    they independent, no unbiased linear estimate could have a smaller covariance than `s^2 (sum of J^T J)^-1` (Gauss
    and Markov), J being the derivatives by the left increment.
    """
    distances, jacobian = undisturbed_pieces(problem)
    information = jacobian.T @ jacobian
    if len(distances) <= 6 or np.linalg.matrix_rank(information * scales(information)) < 6:
        return PoseBound(float("inf"), float("inf"))
    covariance = np.mean(distances**2) * np.linalg.inv(information)
    at_anchor = anchor_shift(problem)
    turn, shift = np.trace(covariance[:3, :3]), np.trace(at_anchor @ covariance @ at_anchor.T)
    return PoseBound(float(np.degrees(np.sqrt(turn))), float(np.sqrt(shift)))


def scales(matrix: Array) -> Array:
    """(n, n) factors that give a matrix (n, n) a diagonal of ones, where it has any."""
    diagonal = np.diag(matrix)
    root = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    factors: Array = 1.0 / np.outer(root, root)
    return factors


def anchor_shift(problem: StudyProblem) -> Array:
    """(3, 6) derivatives of the scene's anchor in the camera's frame by the left increment `[omega, tau]`."""
    x, y, z = problem.scene.rotation @ problem.scene.anchor + problem.scene.translation
    by_turn = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])
    return np.hstack([by_turn, np.eye(3)])


def undisturbed_pieces(problem: StudyProblem) -> tuple[Array, Array]:
    """Distances (m,) in px of undisturbed pieces from the true outline at the true pose, and derivatives (m, 6).

    Those of a wrong region aren't among them.
    """
    scene = problem.scene
    pose = Pose(Rotation.from_matrix(scene.rotation), scene.translation)
    right = [place for place in range(len(problem.kept)) if place not in problem.wrong]
    if not right:
        return np.zeros(0), np.zeros((0, 6))
    images = [problem.image_regions[place] for place in right]
    true = contours_of(
        scene.camera, images, [world_region(scene.regions[problem.kept[place]]) for place in right], pose
    )
    given = contours_of(scene.camera, images, [problem.world_regions[place] for place in right], pose)
    distances, others = distances_of(scene.camera, true, pose), distances_of(scene.camera, given, pose)
    if distances is None or others is None:
        return np.zeros(0), np.zeros((0, 6))
    clean = np.abs(distances.values) < UNDISTURBED_PX
    # Without their signs: a plane's side, and with it the turn of its rings, is not the same for both.
    clean &= np.abs(np.abs(distances.values) - np.abs(others.values)) < SAME_OUTLINE_PX
    jacobian = distance_derivatives(true, distances, _by_increment(scene.camera, pose, true))
    return distances.values[clean], jacobian[clean]


def _by_increment(camera: Camera, pose: Pose, contours: Contours) -> Array:
    """Derivatives (v, 2, 6) of the projected vertices by the left increment, rad and meters."""
    distance = float(np.linalg.norm(pose.transform(contours.vertices).mean(axis=0)))
    unit = np.array([1.0, 1.0, 1.0, distance, distance, distance])

    def view(at: Array) -> tuple[Camera, Pose]:
        moved = _core.retract_pose(pose.rotation.as_matrix(), pose.translation, at * unit)
        return camera, Pose.from_parts(*moved)

    derivatives: Array = outline_derivatives(view, np.zeros(6), contours) / unit
    return derivatives
