"""Paths in written files, each relative to the folder of the file that names it."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

FILE_KEYS = {"camera", "image", "cloud", "file", "mask", "unknown", "points", "mesh"}
"""Keys of a scene file under which text is a path; but for the image within a COCO file, beside `mask`."""


def rebased(node: Any, source: Path, folder: Path) -> Any:
    """Values of a scene file in the folder `source` with their paths relative to another folder."""
    if isinstance(node, list):
        return [rebased(value, source, folder) for value in node]
    if not isinstance(node, dict):
        return node
    values = {}
    for key, value in node.items():
        is_path = key in FILE_KEYS and isinstance(value, str) and not (key == "image" and "mask" in node)
        values[key] = relative(source / value, folder) if is_path else rebased(value, source, folder)
    return values


def relative(path: Path, folder: Path) -> str:
    """The path as a file in `folder` names it: relative to it, or absolute where there is no way, as to another drive.

    A link keeps its name, which tools look photos up by.
    """
    place = path.parent.resolve() / path.name
    try:
        return Path(os.path.relpath(place, folder.resolve())).as_posix()
    except ValueError:
        return place.as_posix()
