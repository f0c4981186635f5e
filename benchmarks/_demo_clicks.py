"""Sessions of the demo's photo and cloud without regions, and where its signs are clicked."""

from __future__ import annotations

from pathlib import Path
from typing import TypedDict

from regionpose.app.session import Session
from regionpose.datasets.demo import demo_folder

DOOR = ([463.0, 498.0], [4.629, 5.132, 0.972])
BOARD = ([159.0, 501.0], [2.676, 6.081, 0.842])
CHALKBOARD = ([850.0, 769.0], [4.190, 2.048, -0.997])
"""A pixel and a point of each."""


class DemoFiles(TypedDict):
    """What a session is made of."""

    image: Path
    camera: Path
    cloud: Path


def demo_files() -> DemoFiles:
    """The photo, its camera and the cloud."""
    files = demo_folder()
    return {"image": files / "image.jpg", "camera": files / "camera_info.yaml", "cloud": files / "cloud.ply"}


def demo_session(path: Path) -> Session:
    """The session of a scene file that is not written yet, whose scanner stands at zero."""
    return Session.create(path, sensor_origin=[0.0, 0.0, 0.0], **demo_files())


def click_sign(session: Session, place: list[float]) -> None:
    """Click a face in the cloud until its narrowest proposal is taken, as that of a sign on a wall."""
    session.click_cloud(place)
    selected = session.sketch.selected
    assert selected is not None
    world = session.sketch.region(selected).world
    assert world is not None
    for _ in range(len(world) - 1):
        session.click_cloud(place)
