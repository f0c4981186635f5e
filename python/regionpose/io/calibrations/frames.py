"""ROS' transforms between frames (tf, tf_static): the camera's frame, the cloud's, and the way between them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from regionpose.geometry.pose import Pose
from regionpose.io.calibrations.pose_values import Names, Read, numbers_of, pose_of_quaternion

OPTICAL = re.compile(r"optical", re.IGNORECASE)
"""What ROS (REP 103) calls a camera's frame with z forward; others have x forward."""

LIDAR = re.compile(r"lidar|laser|velodyne|livox|ouster|hesai|rslidar|robosense|pandar|os_sensor", re.IGNORECASE)
"""What frames of lidars are called."""

Edges = dict[tuple[str, str], Pose]
"""Poses that take points of the second frame, the child, to the first, its parent."""


def transforms_of(value: Any) -> list[dict[str, Any]]:
    """The transforms of a message: its list `transforms`, or the message of one; none where it is something else."""
    items = value.get("transforms") if isinstance(value, dict) else None
    items = items if isinstance(items, list) else [value]
    keys = {"header", "child_frame_id", "transform"}
    found = [one for one in items if isinstance(one, dict) and keys <= one.keys() and isinstance(one["header"], dict)]
    return found if len(found) == len(items) else []


def tf_pose(path: Path, value: Any, names: Names) -> Read:
    """The optical frame's pose in the lidar's frame; ValueError where the frames' names don't identify both."""
    edges: Edges = {}
    for one in transforms_of(value):
        parent, child = _frame(path, one["header"].get("frame_id")), _frame(path, one["child_frame_id"])
        edges[parent, child] = _pose(path, one["transform"])
    frames = list(dict.fromkeys(frame for pair in edges for frame in pair))
    camera = _only(path, frames, [one for one in frames if OPTICAL.search(one)], names, "optical frame of a camera")
    remaining = [one for one in frames if one != camera]
    lidars = [one for one in remaining if LIDAR.search(one)]
    cloud = remaining[0] if len(remaining) == 1 else _only(path, frames, lidars, names, "frame of a lidar")
    return _way(path, edges, cloud, camera), f"takes points of the frame {cloud} to {camera}, quaternion x y z w"


def _frame(path: Path, name: object) -> str:
    if not isinstance(name, str) or not name:
        raise ValueError(f"{path}: transforms: found a frame without a name; needed frame_id and child_frame_id")
    return name.lstrip("/")


def _pose(path: Path, transform: Any) -> Pose:
    parts = [transform.get(key) if isinstance(transform, dict) else None for key in ("translation", "rotation")]
    if not all(isinstance(part, dict) for part in parts):
        raise ValueError(f"{path}: transform: found no translation and rotation by x, y, z, w; needed both")
    shift, turn = (
        numbers_of(path, item, [part.get(key) for key in keys])  # type: ignore[union-attr]
        for item, part, keys in zip(("translation", "rotation"), parts, ("xyz", "xyzw"), strict=True)
    )
    return pose_of_quaternion(path, "rotation", turn, shift)


def _only(path: Path, frames: list[str], found: list[str], names: Names, what: str) -> str:
    """The only frame of a kind, or the one that is named."""
    named = [one for one in found if one in names]
    if len(named or found) != 1:
        needed = f"one {what}" if found else f"the {what}, identified by its name"
        raise ValueError(f"{path}: frames: found {', '.join(frames)}; needed {needed}, or a matrix camera_from_world")
    return (named or found)[0]


def _way(path: Path, edges: Edges, start: str, end: str) -> Pose:
    """The pose that takes points of one frame to another, along the transforms between them."""
    steps: dict[str, list[tuple[str, Pose]]] = {}
    for (parent, child), pose in edges.items():
        steps.setdefault(child, []).append((parent, pose))
        steps.setdefault(parent, []).append((child, pose.inverse()))
    reached, waiting = {start: Pose.from_quat([0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0])}, [start]
    while waiting:
        here = waiting.pop()
        for there, pose in steps.get(here, []):
            if there not in reached:
                reached[there] = pose @ reached[here]
                waiting.append(there)
    if end not in reached:
        raise ValueError(f"{path}: frames: found no transforms from {start} to {end}; needed all between them")
    return reached[end]
