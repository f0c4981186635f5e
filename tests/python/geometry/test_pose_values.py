"""Poses as values: equality, arrays, and what they are made of."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from regionpose import Pose


def test_poses_are_equal_by_value_and_arrays_of_their_matrix() -> None:
    pose = Pose.from_rotvec([0.1, -0.2, 0.3], [1.0, 2.0, 3.0])
    same = Pose.from_quat(-pose.rotation.as_quat(), [1.0, 2.0, 3.0])
    assert np.allclose(pose, same) and np.asarray(pose).shape == (4, 4)
    again = Pose.from_rotvec([0.1, -0.2, 0.3], [1.0, 2.0, 3.0])
    assert pose == again and hash(pose) == hash(again)
    assert pose != Pose.identity() and pose != "pose" and np.allclose(Pose.identity() @ pose, pose)
    assert Pose.from_matrix(pose) == Pose.from_matrix(pose.matrix)
    with pytest.raises(TypeError):
        np.zeros((5, 4)) @ pose


def test_a_rotation_vector_is_that_of_opencv() -> None:
    rotvec, translation = np.array([[0.3], [-0.5], [0.2]]), np.array([[1.0], [2.0], [3.0]])
    pose = Pose.from_rotvec(rotvec, translation)
    assert np.allclose(pose.rotation_matrix, cv2.Rodrigues(rotvec)[0], atol=1e-15)
    assert pose.translation.tolist() == [1.0, 2.0, 3.0]


@pytest.mark.parametrize(("norm", "fits"), [(1.0009, True), (0.9991, True), (1.01, False)])
def test_a_quaternion_of_three_digits_is_brought_to_the_norm_one(norm: float, fits: bool) -> None:
    quat = norm * np.array([0.5, 0.5, 0.5, 0.5])
    if fits:
        assert Pose.from_quat(quat, np.zeros(3)) == Pose.from_quat(quat / norm, np.zeros(3))
    else:
        with pytest.raises(ValueError, match="norm"):
            Pose.from_quat(quat, np.zeros(3))
