"""The paper's initial pose (sections 2.1.1 and 2.2.1), in the two ways that it may be read."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from benchmarks.published.moments import PLANE_EXPONENTS, SPHERE_EXPONENTS, Array
from benchmarks.published.system import SeenPlane, System, WorldSide

Start = Literal["parallel", "turned"]
"""Whether the region keeps parallel to the image while it moves onto the observed ray, or is turned onto it.

A region turned to face its ray lies midway between the two tilts that show it nearly alike, and most often the wrong
one is reached; parallel to the image it is nearer to the right one whenever the camera looks along the world's z axis.
"""

AREA_PRECISION = 1e-6
"""Relative difference of both areas at which the start's distance is good enough by far."""

MOST_DISTANCES = 50
"""Distances tried; each is nearer by a power, since areas fall with the distance squared but for perspective."""


class Placement(NamedTuple):
    """`P = R X + t`."""

    rotation: Array
    translation: Array

    def after(self, first: Placement) -> Placement:
        """What `first` and then this placement do."""
        return Placement(self.rotation @ first.rotation, self.rotation @ first.translation + self.translation)


def facing_placement(plane: SeenPlane, centroid: Array, up: ArrayLike | None = None) -> Placement:
    """`R0, t0`: the region's normal on the optical axis, its centroid (3,) at distance 1 before the camera.

    With `up`, the world's up direction (3,), `R_u` turns that to the camera's, -y, as far as a turn about the axis can.
    """
    rotation = turn_between(plane.normal, np.array([0.0, 0.0, 1.0]))
    if up is not None:
        x, y, _ = rotation @ np.asarray(up, dtype=np.float64)
        turn = Rotation.from_rotvec([0.0, 0.0, -np.arctan2(x, -y)])
        rotation = turn.as_matrix() @ rotation
    return Placement(rotation, np.array([0.0, 0.0, 1.0]) - rotation @ centroid)


def start_placement(observed: Array, world: WorldSide, facing: Placement, system: System, start: Start) -> Placement:
    """`R, t` of the region placed by `facing`: its centroid on the observed one's ray, where both areas agree.

    Turned, R is the least rotation between both centroids' directions; parallel, it is the identity.
    """
    ahead = np.array([0.0, 0.0, 1.0])
    sight = centroid_direction(observed, system)
    rotation = turn_between(ahead, sight) if start == "turned" else np.eye(3)
    distance = 1.0
    for _ in range(MOST_DISTANCES):
        placement = Placement(rotation, distance * sight - rotation @ ahead)
        area = world.moments(*placement.after(facing), system)[0]
        if abs(area / observed[0] - 1.0) < AREA_PRECISION:
            break
        distance *= float(np.sqrt(abs(area / observed[0])))
    return placement


def centroid_direction(moments: Array, system: System) -> Array:
    """(3,) unit direction of the centroid of a region with these moments."""
    if system == "plane":
        first = [PLANE_EXPONENTS.index(e) for e in ((1, 0), (0, 1), (0, 0))]
    else:
        first = [SPHERE_EXPONENTS.index(e) for e in ((1, 0, 0), (0, 1, 0), (0, 0, 1))]
    direction: Array = moments[first] / np.linalg.norm(moments[first])
    return direction


def turn_between(start: Array, end: Array) -> Array:
    """(3, 3) least rotation that takes one unit vector to another."""
    axis = np.cross(start, end)
    sine, cosine = np.linalg.norm(axis), start @ end
    if sine == 0.0:
        # Opposite vectors: half a turn about any axis across.
        return np.eye(3) if cosine > 0.0 else _half_turn(start)
    return Rotation.from_rotvec(axis / sine * np.arctan2(sine, cosine)).as_matrix()


def _half_turn(vector: Array) -> Array:
    across = np.cross(vector, np.eye(3)[np.argmin(np.abs(vector))])
    return Rotation.from_rotvec(np.pi * across / np.linalg.norm(across)).as_matrix()
