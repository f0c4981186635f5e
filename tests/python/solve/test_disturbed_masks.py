"""Masks whose whole boundary is disturbed: no pose is worse than that of the moments alone."""

from __future__ import annotations

import numpy as np
import pytest
import regionpose as rp
from numpy.typing import NDArray

from benchmarks.synthetic import noise, perspective_scene, pose_errors, problem_generator
from benchmarks.synthetic.scenes import SyntheticScene

COATS = 6.0
"""How often each place of the boundary is painted over: a share of e^-6 is left."""

SCENES = 6

WORSE = 1.05
"""How much worse than the moments' a pose may be: what is left of its last iterations."""


def painted(mask: NDArray[np.bool_], side_share: float, rng: np.random.Generator) -> NDArray[np.bool_]:
    """The mask after squares of a share of its size were painted in and out along its boundary, one over another."""
    side = noise.square_side(0.0, float(mask.sum()), side_share)
    boundary = noise.mask_boundary(mask)
    length = sum(float(np.hypot(*(np.roll(ring, -1, axis=0) - ring).T).sum()) for ring in boundary)
    squares = noise.squares_along(boundary, side, rng)
    changed = mask.copy()
    count = int(COATS * length / side)
    for center, adds in zip(squares.centers[:count], squares.adds[:count], strict=True):
        (left, top), (right, bottom) = (np.ceil(center + sign * 0.5 * side).astype(int) for sign in (-1.0, 1.0))
        changed[top:bottom, left:right] = adds
    return changed


def rotation_error(scene: SyntheticScene, masks: list[NDArray[np.bool_]], solver: rp.Solver) -> float:
    """Degrees by which the estimate of a scene from such masks is turned from the true pose."""
    images = [rp.ImageRegion.from_mask(mask) for mask in masks]
    worlds = [rp.WorldRegion.from_polygon(rings) for rings in scene.regions]
    pose = rp.estimate_pose(scene.camera, images, worlds, solver=solver).pose
    turn, place = pose.rotation.as_matrix(), pose.translation
    return pose_errors(turn, place, scene.rotation, scene.translation, scene.anchor).rotation_deg


@pytest.mark.parametrize("side_share", [1.0 / 30.0, 1.0 / 16.0])
def test_where_all_of_a_boundary_is_disturbed_no_pose_is_worse_than_the_moments(side_share: float) -> None:
    errors = []
    for seed in range(SCENES):
        scene, rng = perspective_scene(seed, 3), problem_generator(seed, "painted")
        masks = [painted(mask, side_share, rng) for mask in scene.masks()]
        errors.append([rotation_error(scene, masks, rp.Solver(refine=refine)) for refine in ("contour", None)])
    by_default, by_moments = np.array(errors).T
    assert (by_default <= WORSE * by_moments).all(), errors
