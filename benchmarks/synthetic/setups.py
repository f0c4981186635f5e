"""Cameras of the benchmark and the ranges that their true poses are drawn from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from regionpose.cameras import Camera, FisheyeCamera, OcamCamera, PinholeCamera
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]

SENSOR_WIDTH_PX, SENSOR_HEIGHT_PX = 2376, 1584
SENSOR_CENTER_PX = (0.5 * (SENSOR_WIDTH_PX - 1), 0.5 * (SENSOR_HEIGHT_PX - 1))
PERSPECTIVE_FOCAL_PX = 1900.0
FISHEYE_FOCAL_PX = 500.0
# px; radius at which the polynomial fisheye looks 90 deg off its axis: the circle touches the sensor's long sides.
OMNIDIRECTIONAL_RADIUS_PX = 792.0

POSE_ANGLE_DEG = 40.0


class PoseSource(Protocol):
    """What true poses are drawn from."""

    def draw(self, rng: np.random.Generator) -> tuple[Array, Array]:
        """Rotation (3, 3) and translation (3,), meters, of `camera_from_world`; the first plane is the world's z = 0.

        The front of that plane is seen along +z.
        """


@dataclass(frozen=True)
class PoseRange:
    """Ranges that the true translation is drawn from, meters; the sign of the sideways and vertical parts is random."""

    lateral: tuple[float, float]
    depth: tuple[float, float]

    def __post_init__(self) -> None:
        """Check that the ranges are in order and the depth is before the camera."""
        for name, (low, high) in (("lateral", self.lateral), ("depth", self.depth)):
            if not 0.0 <= low <= high or (name == "depth" and low == 0.0):
                raise ValueError(f"{name} range is ({low}, {high}) m; needed 0 <= low <= high, a depth above 0")

    def draw(self, rng: np.random.Generator) -> tuple[Array, Array]:
        """Rotation (3, 3) within +-40 deg about each axis and translation (3,)."""
        lateral = self._draw_lateral(rng)
        rotation = turn_within(POSE_ANGLE_DEG, rng)
        return rotation, np.append(lateral, rng.uniform(*self.depth))

    def draw_translation(self, rng: np.random.Generator) -> Array:
        """Translation (3,), meters."""
        return np.append(self._draw_lateral(rng), rng.uniform(*self.depth))

    def _draw_lateral(self, rng: np.random.Generator) -> Array:
        sideways: Array = rng.uniform(*self.lateral, size=2) * rng.choice([-1.0, 1.0], size=2)
        return sideways


@dataclass(frozen=True)
class TurnedPoses:
    """Poses that look at the first plane turned in itself by `turn_deg`, tilted within +-40 deg about x and y."""

    base: PoseRange
    turn_deg: float

    def draw(self, rng: np.random.Generator) -> tuple[Array, Array]:
        """Rotation (3, 3) and translation (3,)."""
        tilt = Rotation.from_euler("xy", rng.uniform(-POSE_ANGLE_DEG, POSE_ANGLE_DEG, size=2), degrees=True)
        turn = Rotation.from_euler("z", self.turn_deg, degrees=True)
        return (tilt * turn).as_matrix(), self.base.draw_translation(rng)


@dataclass(frozen=True)
class GrazingPoses:
    """Poses whose line of sight to the first region's centroid makes the angle `grazing_deg` with its plane.

    The direction in which the plane tilts and its turn in itself are uniform.
    """

    base: PoseRange
    grazing_deg: float

    def draw(self, rng: np.random.Generator) -> tuple[Array, Array]:
        """Rotation (3, 3) and translation (3,)."""
        translation = self.base.draw_translation(rng)
        sight = translation / np.linalg.norm(translation)
        across = np.cross(sight, random_direction(3, rng))
        across /= np.linalg.norm(across)
        grazing = np.radians(self.grazing_deg)
        normal = np.sin(grazing) * sight + np.cos(grazing) * across
        first = np.cross(normal, sight)
        first /= np.linalg.norm(first)
        turn = Rotation.from_euler("z", rng.uniform(0.0, 2.0 * np.pi)).as_matrix()
        return np.column_stack([first, np.cross(normal, first), normal]) @ turn, translation


@dataclass(frozen=True)
class Setup:
    """A camera and the poses that its scenes are drawn from."""

    camera: Camera
    poses: PoseRange


def perspective_setup() -> Setup:
    """The pinhole camera, 4 to 6 m away."""
    return Setup(perspective_camera(), PoseRange(lateral=(0.5, 2.0), depth=(4.0, 6.0)))


def omnidirectional_setup() -> Setup:
    """The polynomial fisheye of 180 deg field, 1 to 3 m away."""
    return Setup(omnidirectional_camera(), PoseRange(lateral=(0.5, 1.0), depth=(1.0, 3.0)))


def fisheye_setup() -> Setup:
    """The equidistant fisheye at half the perspective distances."""
    return Setup(fisheye_camera(), PoseRange(lateral=(0.25, 1.0), depth=(2.0, 3.0)))


def perspective_camera() -> PinholeCamera:
    """The benchmark's pinhole camera: 2376 x 1584 px, f = 1900 px, the principal point at the image center."""
    focal = PERSPECTIVE_FOCAL_PX
    return PinholeCamera(focal, focal, *SENSOR_CENTER_PX, width=SENSOR_WIDTH_PX, height=SENSOR_HEIGHT_PX)


def fisheye_camera() -> FisheyeCamera:
    """An equidistant fisheye, f = 500 px, on the same sensor."""
    focal = FISHEYE_FOCAL_PX
    return FisheyeCamera(focal, focal, *SENSOR_CENTER_PX, width=SENSOR_WIDTH_PX, height=SENSOR_HEIGHT_PX)


def omnidirectional_camera() -> OcamCamera:
    """The benchmark's omnidirectional camera: a polynomial fisheye of 180 deg field on the same sensor.

    `g(rho) = a0 + a2 rho^2 + a4 rho^4` follows the equidistant fisheye, `g = rho / tan(rho / f)`,
    `f = 2 radius / pi`, to second order; `a4` makes the field exactly 180 deg at the image circle, `g(radius) = 0`.
    """
    radius = OMNIDIRECTIONAL_RADIUS_PX
    a0 = 2.0 * radius / np.pi
    a2 = -1.0 / (3.0 * a0)
    a4 = -(a0 + a2 * radius**2) / radius**4
    return OcamCamera((a0, 0.0, a2, 0.0, a4), SENSOR_CENTER_PX, width=SENSOR_WIDTH_PX, height=SENSOR_HEIGHT_PX)


def turn_within(limit_deg: float, rng: np.random.Generator) -> Array:
    """(3, 3) rotation about x, then y, then z (fixed axes), each angle uniform within +- `limit_deg`."""
    angles = rng.uniform(-limit_deg, limit_deg, size=3)
    matrix: Array = Rotation.from_euler("xyz", angles, degrees=True).as_matrix()
    return matrix


def any_rotation(rng: np.random.Generator) -> Array:
    """(3, 3) rotation drawn uniformly from all: a normal vector of four numbers is the direction of its quaternion."""
    matrix: Array = Rotation.from_quat(rng.normal(size=4)).as_matrix()
    return matrix


def random_direction(dimensions: int, rng: np.random.Generator) -> Array:
    """Uniform unit vector of so many dimensions."""
    vector = rng.normal(size=dimensions)
    direction: Array = vector / np.linalg.norm(vector)
    return direction
