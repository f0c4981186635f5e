"""COLMAP's cameras.txt."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import partial

from regionpose.calibration.text import Builder, CalibrationText
from regionpose.cameras import Camera, FisheyeCamera, PinholeCamera

CAMERA_LINE = re.compile(r"\d+\s+[A-Z][A-Z_]+(\s|$)")

CORNER_TO_CENTRE = 0.5
"""Pixels: COLMAP counts from the corner of the first pixel, OpenCV from its centre."""

PARAMETERS = {
    "SIMPLE_PINHOLE": "f cx cy",
    "PINHOLE": "fx fy cx cy",
    "SIMPLE_RADIAL": "f cx cy k1",
    "RADIAL": "f cx cy k1 k2",
    "OPENCV": "fx fy cx cy k1 k2 p1 p2",
    "FULL_OPENCV": "fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6",
    "SIMPLE_RADIAL_FISHEYE": "f cx cy k1",
    "RADIAL_FISHEYE": "f cx cy k1 k2",
    "OPENCV_FISHEYE": "fx fy cx cy k1 k2 k3 k4",
}
"""Parameters of each model in the order of the file."""


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
    if model not in PARAMETERS:
        raise source.error(item, f"the model {model}", f"one of {', '.join(PARAMETERS)}", line)
    width, height = (source.whole_number(f"{item} size", word, line) for word in words[2:4])
    names = PARAMETERS[model].split()
    values = dict(zip(names, source.numbers(f"{item} {model}", words[4:], len(names), line), strict=True))
    fx, fy = values.get("fx", values.get("f", 0.0)), values.get("fy", values.get("f", 0.0))
    cx, cy = values["cx"] - CORNER_TO_CENTRE, values["cy"] - CORNER_TO_CENTRE
    if model.endswith("FISHEYE"):
        k = tuple(values.get(key, 0.0) for key in ("k1", "k2", "k3", "k4"))
        return FisheyeCamera(fx, fy, cx, cy, k, width, height)
    return PinholeCamera(fx, fy, cx, cy, width, height, _distortion(values))


def _distortion(values: dict[str, float]) -> tuple[float, ...]:
    """As many of OpenCV's coefficients as the model has."""
    count = 8 if "k6" in values else 4 if "k1" in values else 0
    return tuple(values.get(key, 0.0) for key in ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")[:count])
