"""The frames of a rig, picked one after the other: a session each, and one scene file with all of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from regionpose.app.edge_scene import bare_sides, without_regions
from regionpose.app.scene_text import check_scene, scene_text
from regionpose.app.session import Session
from regionpose.cameras import Camera
from regionpose.io.clouds import Cloud
from regionpose.io.outputs import Writer, claimed, text_writer
from regionpose.scene.document import SceneError
from regionpose.scene.estimate import frame_label
from regionpose.scene.exposure import SceneData
from regionpose.scene.folder import SHARED, folder_pairs
from regionpose.scene.loading import Scene, load_scene
from regionpose.scene.paths import rebased, relative
from regionpose.scene.sensors import Picture, read_sensors
from regionpose.scene.stages import Stages

Plain = dict[str, Any]
Sensors = tuple[Picture, Camera, Cloud | None]

SCENE_FILE = "scene.yaml"
"""The scene file of a folder."""


class Frames:
    """Sessions of photos and clouds with one pose, made when they are turned to.

    `path`: the scene file that any of them saves, with all frames that have regions, or all where none has.
    `names`: the frames', in order.
    `index`: of the one that is worked on. Not safe for several threads at once.
    """

    def __init__(self, path: Path, shared: Plain, frames: list[Plain]) -> None:
        """Take the scene file's values for all frames and for each; ValueError without any frame."""
        if not frames:
            raise ValueError(f"{path}: found no frame; needed a photo with a cloud")
        self.path, self._shared, self._frames = path, shared, frames
        self._sessions: dict[int, FrameSession] = {}
        self._sensors: dict[int, Sensors] = {}
        self.index = 0

    @classmethod
    def of_scene(cls, path: Path) -> Frames:
        """Those of a scene file with frames; errors as of `load_scene`."""
        value = load_scene(path).document.value
        assert isinstance(value, dict)
        return cls(path, {key: entry for key, entry in value.items() if key != "frames"}, list(value["frames"]))

    @classmethod
    def of_folder(cls, folder: Path, camera: Path | None) -> Frames:
        """Those of a folder of pairs, after what its scene file holds of them already; SceneError as of `folder_pairs`,
        and where nothing identifies the camera.
        """
        path = folder / SCENE_FILE
        entry = cls.of_scene(path) if path.is_file() else None
        shared = {} if entry is None else dict(entry._shared)
        frames = [] if entry is None else list(entry._frames)
        names = {frame["name"] for frame in frames}
        for pair in folder_pairs(folder)[0]:
            values = {} if pair.document is None else rebased(pair.document_values, pair.document.path.parent, folder)
            own = {key: value for key, value in values.items() if key not in SHARED}
            shared |= {key: value for key, value in values.items() if key in SHARED and key not in shared}
            if pair.name not in names:
                cloud = {} if pair.cloud is None else {"cloud": relative(pair.cloud, folder)}
                frames.append({**own, "name": pair.name, "image": relative(pair.photo, folder), **cloud})
        if camera is not None:
            shared["camera"] = relative(camera, folder)
        if "camera" not in shared:
            raise SceneError(f"{folder}: found no camera; needed --camera, or the key camera in a pair's scene file")
        return cls(path, shared, frames)

    def __len__(self) -> int:
        """How many frames there are."""
        return len(self._frames)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the frames."""
        return tuple(str(frame["name"]) for frame in self._frames)

    def session_at(self, index: int, stages: Stages | None = None) -> Session:
        """The session of a frame, which is worked on from now on; errors as of `Session.open`, the old one staying."""
        index = min(max(index, 0), len(self) - 1)
        session = self._sessions.get(index)
        if session is None:
            own = {key: entry for key, entry in self._frames[index].items() if key != "name"}
            session = FrameSession.of_values(self.path, {**self._shared, **own}, stages or Stages())
            session.frames = self
            self._sessions[index] = session
            self._sensors[index] = (session.image, session.camera, session.cloud)
        before = self._sessions.get(self.index)
        if before is not None and before is not session:
            # The prior holds for all frames.
            kept = {key: entry for key, entry in session.base.items() if key not in SHARED}
            shared = {key: before.base[key] for key in SHARED if key in before.base}
            session.sketch = replace(session.sketch, base={**shared, **kept})
        self.index = index
        return session

    @property
    def is_changed(self) -> bool:
        """Whether a frame has something to save."""
        return any(session.is_own_changed for session in self._sessions.values())

    def values(self) -> Plain:
        """The scene file as plain values: all frames with regions, as they are or were read; where none has a pair,
        all frames with a cloud.
        """
        frames = [self._values(index) for index in range(len(self))]
        paired = [one for one in frames if _has_pair(one)]
        return self._of_rig | {"frames": paired or [one for one in frames if one.get("cloud")]}

    @property
    def _of_rig(self) -> Plain:
        """The scene file's values for all frames."""
        current = self._sessions.get(self.index)
        base = self._shared if current is None else current.base
        return {key: base[key] for key in SHARED if key in base}

    def edge_values(self) -> Plain:
        """The scene of all frames with a cloud, without regions, as plain values."""
        frames = [without_regions(self._values(index)) for index in range(len(self))]
        return self._of_rig | {"frames": [one for one in frames if one.get("cloud")]}

    def edge_sides(self, scene: Scene, stages: Stages) -> list[SceneData]:
        """Photo and cloud of each frame of a scene as of `edge_values`, read where they were not before; SceneError
        for files that cannot be used.
        """
        found: list[SceneData] = []
        for number, frame in enumerate(scene.frames):
            index = self.names.index(frame.name)
            if index not in self._sensors:
                with stages.within(frame_label(frame, number, len(scene.frames))):
                    self._sensors[index] = read_sensors(frame, stages)
            image, camera, cloud = self._sensors[index]
            assert cloud is not None
            found.append(bare_sides(frame, image, camera, cloud, found[0].origin if found else None))
        return found

    def _values(self, index: int) -> Plain:
        entry = self._frames[index]
        session = self._sessions.get(index)
        if session is None:
            return entry
        own = {key: value for key, value in session.values().items() if key not in SHARED}
        return {"name": entry["name"], **own}

    def save(self) -> list[Path]:
        """Write the scene file of all frames, with the masks and points of those that were looked at, whole or not at
        all; their paths, the scene file last. SceneError, a ValueError, for regions of one side alone, of which no
        frame has a pair.
        """
        values = self.values()
        check_scene(self.path, values)
        writers: dict[str, Writer] = {}
        for session in self._sessions.values():
            writers |= session.part_writers()
        writers[self.path.name] = text_writer(scene_text(values))
        with claimed(self.path.parent, list(writers), force=True) as claim:
            written = claim.write(writers)
        for session in self._sessions.values():
            session.mark_saved()
        return written


class FrameSession(Session):
    """The session of one of several frames, which saves all of them."""

    frames: Frames

    @property
    def is_own_changed(self) -> bool:
        """Whether this frame has something to save."""
        return super().is_changed

    @property
    def is_changed(self) -> bool:
        """Whether any frame has something to save."""
        return self.frames.is_changed

    def edge_values(self) -> dict[str, Any]:
        """The scene of the pose by edges as plain values, as of `Frames.edge_values`."""
        return self.frames.edge_values()

    def _edge_sides(self, scene: Scene, stages: Stages) -> list[SceneData]:
        return self.frames.edge_sides(scene, stages)

    def save(self) -> list[Path]:
        """Save all frames; errors and paths as of `Frames.save`."""
        return self.frames.save()


def _has_pair(frame: Mapping[str, Any]) -> bool:
    """Whether a frame shows something of the pose: a pair, or regions of either side to be matched."""
    return bool(frame.get("regions") or (frame.get("image_regions") and frame.get("world_regions")))
