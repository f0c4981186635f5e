"""One exposure of a camera."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from regionpose.regions.image import ImageRegion
from regionpose.regions.world import WorldRegion
from regionpose.validation.arguments import check_fields
from regionpose.validation.arrays import KeptArrays


@dataclass(frozen=True, eq=False)
class Frame(KeptArrays):
    """One exposure: pairs of regions, or a photo with the points of a scan from the same time, or both.

    `estimate_rig` needs the regions. `calibrate`, `check_alignment` and `confirmed_regions` need `image` and `points`;
    `calibrate` uses regions, too, where there are some.

    Parameters
    ----------
    image_regions : sequence of ImageRegion
        Regions of the photo.
    world_regions : sequence of WorldRegion
        Those at the places of `image_regions`, in the frame of the points (the rig's), meters.
    name : str
        In errors, warnings and diagnostics; by default `frame` and its number.
    image : (h, w) or (h, w, 3) array, optional
        The photo: uint8, uint16 or floats in [0, 1].
    points : (n, 3) array, optional
        World coordinates, meters.
    intensity : (n,) array, optional
        What the scanner received from each point, on any scale; brightness of colors if they are not from this photo.

    Raises
    ------
    ValueError
        For regions of another type.
    """

    image_regions: Sequence[ImageRegion] = ()
    world_regions: Sequence[WorldRegion] = ()
    name: str = ""
    image: ArrayLike | None = field(default=None, kw_only=True)
    points: ArrayLike | None = field(default=None, kw_only=True)
    intensity: ArrayLike | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        """Check the regions; keep read-only views of the caller's arrays."""
        check_fields(self)
        object.__setattr__(self, "image_regions", tuple(self.image_regions))
        object.__setattr__(self, "world_regions", tuple(self.world_regions))
        for name in ("image", "points", "intensity"):
            value = getattr(self, name)
            if isinstance(value, np.ndarray):
                view = value.view()
                view.setflags(write=False)
                object.__setattr__(self, name, view)


def named_frames(frames: Sequence[Frame], needed: str) -> list[Frame]:
    """The frames, with `frame` and their numbers for missing names.

    ValueError for no frames, a repeated name, and a frame that has not as many image regions as world regions.
    """
    named = [frame if frame.name else replace(frame, name=f"frame {index}") for index, frame in enumerate(frames)]
    if not named:
        raise ValueError(f"frames is empty; needed at least one {needed}")
    names = [frame.name for frame in named]
    repeated = [name for name in names if names.count(name) > 1]
    if repeated:
        raise ValueError(f"two frames are named {repeated[0]!r}; needed a name of its own for each")
    for frame in named:
        if len(frame.image_regions) != len(frame.world_regions):
            raise ValueError(f"{_counts(frame)}; needed as many of both")
    return named


def check_has_regions(frame: Frame) -> None:
    """ValueError that names a frame without regions."""
    if not frame.image_regions:
        raise ValueError(f"{_counts(frame)}; needed at least one pair")


def _counts(frame: Frame) -> str:
    return f"{frame.name} has {len(frame.image_regions)} image regions and {len(frame.world_regions)} world regions"
