"""What a picked region is made of: its side in the photo and its side in the cloud, each with other choices."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from regionpose.regions.image import ImageRegion
from regionpose.scene.region_sides import WorldSide

Levels = NDArray[np.uint8]
Part = TypeVar("Part")

FULL = 255
"""The level of a pixel that is covered whole in a mask's file."""


@dataclass(frozen=True, eq=False)
class ImagePart:
    """A region's side in the photo.

    `written`: its values in the scene file, without the name of a mask that was picked. `picked`: whether it is such
    a mask, which `save` writes.
    """

    written: dict[str, Any]
    region: ImageRegion
    picked: bool = False
    label: str = ""

    @classmethod
    def of_fractions(cls, fractions: ArrayLike, label: str = "") -> ImagePart:
        """The part of a mask's fractions (h, w) in [0, 1], rounded to the levels that its file will hold."""
        levels = np.round(np.asarray(fractions, dtype=np.float32) * np.float32(FULL))
        rounded = levels.astype(np.uint8).astype(np.float32) / np.float32(FULL)
        return cls({"coverage": True}, ImageRegion.from_mask(rounded), picked=True, label=label)

    @property
    def levels(self) -> Levels:
        """The mask (h, w) as its file holds it; ValueError of a polygon, which has none."""
        if self.region.mask is None:
            raise ValueError("found a polygon; needed a region with a mask")
        return np.round(self.region.mask.full().astype(np.float32) * FULL).astype(np.uint8)

    @property
    def is_polygon(self) -> bool:
        """Whether the region is a polygon, whose vertices can be moved."""
        return "polygon" in self.written

    @property
    def rings(self) -> list[list[list[float]]]:
        """The polygon's rings as the scene file writes them, always a list of rings."""
        given = self.written["polygon"]
        return given if isinstance(given[0][0], list) else [given]

    @property
    def hidden(self) -> list[list[int]]:
        """The hidden edges of each ring."""
        given = self.written.get("hidden_edges", [])
        nested = given if given and isinstance(given[0], list) else [given]
        return [sorted(edges) for edges in [*nested, *[[]] * (len(self.rings) - len(nested))]]


@dataclass(frozen=True, eq=False)
class WorldPart:
    """A region's side in the cloud: its values in the scene file, and the region made of them.

    `picked`: whether it holds indices of points, which `save` writes to a file of their own.
    """

    written: dict[str, Any]
    side: WorldSide
    label: str = ""
    picked: bool = False


@dataclass(frozen=True, eq=False)
class Choices(Generic[Part]):
    """Proposals of one click, and which of them is taken. Each is made when it is first looked at.

    `place`: the point (x, y, z) of the world that was clicked, where it was one.
    """

    makers: tuple[Callable[[], Part], ...]
    index: int = 0
    place: tuple[float, float, float] | None = None

    @cached_property
    def chosen(self) -> Part:
        """The proposal that is taken."""
        return self.makers[self.index]()

    def __len__(self) -> int:
        """How many there are."""
        return len(self.makers)

    def at(self, index: int) -> Choices[Part]:
        """The same proposals, another one taken."""
        return replace(self, index=min(max(index, 0), len(self.makers) - 1))


@dataclass(frozen=True, eq=False)
class Picked:
    """A region of the list: its name, its place among the colors, and the sides that it has so far."""

    key: int
    name: str
    image: Choices[ImagePart] | None = None
    world: Choices[WorldPart] | None = None

    def with_side(self, side: str, choices: Choices[Any] | None) -> Picked:
        """The region with another side, "image" or "world", or without it."""
        return replace(self, image=choices) if side == "image" else replace(self, world=choices)

    @property
    def is_paired(self) -> bool:
        """Whether both sides are there."""
        return self.image is not None and self.world is not None


def only(part: Part) -> Choices[Part]:
    """One part that leaves no choice."""
    return Choices((lambda: part,))
