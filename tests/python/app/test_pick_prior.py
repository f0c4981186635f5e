"""The prior of the pose as the picking page edits it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError
from regionpose.app.prior_settings import PriorSettings, initial_pose, looking
from regionpose.app.scene_text import scene_of
from regionpose.app.session import Session
from regionpose.cli.prior_options import PriorOptions
from regionpose.scene.document import SceneError
from regionpose.scene.loading import load_scene
from regionpose.scene.sensors import sensor_origin
from regionpose.scene.solver_config import scene_prior

from benchmarks._demo_clicks import demo_session

SQUARE = [[100.0, 100.0], [160.0, 100.0], [160.0, 150.0], [100.0, 150.0]]


@pytest.fixture
def session(tmp_path: Path) -> Session:
    return demo_session(tmp_path / "scene.yaml")


def test_a_camera_looks_along_its_axis_with_up_above() -> None:
    pose = looking(np.array([1.0, 2.0, 3.0]), np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0]))
    ahead, left, above = pose.transform(np.array([[5.0, 2.0, 3.0], [1.0, 4.0, 3.0], [1.0, 2.0, 9.0]]))
    np.testing.assert_allclose(ahead, [0.0, 0.0, 4.0], atol=1e-12)
    np.testing.assert_allclose(left, [-2.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(above, [0.0, -6.0, 0.0], atol=1e-12)
    down = looking(np.zeros(3), np.array([0.0, 0.0, -1.0]), np.array([0.0, 0.0, 1.0]))
    np.testing.assert_allclose(down.transform(np.array([[0.0, 0.0, -2.0]])), [[0.0, 0.0, 2.0]], atol=1e-12)


def test_what_is_known_is_saved_and_read_again(session: Session, tmp_path: Path) -> None:
    settings = PriorSettings(
        near_sigma_m=0.5, ahead=(1.0, 1.0, 0.0), ahead_sigma_deg=30.0, up=(0.0, 0.0, 2.0), up_sigma_deg=5.0
    )
    session.set_prior_settings(settings)
    assert session.is_changed and session.can_undo
    session.draw_polygon(SQUARE)
    session.click_cloud([4.190, 2.048, -0.997])
    session.save()
    scene = load_scene(tmp_path / "scene.yaml")
    prior = scene_prior(scene, sensor_origin(scene, session.cloud))
    assert prior.up == (0.0, 0.0, 2.0) and prior.up_sigma_deg == 5.0
    assert prior.camera_near == (0.0, 0.0, 0.0) and prior.camera_near_sigma_m == 0.5
    assert prior.initial_rotation_sigma_deg == 30.0 and prior.initial_center_sigma_m == 0.5
    assert prior.initial is not None
    np.testing.assert_allclose(prior.initial.camera_center, 0.0, atol=1e-6)
    np.testing.assert_allclose(prior.initial.rotation.as_matrix()[2], np.sqrt([0.5, 0.5, 0.0]), atol=1e-8)
    again = Session.open(tmp_path / "scene.yaml").prior_settings
    assert again.up == settings.up and again.near_sigma_m == 0.5 and again.ahead is not None
    np.testing.assert_allclose(again.ahead, np.sqrt([0.5, 0.5, 0.0]), atol=1e-8)


def test_a_mount_says_where_the_camera_stands_once(session: Session) -> None:
    given = PriorOptions.of("0.4", "z", ["left"], None).prior()
    session.set_prior(given)
    settings = session.prior_settings
    assert (
        not settings.is_anywhere
        and settings.ahead == pytest.approx((0.0, 1.0, 0.0))
        and settings.ahead_sigma_deg == 20.0
    )
    session.set_prior_settings(settings)
    scene = scene_of(session.path, session.values())
    prior = scene_prior(scene, sensor_origin(scene, session.cloud))
    assert prior.camera_near is None and prior.initial_center_sigma_m == 0.4
    session.set_prior_settings(replace(settings, near=(0.1, 0.0, 0.0)))
    scene = scene_of(session.path, session.values())
    assert scene_prior(scene, sensor_origin(scene, session.cloud)).camera_near == (0.1, 0.0, 0.0)
    session.set_prior_settings(PriorSettings(is_anywhere=True))
    assert session.prior_settings.is_anywhere
    with pytest.raises(SceneError, match="prior: up"):
        session.set_prior({"up": [0.0, 0.0, 0.0]})


def test_an_initial_pose_of_the_file_stays_where_nothing_else_is_said_of_it(session: Session) -> None:
    rough = looking(np.array([0.3, 0.0, 0.1]), np.array([0.6, 0.8, 0.0]), np.array([0.1, 0.0, 1.0]))
    given = {"world_from_camera": {"matrix": rough.inverse().matrix.tolist()}}
    session.base["prior"] = {"initial": given}
    read = initial_pose(session.base["prior"])
    assert read is not None
    np.testing.assert_allclose(read.matrix, rough.matrix, atol=1e-12)
    session.set_prior_settings(replace(session.prior_settings, up=(0.0, 0.0, 1.0)))
    assert session.base["prior"] == {"initial": given, "up": [0.0, 0.0, 1.0]}
    session.set_prior_settings(PriorSettings())
    assert "prior" not in session.base
    session.undo()
    assert session.base["prior"]["initial"] == given


def test_a_camera_that_may_stand_anywhere_is_not_near_the_scanner(session: Session) -> None:
    session.set_prior_settings(PriorSettings(is_anywhere=True))
    assert session.base["prior"] == {"camera_near": None}
    assert session.prior_settings.is_anywhere and session.prior_settings.text


@pytest.mark.parametrize(
    "settings",
    [
        PriorSettings(up=(0.0, 0.0, 0.0)),
        PriorSettings(up=(0.0, float("nan"), 1.0)),
        PriorSettings(ahead=(0.0, 0.0, 0.0)),
        PriorSettings(near_sigma_m=-1.0),
        PriorSettings(up=(0.0, 0.0, 1.0), up_sigma_deg=-2.0),
        PriorSettings(ahead=(1.0, 0.0, 0.0), is_anywhere=True),
    ],
)
def test_what_is_nothing_to_know_changes_nothing(session: Session, settings: PriorSettings) -> None:
    before = session.sketch
    with pytest.raises(ValueError, match="needed") as told:
        session.set_prior_settings(settings)
    assert session.sketch is before
    assert not isinstance(told.value, ValidationError)


@pytest.mark.parametrize(
    ("settings", "key"),
    [
        (PriorSettings(near_sigma_m=-1.0), "camera_near_sigma_m"),
        (PriorSettings(up=(0.0, 0.0, 1.0), up_sigma_deg=-1.0), "up_sigma_deg"),
    ],
)
def test_a_bad_deviation_is_refused_as_in_a_scene_file(session: Session, settings: PriorSettings, key: str) -> None:
    with pytest.raises(SceneError) as told:
        session.set_prior_settings(settings)
    assert str(told.value) == f"{session.path}: prior.{key}: found -1.0; needed greater than 0"
