"""What is known of a pose beforehand."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from regionpose import _core
from regionpose.geometry.pose import Pose
from regionpose.validation.arguments import checked_arguments
from regionpose.validation.arrays import finite_array

Mount = Literal["front", "left", "rear", "right"]
"""Directions of a vehicle in which a camera looks."""

FORWARD: dict[Mount, tuple[float, float, float]] = {
    "front": (1.0, 0.0, 0.0),
    "left": (0.0, 1.0, 0.0),
    "rear": (-1.0, 0.0, 0.0),
    "right": (0.0, -1.0, 0.0),
}
"""The camera's axis by its mount, in a frame with x forward, y left and z up."""

AXES = {
    f"{sign}{name}": tuple((-1.0 if sign == "-" else 1.0) * (name == axis) for axis in "xyz")
    for name in "xyz"
    for sign in ("", "+", "-")
}
"""Directions of the world by the names of its axes."""

UP_SIGMA_DEG, MOUNT_SIGMA_DEG, MOUNT_SIGMA_M = 5.0, 20.0, 0.5
"""Deviations of a mounted camera: conventions, of cameras that look ahead or slightly down, of words for directions,
and of camera and scanner on one vehicle or tripod."""

SIGMAS = ("up_sigma_deg", "initial_rotation_sigma_deg", "initial_center_sigma_m", "camera_near_sigma_m")


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Prior:
    """What is known of the pose `camera_from_world` beforehand; every part is optional.

    A prior chooses between poses that fit about equally well and moves none. A warning reports one that no fitting pose
    agrees with (docs/math.md, section 10). Hashable; equal to a prior of the same numbers.

    Parameters
    ----------
    up : (3,) array, optional
        World direction that is up in the image.
    up_sigma_deg : float, optional
        How well it is known, degrees; 15 without it.
    initial : Pose, optional
        A rough pose. Without its deviations it is a start and chooses between poses that fit equally well.
    initial_rotation_sigma_deg, initial_center_sigma_m : float, optional
        Standard deviations of its rotation and of the camera's place along each axis, both or neither; they rule out
        poses that lie elsewhere.
    camera_near : (3,) array, optional
        A place of the world, meters, that the camera stands near, such as the scanner's; directions to the regions are
        a start from there.
    camera_near_sigma_m : float, optional
        How well it is known along each axis, meters; 2 without it.

    Raises
    ------
    ValueError
        That names the field: for an invalid direction, pose or place, a deviation that isn't positive, or one without
        what it belongs to.

    Examples
    --------
    >>> import regionpose as rp
    >>> rp.Prior(up=[0, 0, 1], up_sigma_deg=5.0)
    Prior(up=(0.0, 0.0, 1.0), up_sigma_deg=5.0)
    """

    up: ArrayLike | None = None
    up_sigma_deg: float | None = None
    initial: Pose | None = None
    initial_rotation_sigma_deg: float | None = None
    initial_center_sigma_m: float | None = None
    camera_near: ArrayLike | None = None
    camera_near_sigma_m: float | None = None

    def __post_init__(self) -> None:
        """Check the parts, and keep numbers alone."""
        if self.initial is not None and not isinstance(self.initial, Pose):
            raise ValueError(f"initial is a {type(self.initial).__name__}; needed a Pose")
        # Made once to have everything checked, and again where it is used: what is compiled has no pickle.
        _ = self.core
        for name in ("up", "camera_near"):
            values = getattr(self, name)
            if values is not None:
                object.__setattr__(self, name, tuple(np.asarray(values, dtype=np.float64).tolist()))
        for name in SIGMAS:
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, float(value))

    @classmethod
    def mounted(
        cls,
        mount: Mount | None = None,
        *,
        up: ArrayLike | None = None,
        near_m: float | None = None,
        place: ArrayLike | None = None,
    ) -> Prior:
        """The prior of a camera on a vehicle or tripod, with usual deviations, as `regionpose calibrate` takes it.

        Parameters
        ----------
        mount : {"front", "left", "rear", "right"}, optional
            Where the camera looks, level and to 20 degrees (1 sigma), in a world with x forward, y left and z up.
            Without it any heading.
        up : (3,) array or str, optional
            World direction that is up in the image, to 5 degrees (1 sigma): a vector, or an axis as "z" or "-y".
        near_m : float, optional
            Standard deviation of the camera's place along each axis, meters. With a mount it is 0.5 where left out;
            without one nothing is known of the place then, and `calibrate` assumes 0.5.
        place : (3,) array, optional
            The place of the world that the camera is near, meters, such as the scanner's; (0, 0, 0) where left out.

        Returns
        -------
        Prior
            With `initial` and its deviations for a mount; else with `camera_near` where `near_m` or `place` is given.

        Raises
        ------
        ValueError
            For another mount or axis, and as of `Prior`.

        Examples
        --------
        >>> import regionpose as rp
        >>> rp.Prior.mounted(up="z", near_m=0.3)
        Prior(up=(0.0, 0.0, 1.0), up_sigma_deg=5.0, camera_near=(0.0, 0.0, 0.0), camera_near_sigma_m=0.3)
        """
        if near_m is not None and not (np.isfinite(near_m) and near_m > 0.0):
            raise ValueError(f"near_m: found {near_m:g}; needed a positive number of meters")
        known = cls() if up is None else cls(up=_direction(up), up_sigma_deg=UP_SIGMA_DEG)
        center = np.zeros(3) if place is None else finite_array(place, "place", (3,))
        if mount is not None:
            # The place is the initial pose's, and counts once.
            return replace(
                known,
                initial=_level(mount, center),
                initial_rotation_sigma_deg=MOUNT_SIGMA_DEG,
                initial_center_sigma_m=MOUNT_SIGMA_M if near_m is None else near_m,
            )
        if near_m is None and place is None:
            return known
        return replace(known, camera_near=center, camera_near_sigma_m=near_m)

    @property
    def core(self) -> _core.Prior:
        """The prior as the core takes it."""
        parts = None if self.initial is None else (self.initial.rotation.as_matrix(), self.initial.translation)
        return _core.Prior(
            up=self.up,
            up_sigma_deg=self.up_sigma_deg,
            initial=parts,
            initial_rotation_sigma_deg=self.initial_rotation_sigma_deg,
            initial_center_sigma_m=self.initial_center_sigma_m,
            camera_near=self.camera_near,
            camera_near_sigma_m=self.camera_near_sigma_m,
        )

    def rebase(self, origin: ArrayLike) -> Prior:
        """The same for world points taken relative to `origin` (3,), meters."""
        shift = np.asarray(origin, dtype=np.float64)
        pose, near = self.initial, self.camera_near
        return replace(
            self,
            initial=None if pose is None else pose.rebase(shift),
            camera_near=None if near is None else np.asarray(near) - shift,
        )

    @checked_arguments
    def started_at(self, pose: Pose) -> Prior:
        """The same with a start in place of the rough pose."""
        return replace(self, initial=pose, initial_rotation_sigma_deg=None, initial_center_sigma_m=None)

    def _values(self) -> tuple[object, ...]:
        pose = self.initial
        numbers = (
            None if pose is None else (*pose.rotation.as_quat(canonical=True).tolist(), *pose.translation.tolist())
        )
        return self.up, numbers, self.camera_near, *(getattr(self, name) for name in SIGMAS)

    def __eq__(self, other: object) -> bool:
        """Whether the other is a prior of the same numbers."""
        return self._values() == other._values() if isinstance(other, Prior) else NotImplemented

    def __hash__(self) -> int:
        """Of the numbers."""
        return hash(self._values())

    def __repr__(self) -> str:
        """The parts that are given, as they could be typed in."""
        parts = {name: getattr(self, name) for name in self.__dataclass_fields__}
        written = {name: _written(value) for name, value in parts.items() if value is not None}
        return f"Prior({', '.join(f'{name}={value}' for name, value in written.items())})"


def _written(value: object) -> str:
    return f"Pose.from_matrix({value.matrix[:3].tolist()})" if isinstance(value, Pose) else repr(value)


def _direction(up: ArrayLike) -> ArrayLike:
    """A direction of the world, by the name of an axis or as it is given."""
    if isinstance(up, str):
        if up not in AXES:
            raise ValueError(f"up: found {up!r}; needed x, y, z, -x, -y, -z or a vector (3,)")
        return AXES[up]
    return up


def _level(mount: Mount, place: NDArray[np.float64]) -> Pose:
    """The level camera (`camera_from_world`) at a place (3,), meters, that looks along a direction of the vehicle."""
    if mount not in FORWARD:
        raise ValueError(f"mount: found {mount!r}; needed {', '.join(FORWARD)}")
    forward = np.array(FORWARD[mount])
    rotation = np.stack([np.cross(forward, [0.0, 0.0, 1.0]), [0.0, 0.0, -1.0], forward])
    return Pose.from_parts(rotation, -rotation @ place)
