"""transforms.json of nerfstudio and instant-ngp."""

from __future__ import annotations

import math
from functools import partial

from regionpose.cameras import Camera, EquirectangularCamera
from regionpose.cameras.colmap import CORNER_TO_CENTER
from regionpose.io.calibrations.models import NamedLens
from regionpose.io.calibrations.yaml_items import YamlItem, YamlMapping

COEFFICIENTS = ("k1", "k2", "k3", "k4", "p1", "p2")


def describes(document: YamlMapping) -> bool:
    """Whether there are frames with transform_matrix."""
    frames = document.get("frames")
    return frames is not None and frames.is_sequence and any("transform_matrix" in one for one in _frames(frames))


def read_camera(document: YamlMapping, name: str | None) -> Camera:
    """The camera of all frames, `camera`, or of the frame whose file_path is `name`."""
    if document.get("fl_x", "camera_angle_x", "camera_model") is not None:
        return document.source.camera({"camera": partial(_camera, document, document)}, name)
    frames = _frames(document.need("frames"))
    builders = {one.need("file_path").text(): partial(_camera, one, document) for one in frames}
    return document.source.camera(builders, name)


def _frames(frames: YamlItem) -> list[YamlMapping]:
    return [one.mapping() for one in frames.entries() if one.is_mapping]


def _camera(mapping: YamlMapping, document: YamlMapping) -> Camera:
    """A camera whose center counts from the first pixel's corner."""
    word = mapping.get("camera_model") or document.get("camera_model")
    width, height = mapping.size(("w",), ("h",))
    if word is not None and word.text() == "EQUIRECTANGULAR":
        return EquirectangularCamera(width=mapping.need("w").whole_number(), height=mapping.need("h").whole_number())
    values = {key: item.number() for key in COEFFICIENTS if (item := mapping.get(key)) is not None}
    item = mapping.need("fl_x", "camera_angle_x")
    if item.name.endswith("camera_angle_x"):
        fx = 0.5 * mapping.need("w").number() / math.tan(0.5 * item.number())
        fy, cx, cy = fx, 0.5 * mapping.need("w").number(), 0.5 * mapping.need("h").number()
    else:
        fx, cx, cy = (mapping.need(key).number() for key in ("fl_x", "cx", "cy"))
        fy = mapping.need("fl_y", "fl_x").number()
    lens = (fx, fy, cx - CORNER_TO_CENTER, cy - CORNER_TO_CENTER)
    if word is None or "FISHEYE" not in word.text():
        if values.pop("k4", 0.0):
            raise item.error("k4 other than 0 without a fisheye model", "k1 k2 k3 p1 p2")
        values = {"p1": 0.0, "p2": 0.0, **values} if values else {}
    return NamedLens(item, lens, values, (width, height), None if word is None else word.text()).camera()
