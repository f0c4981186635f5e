"""Rigid poses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]

ORTHONORMAL_TOLERANCE = 1e-6
"""How far a rotation matrix may be from orthonormal, as the largest entry of `R^T R - I`."""


@dataclass(frozen=True, eq=False)
class Pose:
    """The pose `camera_from_world`: `x_camera = rotation * x_world + translation`.

    Camera axes: x right, y down, z along the optical axis. `translation`: (3,), in the world's unit.
    """

    rotation: Rotation
    translation: Array

    def __post_init__(self) -> None:
        """Check and copy the parts."""
        if not isinstance(self.rotation, Rotation) or not self.rotation.single:
            raise ValueError(
                f"rotation is {type(self.rotation).__name__}; needed one scipy Rotation (or use from_matrix)"
            )
        translation = _real_numbers("translation", self.translation)
        if translation.shape != (3,) or not np.isfinite(translation).all():
            raise ValueError(f"translation is {self.translation!r}; needed 3 finite numbers")
        object.__setattr__(self, "translation", translation)

    @classmethod
    def of_quaternion(cls, quat_xyzw: Array, translation: Array) -> Pose:
        """The pose of a unit quaternion (4,) and a translation (3,) that are known to be right.

        Making the `Rotation` takes scipy longer than all else that is made of a result: it waits until it is asked for.
        """
        pose = object.__new__(cls)
        object.__setattr__(pose, "_quat_xyzw", quat_xyzw)
        object.__setattr__(pose, "translation", translation)
        return pose

    if not TYPE_CHECKING:  # To a type checker every name would be an attribute.

        def __getattr__(self, name: str) -> Rotation:
            """The rotation of a quaternion, when it is first asked for."""
            if name != "rotation" or "_quat_xyzw" not in self.__dict__:
                raise AttributeError(f"{type(self).__name__} has no attribute {name!r}")
            object.__setattr__(self, "rotation", Rotation.from_quat(self.__dict__["_quat_xyzw"]))
            return self.rotation

    @classmethod
    def from_matrix(cls, matrix: ArrayLike) -> Pose:
        """The pose of a (4, 4) or (3, 4) matrix `[R t]`; ValueError unless R is a rotation to 1e-6."""
        given = _real_numbers("pose matrix", matrix)
        if given.shape not in {(4, 4), (3, 4)} or not np.isfinite(given).all():
            raise ValueError(f"pose matrix has shape {given.shape}; needed (4, 4) or (3, 4) finite numbers")
        if given.shape == (4, 4) and given[3].tolist() != [0.0, 0.0, 0.0, 1.0]:
            raise ValueError(f"pose matrix has the last row {given[3].tolist()}; needed [0, 0, 0, 1]")
        return cls.from_parts(given[:3, :3], given[:3, 3])

    @classmethod
    def from_parts(cls, rotation: ArrayLike, translation: ArrayLike) -> Pose:
        """The pose of a (3, 3) rotation matrix and a (3,) translation."""
        given = _real_numbers("rotation", rotation)
        if given.shape != (3, 3) or not np.isfinite(given).all():
            raise ValueError(f"rotation has shape {given.shape}; needed (3, 3) finite numbers")
        defect = float(np.abs(given.T @ given - np.eye(3)).max())
        if defect > ORTHONORMAL_TOLERANCE or np.linalg.det(given) < 0.0:
            raise ValueError(
                f"rotation has |R^T R - I| = {defect:.1e}, det = {np.linalg.det(given):.3f}; needed a rotation"
            )
        return cls(Rotation.from_matrix(given), _real_numbers("translation", translation))

    @property
    def matrix(self) -> Array:
        """The (4, 4) matrix that takes homogeneous world points to the camera."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.rotation.as_matrix()
        matrix[:3, 3] = self.translation
        return matrix

    @property
    def camera_center(self) -> Array:
        """The camera's centre in the world, (3,)."""
        return -self.rotation.as_matrix().T @ self.translation

    def inverse(self) -> Pose:
        """`world_from_camera`."""
        return Pose(self.rotation.inv(), self.camera_center)

    def transform(self, points: ArrayLike) -> Array:
        """Points (n, 3) or (3,) of the world in camera coordinates; ValueError for another shape."""
        given = _real_numbers("points", points)
        if given.ndim not in {1, 2} or given.shape[-1] != 3:
            raise ValueError(f"points have shape {given.shape}; needed (n, 3) or (3,)")
        return given @ self.rotation.as_matrix().T + self.translation

    def __repr__(self) -> str:
        """Rotation vector in degrees and translation, to six digits."""
        turn = np.array2string(self.rotation.as_rotvec(degrees=True), precision=6)
        return f"Pose(rotation_vector_deg={turn}, translation={np.array2string(self.translation, precision=6)})"


def _real_numbers(item: str, values: ArrayLike) -> Array:
    try:
        given = np.asarray(values)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{item} is not an array; needed real numbers") from error
    if given.dtype.kind not in "iuf":
        raise ValueError(f"{item} has type {given.dtype}; needed real numbers")
    return given.astype(np.float64)
