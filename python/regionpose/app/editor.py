"""Editing of the regions of a picking session: clicks, polygons, names, pairs, what they rest on, and undo."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from regionpose.app.parts import Choices, ImagePart, Picked, WorldPart, only
from regionpose.app.prior_settings import PriorSettings
from regionpose.app.proposals import mask_choices, picked_points, picked_world, plane_choices, segmenter_choices
from regionpose.app.scene_text import scene_of
from regionpose.app.sketch import Sketch
from regionpose.cameras import Camera
from regionpose.io.clouds import Cloud
from regionpose.scene.loading import Scene
from regionpose.scene.region_sides import Scan, image_side
from regionpose.scene.sensors import Picture, sensor_origin
from regionpose.scene.solver_config import scene_prior
from regionpose.segment.cloud import points_on_plane
from regionpose.segment.segmenters import Segmenter
from regionpose.validation.arrays import Array

MOST_UNDO = 200
"""Steps that can be undone; each holds references to its regions, not copies."""

LEAST_POINTS = 3
"""Points that a plane has at the least."""

MOST_REFITS = 10
"""Fits of a plane to the points that it holds at the most, as many as `robust_plane` takes."""

SAME_PLACE = 0.02
"""Distance between two clicks at one place at the most, over that from the scanner: a degree, some ten pixels of a
lidar's range image."""

STAND_IN: dict[str, Any] = {"seed": [0.0, 0.0]}
"""A side in the photo, of a scene that is made to look at its region's other side."""


