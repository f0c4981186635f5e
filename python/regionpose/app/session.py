"""A picking session: a scene file that is read, edited and saved, and the poses of what it holds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from regionpose.app.edge_scene import bare_sides, compares_edges, without_regions
from regionpose.app.editor import STAND_IN, Editor, alone
from regionpose.app.parts import Choices, Levels, Picked, only
from regionpose.app.scene_text import check_scene, mask_name, points_name, region_lists, scene_of, scene_text
from regionpose.app.sketch import Sketch
from regionpose.io.outputs import Writer, claimed, text_writer
from regionpose.progress import with_progress
from regionpose.scene.document import SceneError
from regionpose.scene.estimate import SceneEstimate, estimate_frames, estimate_regions, estimate_sides
from regionpose.scene.exposure import SceneData, Unpaired, checked
from regionpose.scene.loading import Scene, load_scene
from regionpose.scene.models import PLANES
from regionpose.scene.paths import relative
from regionpose.scene.region_sides import Scan, WorldSide, plane_sides, scene_origin
from regionpose.scene.sensors import read_sensors, sensor_origin
from regionpose.scene.stages import Stages

NO_PAIR = "found no pair; needed a region with a side in the photo and one in the cloud"


@dataclass(eq=False)
class Session(Editor):
    """Regions picked in the photo and the cloud of a scene, which `save` writes to its `path`."""

    _saved: Sketch = field(init=False)
    _planes: dict[str, WorldSide] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """What there is at first needs no saving."""
        self._saved = self.sketch

    @classmethod
    def create(
        cls,
        path: Path,
        *,
        image: Path,
        camera: Path,
        cloud: Path,
        columns: Sequence[str] | None = None,
        stages: Stages | None = None,
        **extra: Any,
    ) -> Session:
        """A session without regions, to be saved at `path`; errors as of reading a scene's files.

        `columns`: names of the cloud's columns, where its file has none. `stages` reports how much of the files is
        read. FileNotFoundError where the folder is missing that it is to be saved in.
        """
        if not path.parent.is_dir():
            raise FileNotFoundError(f"{path.parent}: no such folder; needed one to save {path.name} in")
        folder = path.resolve().parent
        files = {"camera": camera, "image": image, "cloud": cloud}
        base: dict[str, Any] = {key: relative(file, folder) for key, file in files.items()}
        if columns is not None:
            base["cloud"] = {"file": base["cloud"], "columns": list(columns)}
        return cls._with_sensors(path, {**base, **extra}, stages or Stages())

    @classmethod
    def open(cls, path: Path, *, stages: Stages | None = None) -> Session:
        """The session of a scene file, with its regions; errors as of `load_scene` and of its files.

        `stages` reports how much of files and regions is read.
        """
        scene, stages = load_scene(path), stages or Stages()
        values = dict(scene.document.value) if isinstance(scene.document.value, dict) else {}
        if scene.model.frames:
            raise scene.error(("frames",), f"found {len(scene.model.frames)} frames; needed a scene of one photo")
        return cls.of_values(path, values, stages)

    @classmethod
    def of_values(cls, path: Path, values: dict[str, Any], stages: Stages) -> Self:
        """The session of a scene file at `path` with one photo; errors as of its files."""
        values = dict(values)
        held_lists = {key: values.get(key, []) for key in ("regions", "image_regions", "world_regions")}
        lists = {key: values.pop(key, []) for key, items in held_lists.items() if isinstance(items, list)}
        session = cls._with_sensors(path, values, stages)
        with stages.stage("regions"):
            for written, _ in with_progress([region for items in lists.values() for region in items], stages.progress):
                session._read(written)
        session._saved = session.sketch = replace(session.sketch, selected=None)
        return session

    @classmethod
    def _with_sensors(cls, path: Path, base: dict[str, Any], stages: Stages) -> Self:
        scene = scene_of(path, {**base, "regions": [alone(STAND_IN, {"seed": [0.0, 0.0, 0.0]})]})
        image, camera, cloud = read_sensors(scene, stages)
        if cloud is None:
            raise SceneError(f"{path}: found no cloud; needed one to pick in")
        scan = Scan.of(cloud, scene_origin(scene, cloud), sensor_origin(scene, cloud))
        return cls(path, camera, image, cloud, Sketch(base, scan))

    def _read(self, written: dict[str, Any]) -> None:
        """Add a region that the scene file holds."""
        parts: dict[str, Any] = {"key": self._next, "name": written["name"]}
        if "image" in written:
            parts["image"] = only(self._image_part(written["image"]))
        if "world" in written:
            parts["world"] = only(self._world_part(written["world"]))
        self._next += 1
        self.sketch = self.sketch.with_region(Picked(**parts))

    @property
    def can_estimate(self) -> bool:
        """Whether there is a pair, or regions of either side to be matched."""
        return bool(self.pairs) or self._can_match

    @property
    def searches_edges(self) -> bool:
        """Whether the pose comes from the edges of photo and cloud: there is no pair, and nothing to be matched."""
        return not self.can_estimate and compares_edges(self.base)

    @property
    def has_estimate(self) -> bool:
        """Whether there is anything that a pose comes from."""
        return self.can_estimate or self.searches_edges

    @property
    def basis(self) -> list[tuple[int, object, object]]:
        """What the estimate is made of, beside `base`: key and sides of the pairs, and of all regions where some can be
        matched.
        """
        return [
            (picked.key, picked.image and picked.image.chosen, picked.world and picked.world.chosen)
            for picked in (self.regions if self._can_match else self.pairs)
        ]

    @property
    def _can_match(self) -> bool:
        """Whether there are regions with one side only; planes are not searched for this."""
        in_photo = any(picked.world is None for picked in self.regions)
        return in_photo and (self._matches_planes or any(picked.image is None for picked in self.regions))

    @property
    def _matches_planes(self) -> bool:
        """Whether the photo's own regions are to be matched with all planes of the cloud."""
        return self.base.get("world_regions") == PLANES and all(picked.image is not None for picked in self.regions)

    @property
    def is_changed(self) -> bool:
        """Whether there is something to save."""
        return (self.sketch.regions, self.base) != (self._saved.regions, self._saved.base)

    @property
    def can_save(self) -> bool:
        """Whether there is something to save, or no file yet."""
        return self.is_changed or not self.path.exists()

    def _take(self, sketch: Sketch) -> None:
        if sketch.scan is not self.scan:
            self._planes = {}  # They rest on the scanner's place, too.
        super()._take(sketch)

    def values(self) -> dict[str, Any]:
        """The scene file as plain values."""
        return {**self.base, **region_lists(self.regions, self.path)}

    def sides(self) -> SceneData:
        """Sensors and both sides of the pairs, and the regions to be matched; ValueError without any."""
        pairs = self.pairs
        if not self.can_estimate:
            raise ValueError(NO_PAIR)
        scene = scene_of(self.path, self.values())
        sides = SceneData(
            scene,
            self.camera,
            self.image,
            self.cloud,
            self.scan.origin,
            sensor_origin(scene, self.cloud),
            tuple(picked.name for picked in pairs),
            tuple(_chosen(picked.image).region for picked in pairs),
            tuple(_chosen(picked.world).side for picked in pairs),
            self._unpaired(),
        )
        return checked(sides)

    def _unpaired(self) -> Unpaired:
        """The regions of one side, which the estimate matches where there are some of either."""
        images = [picked for picked in self.regions if picked.world is None]
        worlds = {picked.name: _chosen(picked.world).side for picked in self.regions if picked.image is None}
        if images and self._matches_planes:
            if not self._planes:
                self._planes.update(plane_sides(scene_of(self.path, self.values()), self.scan))
            worlds = self._planes
        image_regions = tuple(_chosen(picked.image).region for picked in images)
        names = tuple(picked.name for picked in images)
        return Unpaired(names, image_regions, tuple(worlds), tuple(worlds.values()))

    def estimate(self, stages: Stages | None = None) -> SceneEstimate:
        """The pose by the pairs and by what matches of the rest, as `regionpose estimate` on the saved file gives it;
        PoseError where there is none.
        """
        return estimate_sides(self.sides(), stages)

    def estimate_regions(self, stages: Stages | None = None) -> SceneEstimate:
        """The pose by the regions alone, which is there soon; `scene.estimate.with_edges` goes on with it."""
        sides = self.sides()
        return estimate_regions(sides.scene, [sides], stages)

    def edge_values(self) -> dict[str, Any]:
        """The scene of the pose by edges as plain values: without regions, of all frames of a rig."""
        return without_regions(self.base)

    def estimate_edges(self, values: dict[str, Any], stages: Stages | None = None) -> SceneEstimate:
        """The pose by the edges of photo and cloud alone, of a scene as of `edge_values`; PoseError where there is
        none.
        """
        scene, stages = scene_of(self.path, values), stages or Stages()
        # Planes that confirm it take as long again, and the page does not show them.
        return estimate_frames(scene, self._edge_sides(scene, stages), stages, with_planes=False)

    def _edge_sides(self, scene: Scene, stages: Stages) -> list[SceneData]:
        """Photo and cloud of each frame of a scene without regions."""
        return [bare_sides(scene, self.image, self.camera, self.cloud)]

    def save(self) -> list[Path]:
        """Write the scene file, its masks and its points, whole or not at all, and return their paths.

        A mask, or a file of points, has a name of its own for what it holds, so that none is replaced; the scene file
        goes last. SceneError, a ValueError, for regions of one side alone that nothing can be matched with.
        """
        values = self.values()
        check_scene(self.path, values)
        writers = {**self.part_writers(), self.path.name: text_writer(scene_text(values))}
        with claimed(self.path.parent, list(writers), force=True) as claim:
            written = claim.write(writers)
        self.mark_saved()
        return written

    def mark_saved(self) -> None:
        """What there is now needs no saving."""
        self._saved = self.sketch

    def part_writers(self) -> dict[str, Writer]:
        """What writes the masks and the points that were picked, by their names beside the scene file."""
        writers: dict[str, Writer] = {}
        for picked in self.regions:
            if picked.image is not None and picked.image.chosen.picked:
                part = picked.image.chosen
                writers[mask_name(part, self.path)] = partial(_write_mask, part.levels)
            if picked.world is not None and picked.world.chosen.picked:
                cut = picked.world.chosen
                writers[points_name(cut, self.path)] = partial(_write_points, cut.written["points"])
        return writers


def _chosen(choices: Choices[Any] | None) -> Any:
    """The proposal that is taken, of a side that is known to be there."""
    assert choices is not None
    return choices.chosen


def _write_points(indices: NDArray[np.intp], path: Path) -> None:
    with path.open("wb") as file:
        np.save(file, np.asarray(indices, dtype=np.int64))


def _write_mask(levels: Levels, path: Path) -> None:
    Image.fromarray(levels).save(path, format="PNG")
