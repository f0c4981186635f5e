"""Frames of a rig picked one after the other."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from regionpose.app.frames import Frames, FrameSession
from regionpose.app.prior_settings import PriorSettings
from regionpose.app.session import Session
from regionpose.app.shared_session import SharedSession
from regionpose.cli.pick import _session
from regionpose.scene.document import SceneError
from regionpose.scene.loading import load_scene
from regionpose.scene.stages import Stages

from benchmarks._demo_clicks import CHALKBOARD, demo_files

SQUARES = [[[x, 700.0], [x + 60.0, 700.0], [x + 60.0, 780.0], [x, 780.0]] for x in (800.0, 820.0)]
NOTHING: dict[str, Path | None] = {"--image": None, "--camera": None, "--cloud": None}


@pytest.fixture
def drive(tmp_path: Path) -> Path:
    """A folder of three pairs, without a scene file."""
    folder, files = tmp_path / "drive", demo_files()
    folder.mkdir()
    for name in ("0001", "0002", "0003"):
        shutil.copy(files["image"], folder / f"{name}.jpg")
        shutil.copy(files["cloud"], folder / f"{name}.ply")
    shutil.copy(files["camera"], tmp_path / "camera.yaml")
    return folder


def picked(frames: Frames, index: int) -> Session:
    """A frame with a pair."""
    session = frames.session_at(index)
    session.draw_polygon(SQUARES[index])
    session.click_cloud(CHALKBOARD[1])
    return session


def test_frames_are_saved_as_one_scene_and_read_again(drive: Path) -> None:
    camera = drive.parent / "camera.yaml"
    frames = Frames.of_folder(drive, camera)
    assert frames.names == ("0001", "0002", "0003")
    first = picked(frames, 0)
    first.set_prior_settings(PriorSettings(up=(0.0, 0.0, 1.0)))
    second = picked(frames, 1)
    assert second.prior_settings.up == (0.0, 0.0, 1.0) and second.is_changed
    written = second.save()
    assert written[-1] == drive / "scene.yaml" and not first.is_changed and not second.is_changed
    scene = load_scene(drive / "scene.yaml")
    assert [frame.name for frame in scene.frames] == ["0001", "0002"]
    assert scene.model.prior.up == [0.0, 0.0, 1.0]
    assert all(len(frame.model.regions) == 1 for frame in scene.frames)
    assert all(scene.file(frame.image).is_file() for frame in scene.frames)
    again = Frames.of_folder(drive, None)
    assert again.names == ("0001", "0002", "0003")
    read = again.session_at(1)
    assert not read.is_changed and len(read.pairs) == 1
    mine, theirs = (session.regions[0].world for session in (second, read))
    assert mine is not None and theirs is not None
    np.testing.assert_array_equal(mine.chosen.side.indices, theirs.chosen.side.indices)
    # A frame that was not looked at stays as it was read.
    read.undo()
    read.rename(read.regions[0].key, "board")
    read.save()
    assert [frame.model.regions[0].name for frame in load_scene(drive / "scene.yaml").frames] == ["region 1", "board"]


def test_the_command_opens_folders_and_scenes_of_frames(drive: Path) -> None:
    camera = drive.parent / "camera.yaml"
    session = _session(drive, {**NOTHING, "--camera": camera}, None, False, Stages())
    assert isinstance(session, FrameSession) and len(session.frames) == 3
    with pytest.raises(SceneError, match="found no camera"):
        _session(drive, NOTHING, None, False, Stages())
    with pytest.raises(ValueError, match="--image: found it beside"):
        _session(drive, {**NOTHING, "--image": drive / "0001.jpg"}, None, False, Stages())
    session.draw_polygon(SQUARES[0])
    with pytest.raises(SceneError, match=r"frames\[0\]\.regions: found regions of one side"):
        session.save()
    session.click_cloud(CHALKBOARD[1])
    session.save()
    again = _session(drive / "scene.yaml", NOTHING, None, False, Stages())
    assert isinstance(again, FrameSession) and again.frames.names == ("0001",)


def test_a_desk_turns_to_another_frame(drive: Path) -> None:
    frames = Frames.of_folder(drive, drive.parent / "camera.yaml")
    shared = SharedSession(frames.session_at(0))
    try:
        shared.edit(lambda session: session.draw_polygon(SQUARES[0]))
        revision = shared.revision
        shared.show_session(frames.session_at(1))
        assert shared.session is frames.session_at(1) and shared.revision > revision
        assert shared.photo_shapes() == [] and shared.outcome.state == "busy" and shared.outcome.searches_edges
        shared.show_session(frames.session_at(0))
        assert len(shared.photo_shapes()) == 1
    finally:
        shared.close()
