"""The photo and the points of a frame, checked."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from regionpose.alignment.photo import Photo
from regionpose.alignment.views import checked_intensity, checked_points
from regionpose.cameras import Camera
from regionpose.solve.core_inputs import check_camera
from regionpose.solve.frame import Frame
from regionpose.validation.arrays import checked_image
from regionpose.validation.content import Content

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PhotoCloud:
    """A frame with its camera, its `Photo`, whose edge likelihoods are kept, and its points (n, 3) and intensity
    (n,).
    """

    camera: Camera
    frame: Frame
    photo: Photo
    points: Array
    intensity: Array | None

    @classmethod
    def of(cls, camera: Camera, frame: Frame) -> PhotoCloud:
        """ValueError, naming the frame, where image or points are missing, for arrays of another shape, and for an
        image or a mask of another size than the camera's.
        """
        if frame.image is None or frame.points is None:
            missing = " and ".join(name for name in ("image", "points") if getattr(frame, name) is None)
            raise ValueError(f"{frame.name or 'frame'} has no {missing}; needed image and points")
        try:
            check_camera(camera, frame.image_regions)
            photo = _photo_of(Content.of(checked_image(frame.image)))
            camera.check_size(photo.shape)
            points = checked_points(frame.points)
            return cls(camera, frame, photo, points, checked_intensity(frame.intensity, points))
        except ValueError as error:
            raise ValueError(f"{frame.name}: {error}" if frame.name else str(error)) from error


@lru_cache(maxsize=1)
def _photo_of(image: Content[np.uint8]) -> Photo:
    """The photo of an image. That of the last one is kept: its edge likelihoods are the same for all poses that are
    checked, and for all regions in it.
    """
    return Photo.of(image.array)
