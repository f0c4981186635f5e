"""A photo and a scan of the same scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from numpy.typing import ArrayLike

from regionpose.cameras import Camera
from regionpose.pose import Pose
from regionpose.regions.image import ImageRegion
from regionpose.witness.alignment import Alignment, check_alignment
from regionpose.witness.photo import Photo


@dataclass(frozen=True, eq=False)
class SceneFrame:
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
        Those that the pose to be refined comes from; steps beside them are left out, since they are not new.
    intensity : (n,) array, optional
        What the scanner received from each point, on any scale; brightness of colors if they are not from this photo.
    """

    image: ArrayLike | Photo
    points: ArrayLike
    camera: Camera
    regions: Sequence[ImageRegion] = ()
    intensity: ArrayLike | None = None

    def alignment(self, pose: Pose) -> Alignment:
        """How well photo and points agree at a pose, as of `check_alignment`."""
        return check_alignment(
            self.image, self.points, self.camera, pose, regions=self.regions, intensity=self.intensity
        )
