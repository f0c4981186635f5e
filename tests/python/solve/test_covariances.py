"""Covariances of an estimate in other conventions, against samples pushed through the definitions."""

from __future__ import annotations

import numpy as np
import pytest
import regionpose as rp
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

POSE = rp.Pose(Rotation.from_rotvec([0.4, -0.7, 0.2]), np.array([0.5, -2.0, 7.0]))
SCALES = 1e-5 * np.array([1.0, 2.0, 0.5, 3.0, 1.0, 2.0])
MIX = np.random.default_rng(3).normal(size=(6, 6))
COVARIANCE = (SCALES[:, None] * MIX) @ (SCALES[:, None] * MIX).T
ALTERNATIVE = rp.solve.Alternative(POSE, COVARIANCE, 0.9, 0.9, 0.01, np.zeros(1))


def ros_coordinates(pose: rp.Pose, origin: rp.Pose) -> NDArray[np.float64]:
    """Differences of the translation and of the rotation about fixed axes."""
    turn = (pose.rotation * origin.rotation.inv()).as_rotvec()
    return np.concatenate([pose.translation - origin.translation, turn])


@pytest.mark.parametrize("of_inverse", [False, True])
def test_convention_a_ros_covariance_is_of_the_translation_and_of_turns_about_fixed_axes(of_inverse: bool) -> None:
    origin = POSE.inverse() if of_inverse else POSE
    ends = [POSE.retract(column) for column in np.linalg.cholesky(COVARIANCE).T]
    moved = [ros_coordinates(end.inverse() if of_inverse else end, origin) for end in ends]
    expected = sum(np.outer(each, each) for each in moved)
    found = ALTERNATIVE.covariance_in_ros_order(of_inverse=of_inverse)
    assert found == pytest.approx(np.asarray(expected), rel=1e-3, abs=1e-3 * float(np.abs(expected).max()))


def test_the_covariance_of_the_inverse_is_of_its_left_increment() -> None:
    ends = [POSE.retract(column) for column in np.linalg.cholesky(COVARIANCE).T]
    moved = [POSE.inverse().local_coordinates(end.inverse()) for end in ends]
    expected = np.asarray(sum(np.outer(each, each) for each in moved))
    assert ALTERNATIVE.covariance_of_inverse() == pytest.approx(expected, rel=1e-3, abs=1e-3 * np.abs(expected).max())
