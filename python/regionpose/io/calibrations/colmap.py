"""COLMAP's cameras.txt and images.txt."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import partial

import numpy as np

from regionpose.cameras import Camera, camera_from_colmap
from regionpose.cameras.colmap import COLMAP_MODELS
from regionpose.geometry.pose import Pose
from regionpose.io.calibrations.pose_values import chosen, pose_of_quaternion
from regionpose.io.calibrations.text import Builder, CalibrationText

IMAGE_LINE = re.compile(r"\d+(\s+[-+.\deE]+){7}\s+\d+\s+\S")
CAMERA_LINE = re.compile(r"\d+\s+[A-Z][A-Z_]+(\s|$)")


def describes(source: CalibrationText) -> bool:
    """Whether the first line that is not a comment is an id and a model."""
    first = next(_camera_lines(source), None)
    return first is not None and CAMERA_LINE.match(" ".join(first[1])) is not None


def read_camera(source: CalibrationText, name: str | None) -> Camera:
    """The camera whose id is `name`."""
    builders: dict[str, Builder] = {}
    for line, words in _camera_lines(source):
        if words[0] in builders:
            raise source.error(f"camera {words[0]}", "a second line of this id", "one", line)
        builders[words[0]] = partial(_camera, source, line, words)
    return source.camera(builders, name)


def _camera_lines(source: CalibrationText) -> Iterator[tuple[int, list[str]]]:
    """Numbers (from 1) and words of the lines that are neither empty nor comments."""
    for line, text in enumerate(source.lines, start=1):
        words = text.split()
        if words and not words[0].startswith("#"):
            yield line, words


def _camera(source: CalibrationText, line: int, words: list[str]) -> Camera:
    item = f"camera {words[0]}"
    if len(words) < 4:
        raise source.error(item, f"{len(words)} words", "id, model, width, height and parameters", line)
    model = words[1]
    if model not in COLMAP_MODELS:
        raise source.error(item, f"the model {model}", f"one of {', '.join(COLMAP_MODELS)}", line)
    width, height = (source.whole_number(f"{item} size", word, line) for word in words[2:4])
    count = len(COLMAP_MODELS[model].split())
    return camera_from_colmap(model, width, height, source.numbers(f"{item} {model}", words[4:], count, line))


def describes_images(source: CalibrationText) -> bool:
    """Whether the first line that is not a comment is an image with its pose."""
    first = next(_camera_lines(source), None)
    return first is not None and IMAGE_LINE.match(" ".join(first[1])) is not None


def image_pose(source: CalibrationText, name: str | None) -> Pose:
    """The pose of the image whose name, or id, is `name`; of the only one without."""
    images = {}
    for line, words in _camera_lines(source):
        # Every other line holds the points of the image before it.
        if IMAGE_LINE.match(" ".join(words)) and not words[9].replace(".", "").isdecimal():
            images[" ".join(words[9:])] = (line, words[1:8])
    entry = chosen(source.path, images, () if name is None else (name,), "images")
    line, words = entry
    w, x, y, z, *shift = source.numbers("pose", words, 7, line)
    return pose_of_quaternion(source.path, "pose", np.array([x, y, z, w]), np.array(shift))
