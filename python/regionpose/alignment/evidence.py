"""How likely the edges of a photo make a pose, under the steps of the cloud (docs/math.md, eq. 18.6 to 18.8)."""

from __future__ import annotations

from copy import copy
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from regionpose import _core
from regionpose.alignment.frame import SceneFrame
from regionpose.alignment.steps import SEED, TURNS, beside, far_turns, places_moved, seen_steps
from regionpose.cameras.matrix import MatrixCamera
from regionpose.pose import Pose

Array = NDArray[np.float64]

SMALL_DEG, SMALL_COUNT = 0.6, 5
"""Turns about each turned pose over which evidence varies, and how many: some pixels of any photo."""


class Evidence:
    """The evidence of one frame about poses near one: its steps in the world, and the photo by how far it is spread.

    `pixels` (n, 2): where the steps are seen in the photo; `moved` (n, 2 d): derivatives of x, then y, by increments.
    """

    pixels: Array
    moved: Array

    def __init__(self, frame: SceneFrame, pose: Pose, *, with_focal: bool = False) -> None:
        """The steps that the camera would see at a pose; ValueError for points or an image of another shape.

        `with_focal`: increments are of seven components, the last of them of the logarithm of the focal lengths, of a
        camera that has a matrix.
        """
        self._frame, self._camera, self._pose, self._with_focal = frame, frame.camera, pose, with_focal
        self._photo, self._known = frame.photo, beside(frame.regions)
        self._all = frame.steps(pose)
        self.turn(Rotation.identity())

    def seen_from(self, pose: Pose) -> Evidence:
        """That of the same frame by the steps that the camera would see at another pose."""
        return Evidence(self._frame, pose, with_focal=self._with_focal)

    def of_frame(self, frame: SceneFrame) -> Evidence:
        """That of the same steps and photo by the camera of another frame, once it is moved to a pose."""
        other = copy(self)
        other._frame, other._camera = frame, frame.camera
        return other

    def turn(self, rotation: Rotation) -> Pose:
        """Look at the steps that the camera sees turned from the given pose, about its axes; that pose."""
        pose = Pose(rotation * self._pose.rotation, rotation.as_matrix() @ self._pose.translation)
        steps = self._all.turned(rotation)
        seen = seen_steps(self._photo, self._camera, steps, self._known)
        middle = steps.near[seen.numbers] + steps.far[seen.numbers]
        middle *= (steps.distances[seen.numbers] / np.linalg.norm(middle, axis=1))[:, None]
        self._steps, self._directions = middle @ pose.rotation.as_matrix() + pose.camera_center, seen.directions
        self.move_to(pose)
        return pose

    def move_to(self, pose: Pose, log_focal: float = 0.0) -> None:
        """Take a pose, and a logarithm of the focal lengths over the given ones, as those of increments; the steps stay
        those that they are.
        """
        camera = self._camera
        if isinstance(camera, MatrixCamera) and log_focal:
            camera = camera.zoomed(float(np.exp(log_focal)))
        local = (self._steps - pose.camera_center) @ pose.rotation.as_matrix().T
        shifts = np.broadcast_to(np.eye(3)[:, None], (3, *local.shape))
        places, moved = places_moved(self._photo, camera, local, np.concatenate([local @ TURNS, shifts]))
        self.pixels, self.moved = np.nan_to_num(places, nan=-1e6), moved
        if isinstance(camera, MatrixCamera) and self._with_focal:
            by_focal = np.nan_to_num(places - self._photo.places(np.array([[camera.cx, camera.cy]])))
            self.moved = np.hstack([moved[:, :6], by_focal[:, :1], moved[:, 6:], by_focal[:, 1:]])
        self._seen: dict[int, _core.SeenSteps] = {}

    @property
    def count(self) -> int:
        """How many steps are looked at."""
        return len(self._steps)

    def at(self, increments: Array, spread_px: float, every: int = 1) -> tuple[Array, Array]:
        """Logarithms (t,) of the likelihood ratio at increments (t, d), rad and meters, and their derivatives (t, d),
        of steps as if they were independent; of every so manyth of them alone, as if it stood for so many.
        """
        values, slopes = self._every(every).evidence(self._photo.log_ratios(spread_px), increments)
        return every * values, every * slopes

    def _every(self, so_manyth: int) -> _core.SeenSteps:
        """Every so manyth step as it is seen."""
        if so_manyth not in self._seen:
            chosen = slice(None, None, so_manyth)
            moved, directions = self.moved[chosen], self._directions[chosen]
            self._seen[so_manyth] = _core.SeenSteps(self.pixels[chosen], moved, directions)
        return self._seen[so_manyth]

    def square_moves(self) -> Array:
        """The matrix (d, d) of the mean square, in pixels, by which increments move the steps that the photo shows."""
        size = self._photo.luminance.shape[::-1]
        shown = ((self.pixels >= 0.0) & (self.pixels < size)).all(axis=1)
        moved = self.moved[shown].reshape(-1, self.moved.shape[1] // 2)
        return np.asarray(2.0 / max(len(moved), 1) * (moved.T @ moved))

    def share(self, spread_px: float) -> float:
        """What a step counts, 0 to 1, so that the likelihood ratio of all of them is 1 on the mean where chance rules.

        That is a lognormal's at poses turned by far more than a pose may be off; neighboring steps tell the same.
        """
        if not self.count:
            return 0.0
        turns = (far_turns()[:, None] + _small_turns()).reshape(-1, 3)
        sums, _ = self.at(np.pad(turns, ((0, 0), (0, 4 if self._with_focal else 3))), spread_px)
        return float(np.clip(-2.0 * sums.mean() / max(float(sums.var(ddof=1)), 1e-12), 0.0, 1.0))


@cache
def _small_turns() -> Array:
    """Rotation vectors (t, 3), rad."""
    return np.random.default_rng(SEED).normal(scale=np.radians(SMALL_DEG), size=(SMALL_COUNT, 3))
