"""One state of a picking session, as undo brings it back."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from regionpose.app.parts import Picked
from regionpose.scene.region_sides import Scan


@dataclass(frozen=True)
class Sketch:
    """What undo brings back: the list of regions, which of them is worked on, and what all of them rest on.

    `base`: the scene file's values apart from regions. `scan`: the cloud, and where its scanner stood.
    """

    base: dict[str, Any]
    scan: Scan
    regions: tuple[Picked, ...] = ()
    selected: int | None = None

    def region(self, key: int) -> Picked:
        """The region of a key; ValueError where it is gone, as after another page removed it."""
        found = next((picked for picked in self.regions if picked.key == key), None)
        if found is None:
            raise ValueError("found no such region; it was removed in the meantime")
        return found

    def with_region(self, region: Picked) -> Sketch:
        """The sketch with this region in the place of the one of its key, or at the end."""
        is_listed = any(picked.key == region.key for picked in self.regions)
        kept = tuple(region if picked.key == region.key else picked for picked in self.regions)
        return replace(self, regions=kept if is_listed else (*kept, region), selected=region.key)

    def without(self, *keys: int) -> Sketch:
        """The sketch without some regions."""
        kept = tuple(picked for picked in self.regions if picked.key not in keys)
        return replace(self, regions=kept, selected=None if self.selected in keys else self.selected)
