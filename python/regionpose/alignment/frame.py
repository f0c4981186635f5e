"""A photo and a scan of the same scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from regionpose.alignment.photo import Photo
from regionpose.cameras import Camera
from regionpose.regions.image import ImageRegion
from regionpose.regions.world import WorldRegion
from regionpose.solve.core_inputs import check_camera
from regionpose.validation.arguments import check_fields
from regionpose.validation.arrays import KeptArrays


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
        Those of the photo that `world_regions` pair with. None by default.
    intensity : (n,) array, optional
        What the scanner received from each point, on any scale; brightness of colors if they are not from this photo.
    world_regions : sequence of WorldRegion
        Those at the places of `regions`.

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
