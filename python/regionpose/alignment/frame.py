"""A photo and a scan of the same scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from regionpose.alignment.agreement import Alignment, aligned
from regionpose.alignment.photo import Photo
from regionpose.alignment.steps import Steps, beside, steps_at
from regionpose.alignment.visibility import occlusions
from regionpose.arguments import check_fields, checked_arguments
from regionpose.arrays import KeptArrays
from regionpose.cameras import Camera
from regionpose.estimation.sides import check_camera
from regionpose.pose import Pose
from regionpose.progress import check_wanted
from regionpose.regions.image import ImageRegion
from regionpose.regions.world import WorldRegion

KEPT = 4
"""Poses whose steps are kept: alignment and refinement look at the same one, and few answers are looked at twice."""


@dataclass(frozen=True, eq=False)
class SceneFrame(KeptArrays):
    """A photo, the camera that took it, and a scan from the same time.

    Parameters
    ----------
    image : (h, w) or (h, w, 3) array, or Photo
        uint8, uint16 or floats in [0, 1].
    points : (n, 3) array
        World coordinates, meters.
    camera : Camera
        That took the photo.
    regions : sequence of ImageRegion
        Those that the pose comes from; steps beside them are left out, since they are not new.
    intensity : (n,) array, optional
        What the scanner received from each point, on any scale; brightness of colors if they are not from this photo.
    world_regions : sequence of WorldRegion
        Those at the places of `regions`; a pose at which the points hide them is contradicted. None by default.

    Raises
    ------
    ValueError
        For an image of another shape, and for an image or a mask of another size than the camera's.
    """

    image: ArrayLike | Photo
    points: ArrayLike
    camera: Camera
    regions: Sequence[ImageRegion] = ()
    intensity: ArrayLike | None = None
    world_regions: Sequence[WorldRegion] = ()

    def __post_init__(self) -> None:
        """Check that camera, photo and masks are of one size; keep views through which nobody can write to arrays that
        are the caller's.
        """
        check_fields(self)
        for name in ("image", "points", "intensity"):
            value = getattr(self, name)
            if isinstance(value, np.ndarray):
                view = value.view()
                view.setflags(write=False)
                object.__setattr__(self, name, view)
        check_camera(self.camera, self.regions)
        self.camera.check_size(self.photo.shape)

    @cached_property
    def photo(self) -> Photo:
        """The image, as its edges are looked for."""
        return self.image if isinstance(self.image, Photo) else Photo.of(self.image)

    @checked_arguments
    def steps(self, pose: Pose) -> Steps:
        """The steps of the points that the camera would see at a pose; ValueError for points of another shape."""
        check_wanted()
        key = pose.matrix.tobytes()
        if key not in self._steps:
            if len(self._steps) == KEPT:
                del self._steps[next(iter(self._steps))]
            self._steps[key] = steps_at(pose, self.points, self.camera, self.photo, self.intensity)
        return self._steps[key]

    @cached_property
    def _steps(self) -> dict[bytes, Steps]:
        """Those that were looked at last: to find them takes longer than all else."""
        return {}

    @checked_arguments
    def alignment(self, pose: Pose) -> Alignment:
        """How well photo and points agree at a pose, as of `check_alignment`."""
        hidden = occlusions(self.regions, self.world_regions, self.points, self.camera, pose)
        return aligned(self.photo, self.camera, self.steps(pose), beside(self.regions), hidden)


@checked_arguments
def check_alignment(
    image: ArrayLike | Photo,
    points: ArrayLike,
    camera: Camera,
    pose: Pose,
    *,
    regions: Sequence[ImageRegion] = (),
    world_regions: Sequence[WorldRegion] = (),
    intensity: ArrayLike | None = None,
) -> Alignment:
    """How well photo and cloud agree at a pose, however it was found.

    Steps of the points' depth and intensity as the camera would see them, against edges of the photo; and whether
    points stand before the regions that the photo shows.

    Parameters
    ----------
    image : (h, w) or (h, w, 3) array, or Photo
        uint8, uint16 or floats in [0, 1]; a `Photo` of it saves work for more than one pose.
    points : (n, 3) array
        World coordinates, meters.
    camera : Camera
        That took the photo.
    pose : Pose
        `camera_from_world`.
    regions : sequence of ImageRegion
        Those that the pose comes from; steps beside them are left out, since they agree at any pose that the regions
        allow.
    world_regions : sequence of WorldRegion
        Those at the places of `regions`, of which it is told how much the points hide; none by default.
    intensity : (n,) array, optional
        What the scanner received from each point, on any scale; brightness of colors if they are not from this photo.

    Raises
    ------
    ValueError
        For other shapes, for an image of another size than the camera's, and for world regions of another number than
        regions.
    """
    return SceneFrame(image, points, camera, regions, intensity, world_regions).alignment(pose)