@dataclass(eq=False)
class Editor:
    """The regions of a scene and their steps back and forth.

    `path`: the scene file, which paths are relative to. `camera`, `image`, `cloud`: what it names. `segmenter`: what
    clicks in the photo ask; they grow by color where it is None. Refused edits raise ValueErrors that name what is
    needed, and change nothing then. Not safe for several threads at once.
    """

    path: Path
    camera: Camera
    image: Picture
    cloud: Cloud
    sketch: Sketch
    segmenter: Segmenter | None = None
    _past: list[Sketch] = field(default_factory=list)
    _future: list[Sketch] = field(default_factory=list)
    _next: int = 0

    @property
    def base(self) -> dict[str, Any]:
        """The scene file's values apart from regions."""
        return self.sketch.base

    @property
    def scan(self) -> Scan:
        """The cloud, and where its scanner stood."""
        return self.sketch.scan

    @property
    def lacks_scanner(self) -> bool:
        """Whether neither the scene nor the cloud's file states where the scanner stood, or that there were several."""
        return self.scan.scanner is None and "sensor_origin" not in self.base

    @property
    def scanner(self) -> Array | None:
        """Where the scanner stood (3,), in the cloud's world; None where that isn't known, or there were several."""
        return None if self.scan.scanner is None else self.scan.scanner + self.scan.origin

    def set_scanner(self, place: Sequence[float] | None) -> None:
        """Set where the scanner stood (3,), in the cloud's world; None for scans of several places merged.

        The regions' samples follow. ValueError where one of them can't be made then.
        """
        if place is not None and not (len(place) == 3 and np.isfinite(place).all()):
            raise ValueError("the scanner's place: needed three numbers, meters")
        base = {**self.base, "sensor_origin": None if place is None else [float(value) for value in place]}
        before, local = self.sketch, None if place is None else np.asarray(place, dtype=np.float64) - self.scan.origin
        self.sketch = replace(before, base=base, scan=self.scan._replace(scanner=local))
        try:
            moved = replace(self.sketch, regions=tuple(self._again(picked) for picked in before.regions))
        finally:
            self.sketch = before
        self._change(moved)

    @property
    def prior_settings(self) -> PriorSettings:
        """The prior of the pose, for editing."""
        return PriorSettings.of(self.base.get("prior", {}))

    def set_prior_settings(self, settings: PriorSettings) -> None:
        """Set the prior of the pose, which the scene file's `prior` then holds.

        ValueError for what is no direction, no deviation, or a direction of view from no place.
        """
        self.set_prior(settings.prior(self.base.get("prior", {}), self.scanner))

    def set_prior(self, prior: dict[str, Any]) -> None:
        """Set the scene file's `prior`; ValueError for an invalid one."""
        base = {key: value for key, value in self.base.items() if key != "prior"} | ({"prior": prior} if prior else {})
        scene = scene_of(self.path, {**base, "regions": [alone(STAND_IN, {"seed": [0.0, 0.0, 0.0]})]})
        scene_prior(scene, sensor_origin(scene, self.cloud))
        self._change(replace(self.sketch, base=base))

    @property
    def regions(self) -> tuple[Picked, ...]:
        """The regions, in the order of the list."""
        return self.sketch.regions

    @property
    def pairs(self) -> tuple[Picked, ...]:
        """The regions with both sides."""
        return tuple(picked for picked in self.regions if picked.is_paired)

    def keys_of(self, names: Sequence[str]) -> list[int]:
        """The keys of regions by their names."""
        keys = {picked.name: picked.key for picked in self.regions}
        return [keys[name] for name in names]

    def select(self, key: int | None) -> None:
        """Work on a region, or on none, so that the next click begins a new one."""
        self.sketch = replace(self.sketch, selected=None if key is None else self.sketch.region(key).key)

    def click_photo(self, pixel: Sequence[float], *, again: bool = False) -> None:
        """Grow a mask at a pixel (x, y) for the selected region, or for a new one where that has a mask already.

        `again`: the selected region's mask is replaced.
        """
        ask = mask_choices if self.segmenter is None else partial(segmenter_choices, self.segmenter)
        self._give("image", ask(self.image, pixel), again)

    def draw_polygon(self, ring: Sequence[Sequence[float]], *, hidden: Sequence[int] = (), again: bool = False) -> None:
        """Give the selected region, or a new one, a polygon of pixels (n, 2), some of whose edges are hidden."""
        written: dict[str, Any] = {"polygon": [[round(float(value), 2) for value in vertex] for vertex in ring]}
        if hidden:
            written["hidden_edges"] = sorted(int(edge) for edge in hidden)
        self._give("image", only(self._image_part(written)), again)

    def click_cloud(self, place: Sequence[float] | Array, *, again: bool = False) -> None:
        """Take the plane around a point (3,) of the world for the selected region, or for a new one, as above.

        A further click at the place takes the next narrower proposal, and the whole plane again after the last.
        """
        selected = self.sketch.selected
        world = None if selected is None else self.sketch.region(selected).world
        if selected is not None and world is not None and self._is_at(world.place, place):
            self.choose(selected, "world", (world.index or len(world)) - 1)
            return
        choices = plane_choices(self.scan, self._scene_with, np.asarray(place, dtype=np.float64))
        self._give("world", choices, again)

    def cut_cloud(self, inside: Callable[[Array], NDArray[np.bool_]], pictured: NDArray[np.int64]) -> None:
        """Give the selected region, or a new one, the points of a plane for which `inside` returns true, of local
        points (n, 3) of the cloud.

        The plane is that of the region's points inside, or, where it has none, of most of those `shown` (k,) inside:
        indices of the points that a picture shows, since others may lie behind them. It is refitted to what it holds
        until that stays, so that it does not depend on how far the region was grown. All of the cloud's points count,
        also those that were not reached: beyond a window, or on a scan line that is off. ValueError for too few points
        inside, or those of one line.
        """
        points = self.cloud.local_points
        start = self._selected_points
        start = pictured if start is None else start
        inner = start[inside(points[start])]
        if len(inner) < LEAST_POINTS:
            raise ValueError(f"found {len(inner)} points inside; needed at least {LEAST_POINTS}")
        for _ in range(MOST_REFITS):
            on_plane = points_on_plane(points, inner, self.scan.scanner)
            before, inner = inner, on_plane[inside(points[on_plane])]
            if np.array_equal(inner, before):
                break
        self._give("world", only(picked_points(self.scan, inner, "cut out")), again=True)

    def choose(self, key: int, side: str, index: int) -> None:
        """Take another proposal of a region's side, "image" or "world"."""
        region = self.sketch.region(key)
        choices: Choices[Any] | None = getattr(region, side)
        if choices is None:
            raise ValueError(f"{region.name} has no side in the {'photo' if side == 'image' else 'cloud'} yet")
        other = choices.at(index)
        if other.index != choices.index:
            _ = other.chosen
            self._change(self.sketch.with_region(region.with_side(side, other)))

    def rename(self, key: int, name: str) -> None:
        """Name a region; ValueError for a name that another has, or that a scene file can't hold."""
        region, cleaned = self.sketch.region(key), name.strip()
        if cleaned == region.name:
            return
        if any(picked.name == cleaned for picked in self.regions):
            raise ValueError(f"found {cleaned!r} twice; needed names that differ")
        self._checked_name(cleaned)
        self._change(self.sketch.with_region(replace(region, name=cleaned)))

    def remove(self, key: int, side: str | None = None) -> None:
        """Remove a region, or one side of it."""
        region = self.sketch.region(key)
        left = None if side is None else region.with_side(side, None)
        if left is None or (left.image is None and left.world is None):
            self._change(self.sketch.without(key))
        else:
            self._change(self.sketch.with_region(left))

    def unpair(self, key: int) -> None:
        """Make two regions of one, the photo's side and the cloud's."""
        region = self.sketch.region(key)
        if not region.is_paired:
            raise ValueError(f"{region.name} is not a pair; needed both sides")
        other = Picked(self._next, self._free_name(), None, region.world)
        self._next += 1
        sketch = self.sketch.with_region(other).with_region(replace(region, world=None))
        self._change(sketch)

    def pair(self, first: int, second: int) -> None:
        """Make one region of two that have one side each, in the photo and in the cloud; it keeps the first's name."""
        one, two = self.sketch.region(first), self.sketch.region(second)
        image, world = one.image or two.image, one.world or two.world
        if one.is_paired or two.is_paired or image is None or world is None:
            raise ValueError(f"{one.name} and {two.name}: needed one side in the photo and one in the cloud")
        self._change(self.sketch.without(second).with_region(replace(one, image=image, world=world)))

    def edit_polygon(
        self, key: int, rings: Sequence[Sequence[Sequence[float]]], hidden: Sequence[Sequence[int]]
    ) -> None:
        """Give a region's polygon other vertices and hidden edges, each for its rings."""
        region = self.sketch.region(key)
        written: dict[str, Any] = {"polygon": [[[round(float(v), 2) for v in vertex] for vertex in r] for r in rings]}
        if any(hidden):
            written["hidden_edges"] = [sorted(int(edge) for edge in edges) for edges in hidden]
        self._change(self.sketch.with_region(replace(region, image=only(self._image_part(_flattened(written))))))

    def as_polygon(self, key: int, tolerance: float) -> None:
        """Make a region's mask a polygon of few vertices, none of its contour farther off than `tolerance` pixels."""
        import shapely

        region = self.sketch.region(key)
        if region.image is None:
            raise ValueError(f"{region.name} has no side in the photo yet")
        rings = [shapely.LinearRing(ring).simplify(tolerance) for ring in region.image.chosen.region.rings]
        corners = [[list(vertex) for vertex in ring.coords[:-1]] for ring in rings if len(ring.coords) > 3]
        self.edit_polygon(key, corners, [])

    @property
    def can_undo(self) -> bool:
        """Whether there is a step to take back."""
        return bool(self._past)

    @property
    def can_redo(self) -> bool:
        """Whether a step that was taken back can be taken again."""
        return bool(self._future)

    def undo(self) -> None:
        """Take the last step back; nothing where there is none."""
        if self._past:
            self._future.append(self.sketch)
            self._take(self._past.pop())

    def redo(self) -> None:
        """Take a step again that was taken back; nothing where there is none."""
        if self._future:
            self._past.append(self.sketch)
            self._take(self._future.pop())

    def _change(self, sketch: Sketch) -> None:
        self._past, self._future = [*self._past[-MOST_UNDO + 1 :], self.sketch], []
        self._take(sketch)

    def _take(self, sketch: Sketch) -> None:
        self.sketch = sketch

    def _give(self, side: str, choices: Choices[Any], again: bool) -> None:
        selected = None if self.sketch.selected is None else self.sketch.region(self.sketch.selected)
        if selected is None or (getattr(selected, side) is not None and not again):
            selected = Picked(self._next, self._free_name())
            self._next += 1
        self._change(self.sketch.with_region(selected.with_side(side, choices)))

    def _free_name(self) -> str:
        names = {picked.name for picked in self.regions}
        return next(name for number in range(1, len(names) + 2) if (name := f"region {number}") not in names)

    def _checked_name(self, name: str) -> None:
        try:
            self._scene([alone(STAND_IN, {"seed": [0.0, 0.0, 0.0]}) | {"name": name}])
        except ValueError as error:
            raise ValueError("needed a name of 1 to 200 characters on one line") from error

    def _is_at(self, clicked: tuple[float, float, float] | None, place: Sequence[float] | Array) -> bool:
        """Whether a click is at the place of one before, as seen from the scanner, or from the cloud's zero."""
        if clicked is None:
            return False
        eye = np.zeros(3) if self.scanner is None else self.scanner
        one, other = np.asarray(clicked, dtype=np.float64), np.asarray(place, dtype=np.float64)
        return float(np.linalg.norm(other - one)) <= SAME_PLACE * float(np.linalg.norm(one - eye))

    @property
    def _selected_points(self) -> NDArray[np.intp] | None:
        """Indices of the selected region's points of the cloud; None where it has none."""
        selected = self.sketch.selected
        world = None if selected is None else self.sketch.region(selected).world
        return None if world is None else world.chosen.side.indices

    def _again(self, picked: Picked) -> Picked:
        """The region with its side in the cloud made again, the one that is taken."""
        if picked.world is None:
            return picked
        part = picked.world.chosen
        if part.picked:
            again = picked_points(self.scan, self.cloud.from_file_indices(part.written["points"]), part.label)
        else:
            again = self._world_part(part.written, part.label)
        return replace(picked, world=only(again))

    def _image_part(self, written: dict[str, Any]) -> ImagePart:
        scene = self._scene([alone(written, {"seed": [0.0, 0.0, 0.0]})])
        item = scene.model.regions[0].image
        return ImagePart(written, image_side(scene, ("regions", 0, "image"), item, self.image))

    def _world_part(self, written: dict[str, Any], label: str = "") -> WorldPart:
        return picked_world(self._scene_with(written), written, self.scan, label)

    def _scene_with(self, world: dict[str, Any]) -> Scene:
        """A scene of one region with this side in the cloud."""
        return self._scene([alone(STAND_IN, world)])

    def _scene(self, regions: list[dict[str, Any]]) -> Scene:
        return scene_of(self.path, {**self.base, "regions": regions})


def alone(image: dict[str, Any], world: dict[str, Any]) -> dict[str, Any]:
    """The values of the one region of a scene."""
    return {"name": "region", "image": image, "world": world}


def _flattened(written: dict[str, Any]) -> dict[str, Any]:
    """A polygon of a single ring as that ring, as people write it."""
    if len(written["polygon"]) > 1:
        return written
    return {key: value[0] for key, value in written.items()}
