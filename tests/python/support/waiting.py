"""A scene whose run waits until it is ended: its segmenter gives no answer."""

from __future__ import annotations

import time
from pathlib import Path

from scene_files import scene_values, write_scene

ARGUMENTS = ("--segmenter", "waiting:segmenter")
"""Of a command that is run in `FOLDER`."""

FOLDER = Path(__file__).parent

LONGEST_S = 600.0
"""Until then a test that failed has a process of its own."""


def segmenter(*_: object) -> None:
    """Give no answer."""
    time.sleep(LONGEST_S)


def write_waiting_scene(folder: Path) -> Path:
    """The path of a scene that asks a segmenter about its first region, written to `folder` with its image."""
    values = scene_values()
    values["regions"][0]["image"] = {"seed": [20.0, 20.0]}
    return write_scene(folder, values)
