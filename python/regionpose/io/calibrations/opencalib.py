"""Calibrations of OpenCalib (SensorsCalibration): calib.txt, and *-intrinsic.json."""

from __future__ import annotations

from functools import partial

import numpy as np

from regionpose.cameras import Camera, FisheyeCamera, PinholeCamera
from regionpose.io.calibrations.models import matrix_camera
from regionpose.io.calibrations.text import CalibrationText
from regionpose.io.calibrations.yaml_items import YamlItem, YamlMapping, parsed
from regionpose.validation.arrays import Array


def describes_text(source: CalibrationText) -> bool:
    """Whether there are lines K: and D: of bare numbers."""
    entries = _entries(source)
    return len(entries.get("K", (0, []))[1]) == 9 and "D" in entries


def read_text(source: CalibrationText, name: str | None) -> Camera:
    """The camera of the file, called `camera`."""
    return source.camera({"camera": partial(_text_camera, source)}, name)


def text_pose(source: CalibrationText) -> Array:
    """The matrix (3, 4) under T:, which takes points of the lidar to the camera."""
    entries = _entries(source)
    if "T" not in entries:
        raise source.error("T", "no such line", "12 numbers, camera from lidar")
    line, words = entries["T"]
    return np.reshape(source.numbers("T", words, 12, line), (3, 4))


def describes_json(document: YamlMapping) -> bool:
    """Whether an item holds parameters with cam_K."""
    return bool(_sensors(document))


def read_json(document: YamlMapping, name: str | None) -> Camera:
    """The camera of the sensor called `name`."""
    builders = {key: partial(_json_camera, sensor) for key, sensor in _sensors(document).items()}
    return document.source.camera(builders, name)


def _entries(source: CalibrationText) -> dict[str, tuple[int, list[str]]]:
    """Line (from 1) and words of each `name: words` line whose words look like numbers."""
    entries: dict[str, tuple[int, list[str]]] = {}
    for line, text in enumerate(source.lines, start=1):
        key, colon, rest = text.partition(":")
        words = rest.replace(",", " ").split()
        if colon and words and not any(sign in rest for sign in "[]{}'\""):
            entries.setdefault(key.strip(), (line, words))
    return entries


def _text_camera(source: CalibrationText) -> Camera:
    entries = _entries(source)
    line, words = entries["K"]
    matrix = np.reshape(source.numbers("K", words, 9, line), (3, 3))
    line, words = entries["D"]
    values = [source.number(f"D[{index}]", word, line) for index, word in enumerate(words)]
    if source.model == "fisheye":
        return FisheyeCamera.from_matrix(matrix, distortion=values)
    if len(values) == 4 and any(values) and source.model is None:
        found = "4 coefficients and no model: a pinhole's k1 k2 p1 p2, or a fisheye's k1 k2 k3 k4"
        raise source.error("D", found, "model=pinhole or model=fisheye", line)
    return PinholeCamera.from_matrix(matrix, distortion=values)


def _sensors(document: YamlMapping) -> dict[str, YamlMapping]:
    """The parameters of each camera by the sensor's name."""
    found = {}
    for key, item in document.items.items():
        sensor = item.mapping() if item.is_mapping else None
        param = None if sensor is None else sensor.get("param")
        if sensor is None or param is None or not param.is_mapping or "cam_K" not in param.mapping():
            continue
        named = sensor.get("sensor_name")
        found[named.text() if named else key] = param.mapping()
    return found


def _json_camera(param: YamlMapping) -> Camera:
    size = param.size(("img_dist_w",), ("img_dist_h",))
    return matrix_camera(param, param.need("cam_K"), param.need("cam_dist"), size)


def json_pose(source: CalibrationText) -> tuple[str, str, YamlItem] | None:
    """Names of the sensors and the matrix of *-extrinsic.json, which takes the first's points to the second."""
    root = parsed(source)
    for item in root.mapping().items.values() if root is not None and root.is_mapping else ():
        sensor = item.mapping() if item.is_mapping else None
        param = None if sensor is None else sensor.get("param")
        if sensor is not None and param is not None and param.is_mapping and "sensor_calib" in param.mapping():
            first, second = sensor.need("sensor_name").text(), sensor.need("target_sensor_name").text()
            return first, second, param.mapping().need("sensor_calib")
    return None
