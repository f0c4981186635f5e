"""Rigid poses."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from regionpose.validation.arguments import checked_arguments
from regionpose.validation.arrays import Array, KeptArrays, finite_array, read_only, real_array

if TYPE_CHECKING:
    from scipy.spatial.transform import RigidTransform, Rotation


UNIT_TOLERANCE = 1e-6
"""How far a rotation matrix may be from orthonormal, as the largest entry of `R^T R - I`: what six digits in a file
leave."""

NORM_TOLERANCE = 1e-3
"""How far a quaternion's norm may be from 1: what three digits leave. Its direction alone counts, unlike a matrix's."""


@dataclass(frozen=True, eq=False)
class Pose(KeptArrays):
    """The pose `camera_from_world`: `x_camera = rotation * x_world + translation`.

    Camera axes: x right, y down, z along the optical axis.

    Parameters
    ----------
    rotation : scipy.spatial.transform.Rotation
        One rotation, from world to camera axes.
    translation : (3,) array
        The world's origin in the camera's frame, in the world's unit (meters, as a rule); kept read-only.

    Raises
    ------
    ValueError
        For several rotations, or a translation that isn't three finite numbers.

    Examples
    --------
    >>> import regionpose as rp
    >>> pose = rp.Pose.from_quat([0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 2.0])
    >>> (pose @ [0.5, 0.0, 1.0]).tolist()
    [0.5, 0.0, 3.0]
    >>> (pose.inverse() @ pose).translation.tolist()
    [0.0, 0.0, 0.0]

    """

    rotation: Rotation
    translation: Array

    def __post_init__(self) -> None:
        """Check and copy the parts."""
        from scipy.spatial.transform import Rotation

        if not isinstance(self.rotation, Rotation) or not self.rotation.single:
            raise ValueError(
                f"rotation is {type(self.rotation).__name__}; needed one scipy Rotation (or use from_matrix, from_quat)"
            )
        object.__setattr__(self, "translation", _translation(self.translation))

    @classmethod
    def of_quaternion(cls, quat_xyzw: Array, translation: Array) -> Pose:
        """The pose of a unit quaternion (4,) and a translation (3,) that are known to be right.

        Making the `Rotation` takes scipy longer than all else that is made of a result: it is made on first use.
        """
        pose = object.__new__(cls)
        object.__setattr__(pose, "_quat_xyzw", read_only(quat_xyzw))
        object.__setattr__(pose, "translation", read_only(translation))
        return pose

    if not TYPE_CHECKING:  # To a type checker every name would be an attribute.

        def __getattr__(self, name: str) -> Rotation:
            """The rotation of a quaternion, made on first use."""
            if name != "rotation" or "_quat_xyzw" not in self.__dict__:
                raise AttributeError(f"{type(self).__name__} has no attribute {name!r}")
            from scipy.spatial.transform import Rotation

            object.__setattr__(self, "rotation", Rotation.from_quat(self.__dict__["_quat_xyzw"]))
            return self.rotation

    @classmethod
    def from_matrix(cls, matrix: ArrayLike) -> Pose:
        """The pose of a matrix `[R t]`.

        Parameters
        ----------
        matrix : (4, 4) or (3, 4) array
            Takes homogeneous world points to the camera.

        Raises
        ------
        ValueError
            For another shape or last row, and unless R is a rotation to 1e-6.

        Examples
        --------
        >>> import numpy as np, regionpose as rp
        >>> rp.Pose.from_matrix(np.eye(4)).translation.tolist()
        [0.0, 0.0, 0.0]

        """
        given = finite_array(matrix, "pose matrix", (4, 4), (3, 4))
        if given.shape == (4, 4) and given[3].tolist() != [0.0, 0.0, 0.0, 1.0]:
            raise ValueError(f"pose matrix has the last row {given[3].tolist()}; needed [0, 0, 0, 1]")
        return cls.from_parts(given[:3, :3], given[:3, 3])

    @classmethod
    def from_parts(cls, rotation: ArrayLike, translation: ArrayLike) -> Pose:
        """The pose of a rotation matrix and a translation.

        Parameters
        ----------
        rotation : (3, 3) array
            From world to camera axes.
        translation : (3,) array
            In the world's unit.

        Raises
        ------
        ValueError
            For other shapes, numbers that are not finite, and unless it is a rotation to 1e-6.

        """
        from scipy.spatial.transform import Rotation

        given = finite_array(rotation, "rotation", (3, 3))
        defect = float(np.abs(given.T @ given - np.eye(3)).max())
        if defect > UNIT_TOLERANCE or np.linalg.det(given) < 0.0:
            raise ValueError(
                f"rotation has |R^T R - I| = {defect:.1e}, det = {np.linalg.det(given):.3f}; needed a rotation"
            )
        return cls(Rotation.from_matrix(given), _translation(translation))

    @classmethod
    def from_quat(cls, quat_xyzw: ArrayLike, translation: ArrayLike) -> Pose:
        """The pose of a quaternion and a translation.

        Parameters
        ----------
        quat_xyzw : (4,) array
            From world to camera axes, the real part last, as scipy and ROS have it; brought to the norm 1.
        translation : (3,) array
            In the world's unit.

        Raises
        ------
        ValueError
            For other shapes, numbers that are not finite, and unless the norm is 1 to 1e-3.

        """
        given = finite_array(quat_xyzw, "quaternion", (4,))
        norm = float(np.linalg.norm(given))
        if abs(norm - 1.0) > NORM_TOLERANCE:
            raise ValueError(f"quaternion has norm {norm:.6g}; needed 1")
        return cls.of_quaternion(given / norm, _translation(translation))

    @classmethod
    def from_rotvec(cls, rotvec_rad: ArrayLike, translation: ArrayLike) -> Pose:
        """The pose of a rotation vector and a translation, as of `cv2.solvePnP` and `cv2.Rodrigues`.

        Parameters
        ----------
        rotvec_rad : (3,) or (3, 1) array
            Axis times angle, radians, from world to camera axes.
        translation : (3,) or (3, 1) array
            In the world's unit.

        Raises
        ------
        ValueError
            For other shapes and numbers that are not finite.

        Examples
        --------
        >>> import regionpose as rp
        >>> rp.Pose.from_rotvec([0.0, 0.0, 0.0], [1.0, 2.0, 3.0]).translation.tolist()
        [1.0, 2.0, 3.0]

        """
        from scipy.spatial.transform import Rotation

        given = finite_array(rotvec_rad, "rotation vector", (3,), (3, 1))
        moved = finite_array(translation, "translation", (3,), (3, 1))
        return cls(Rotation.from_rotvec(given.ravel()), _translation(moved.ravel()))

    @classmethod
    def identity(cls) -> Pose:
        """The pose of a camera at the world's origin, along the world's axes."""
        return cls.of_quaternion(np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(3))

    @classmethod
    def from_rigid_transform(cls, transform: RigidTransform) -> Pose:
        """The pose of one scipy `RigidTransform` (scipy 1.16 and newer); ValueError for several."""
        if not getattr(transform, "single", False):
            raise ValueError(f"transform is {type(transform).__name__}; needed one scipy RigidTransform")
        return cls(transform.rotation, transform.translation)

    def as_rigid_transform(self) -> RigidTransform:
        """The pose as scipy's `RigidTransform`; ImportError with scipy before 1.16, which has none."""
        from scipy.spatial.transform import RigidTransform

        return RigidTransform.from_components(self.translation, self.rotation)

    @cached_property
    def rotation_matrix(self) -> Array:
        """The rotation as a matrix (3, 3), read-only."""
        if "_quat_xyzw" not in self.__dict__:
            return read_only(self.rotation.as_matrix())
        x, y, z, w = self.__dict__["_quat_xyzw"].tolist()
        matrix = [
            [w * w + x * x - y * y - z * z, 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
            [2.0 * (x * y + z * w), w * w - x * x + y * y - z * z, 2.0 * (y * z - x * w)],
            [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), w * w - x * x - y * y + z * z],
        ]
        return read_only(np.array(matrix) / math.fsum((x * x, y * y, z * z, w * w)))

    @property
    def matrix(self) -> Array:
        """The (4, 4) matrix that takes homogeneous world points to the camera."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.rotation_matrix
        matrix[:3, 3] = self.translation
        return matrix

    @property
    def camera_center(self) -> Array:
        """The camera's center in the world, (3,)."""
        center: Array = -self.rotation_matrix.T @ self.translation
        return center

    def inverse(self) -> Pose:
        """The pose `world_from_camera`."""
        return Pose(self.rotation.inv(), self.camera_center)

    def rebase(self, origin: ArrayLike) -> Pose:
        """The same pose for world points that are taken relative to `origin` (3,).

        Covariances stay as they are: increments are in the camera's frame.
        """
        shift = finite_array(origin, "origin", (3,))
        return Pose(self.rotation, self.translation + self.rotation_matrix @ shift)

    @checked_arguments
    def local_coordinates(self, other: Pose) -> Array:
        """The left increment `[omega (rad), tau]` (6,) that takes the pose to another, as covariances are of."""
        turn = other.rotation * self.rotation.inv()
        return np.concatenate([turn.as_rotvec(), other.translation - turn.as_matrix() @ self.translation])

    def retract(self, increment: ArrayLike) -> Pose:
        """The pose after a left increment `[omega (rad), tau]` (6,): `exp(omega) P + tau`."""
        from scipy.spatial.transform import Rotation

        given = finite_array(increment, "increment", (6,))
        turn = Rotation.from_rotvec(given[:3])
        return Pose(turn * self.rotation, turn.as_matrix() @ self.translation + given[3:])

    def transform(self, points: ArrayLike) -> Array:
        """World points in camera coordinates, as `pose @ points`.

        Parameters
        ----------
        points : (n, 3) or (3,) array
            In the world's unit.

        Returns
        -------
        (n, 3) or (3,) array
            NaN or infinite for points that are: clouds mark beams without a return so.

        Raises
        ------
        ValueError
            For another shape or type.

        """
        given = real_array(points, "points", "(n, 3) or (3,)").astype(np.float64)
        if given.ndim not in {1, 2} or given.shape[-1] != 3:
            raise ValueError(f"points have shape {given.shape}; needed (n, 3) or (3,)")
        with np.errstate(invalid="ignore", over="ignore"):
            return given @ self.rotation_matrix.T + self.translation

    @overload
    def __matmul__(self, other: Pose) -> Pose: ...

    @overload
    def __matmul__(self, other: ArrayLike) -> Array: ...

    def __matmul__(self, other: Pose | ArrayLike) -> Pose | Array:
        """Of another pose the pose that applies it first and this one then; of points as of `transform`."""
        if isinstance(other, Pose):
            return Pose(self.rotation * other.rotation, self.transform(other.translation))
        return self.transform(other)

    __array_ufunc__ = None
    """`array @ pose` is an error, and not the product with the matrix."""

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[Any]:
        """The (4, 4) matrix, as `numpy.asarray(pose)` asks for it; it is always a new array."""
        if copy is False:
            raise ValueError("a pose holds no matrix to share; needed copy=None or True")
        return self.matrix if dtype is None else self.matrix.astype(dtype)

    def __eq__(self, other: object) -> bool:
        """Whether both take points to the same places, to the last digit; `numpy.allclose` allows for rounding."""
        return isinstance(other, Pose) and np.array_equal(self.matrix, other.matrix)

    def __hash__(self) -> int:
        """The same for equal poses."""
        return hash((self.matrix + 0.0).tobytes())

    def __repr__(self) -> str:
        """Rotation vector in degrees and translation, to six digits."""
        turn = np.array2string(self.rotation.as_rotvec(degrees=True), precision=6)
        return f"Pose(rotation_vector_deg={turn}, translation={np.array2string(self.translation, precision=6)})"


def _translation(values: ArrayLike) -> Array:
    return read_only(finite_array(values, "translation", (3,)))
