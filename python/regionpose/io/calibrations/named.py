"""Calibrations that give focal lengths, center and coefficients one by one: FAST-Calib, FAST-LIVO2, ORB-SLAM, VINS."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from functools import partial

from regionpose.cameras import Camera, UnifiedCamera
from regionpose.io.calibrations.models import NamedLens
from regionpose.io.calibrations.yaml_items import YamlMapping

FOCAL = re.compile(r"(Camera\d?\.|cam_|)fx")
"""The key of the focal length, with what stands before all keys of a camera."""

MODEL_KEYS = ("Camera.type", "cam_model", "camera_model", "model_type", "distortion_model", "model")
COEFFICIENT = re.compile(r"k[1-6]|p[12]")
D_NAMES = {"pinhole": ("k1", "k2", "p1", "p2", "k3"), "fisheye": ("k1", "k2", "k3", "k4")}
"""What d0, d1, ... of FAST-LIVO2 are, by model."""

MOST_LEVELS = 4
"""Levels at which the parameters of a ROS node stand: file, node, `ros__parameters`, sensor."""

VINS_KEYS = {
    "PINHOLE": ("fx", "fy", "cx", "cy"),
    "KANNALA_BRANDT": ("mu", "mv", "u0", "v0"),
    "MEI": ("gamma1", "gamma2", "u0", "v0"),
}
"""Names of the intrinsics in VINS' projection_parameters, by model."""


def describes(document: YamlMapping) -> bool:
    """Whether a mapping holds fx, fy, cx and cy under names of one kind."""
    return bool(_cameras(document))


def read_camera(document: YamlMapping, name: str | None) -> Camera:
    """The camera called `name`: what stands before its keys (`Camera1`), or the mapping that holds it."""
    builders = {key: partial(_camera, section, prefix) for key, (section, prefix) in _cameras(document).items()}
    return document.source.camera(builders, name)


def describes_vins(document: YamlMapping) -> bool:
    """Whether there are projection_parameters, as of VINS and camodocal."""
    return "projection_parameters" in document


def read_vins(document: YamlMapping, name: str | None) -> Camera:
    """The camera of the file, whose name is its `camera_name`, or `camera`."""
    named = document.get("camera_name")
    return document.source.camera({named.text() if named else "camera": partial(_vins, document)}, name)


def _cameras(document: YamlMapping) -> dict[str, tuple[YamlMapping, str]]:
    """Cameras by name: the mapping of each, and what stands before its keys."""
    found: dict[str, tuple[YamlMapping, str]] = {}
    for section in _mappings(document, MOST_LEVELS):
        for key in section.items:
            match = FOCAL.fullmatch(key)
            if match is not None and all(f"{match[1]}{other}" in section for other in ("fy", "cx", "cy")):
                label = match[1].rstrip("._") or section.name or "camera"
                found.setdefault(label, (section, match[1]))
    return found


def _mappings(document: YamlMapping, levels: int) -> Iterator[YamlMapping]:
    yield document
    for item in document.items.values() if levels > 1 else ():
        if item.is_mapping:
            yield from _mappings(item.mapping(), levels - 1)


def _camera(section: YamlMapping, prefix: str) -> Camera:
    fx, fy, cx, cy = (section.need(f"{prefix}{key}").number() for key in ("fx", "fy", "cx", "cy"))
    coefficients = {
        key.removeprefix(prefix): item.number()
        for key, item in section.items.items()
        if key.startswith(prefix) and COEFFICIENT.fullmatch(key.removeprefix(prefix))
    }
    word = section.get(*MODEL_KEYS)
    size = section.size(
        (f"{prefix}width", "Camera.width", "width", "image_width"),
        (f"{prefix}height", "Camera.height", "height", "image_height"),
    )
    lens = NamedLens(section.need(f"{prefix}fx"), (fx, fy, cx, cy), coefficients, size, word.text() if word else None)
    numbered = [section.items[key].number() for key in (f"{prefix}d{index}" for index in range(5)) if key in section]
    return _with_numbered(lens, numbered).camera() if numbered else lens.camera()


def _with_numbered(lens: NamedLens, values: list[float]) -> NamedLens:
    """The lens with coefficients d0, d1, ..., which mean other things in other models."""
    model = lens.model
    if model is None:
        if any(values):
            raise lens.item.error("coefficients d0, d1, ... and no model", "model=pinhole or model=fisheye")
        model = "pinhole"
    if model not in D_NAMES:
        raise lens.item.error(f"coefficients d0, d1, ... of a camera that is {model}", "a pinhole or fisheye camera")
    if any(values[len(D_NAMES[model]) :]):
        raise lens.item.error(f"{len(values)} coefficients d0, d1, ...", f"{len(D_NAMES[model])} for {model}")
    return replace(lens, coefficients=dict(zip(D_NAMES[model], values, strict=False)), word=model)


def _vins(document: YamlMapping) -> Camera:
    model = document.need("model_type")
    keys = VINS_KEYS.get(model.text())
    if keys is None:
        raise model.error(repr(model.text()), f"one of {', '.join(VINS_KEYS)}")
    projection = document.need("projection_parameters").mapping()
    fx, fy, cx, cy = (projection.need(key).number() for key in keys)
    size = document.size(("image_width",), ("image_height",))
    if model.text() == "KANNALA_BRANDT":
        # The polynomial of the angle begins with k2, the factor of its third power.
        values = {f"k{index - 1}": projection.need(f"k{index}").number() for index in range(2, 6)}
        return NamedLens(model, (fx, fy, cx, cy), values, size, "fisheye").camera()
    distortion = document.get("distortion_parameters")
    values = {} if distortion is None else _numbers(distortion.mapping())
    if model.text() == "MEI":
        xi = document.need("mirror_parameters").mapping().need("xi").number()
        coefficients = tuple(values.get(key, 0.0) for key in ("k1", "k2", "p1", "p2"))
        return UnifiedCamera(fx, fy, cx, cy, xi=xi, distortion=coefficients, width=size[0], height=size[1])
    return NamedLens(model, (fx, fy, cx, cy), values, size, "pinhole").camera()


def _numbers(section: YamlMapping) -> dict[str, float]:
    return {key: item.number() for key, item in section.items.items()}
