"""Kalibr's camchain."""

from __future__ import annotations

from functools import partial

from regionpose.cameras import Camera, FisheyeCamera, PinholeCamera, UnifiedCamera
from regionpose.io.calibrations.yaml_items import YamlItem, YamlMapping

MODELS = {
    ("pinhole", "radtan"),
    ("pinhole", "equidistant"),
    ("pinhole", "none"),
    ("omni", "radtan"),
    ("omni", "none"),
}


def describes(document: YamlMapping) -> bool:
    """Whether an item names a camera model and intrinsics."""
    return bool(_cameras(document))


def read_camera(document: YamlMapping, name: str | None) -> Camera:
    """The camera called `name`: `cam0`, `cam1`, ..."""
    cameras = _cameras(document)
    return document.source.camera({key: partial(_camera, item.mapping()) for key, item in cameras.items()}, name)


def _cameras(document: YamlMapping) -> dict[str, YamlItem]:
    mappings = {key: item for key, item in document.items.items() if item.is_mapping}
    return {key: item for key, item in mappings.items() if "camera_model" in item.mapping()}


def _camera(entry: YamlMapping) -> Camera:
    model, distortion = entry.need("camera_model"), entry.need("distortion_model")
    pair = (model.text(), distortion.text())
    if pair not in MODELS:
        supported = ", ".join(" + ".join(item) for item in sorted(MODELS))
        raise model.error(" + ".join(pair), f"one of {supported}")
    *xi, fx, fy, cx, cy = entry.need("intrinsics").counted(5 if pair[0] == "omni" else 4)
    width, height = _resolution(entry.need("resolution"))
    coefficients = tuple(entry.need("distortion_coeffs").counted(4)) if pair[1] != "none" else ()
    if pair[0] == "omni":
        return UnifiedCamera(fx, fy, cx, cy, xi=xi[0], distortion=coefficients, width=width, height=height)
    if pair[1] == "equidistant":
        return FisheyeCamera(fx, fy, cx, cy, distortion=coefficients, width=width, height=height)
    return PinholeCamera(fx, fy, cx, cy, width=width, height=height, distortion=coefficients)


def _resolution(item: YamlItem) -> tuple[int, int]:
    width, height = item.counted(2)
    if not (width.is_integer() and height.is_integer()):
        raise item.error(f"{width} by {height}", "whole numbers")
    return int(width), int(height)
