"""Calibrations of Agisoft Metashape: the XML of one camera, or of a project's cameras."""

from __future__ import annotations

from functools import partial

from regionpose.cameras import Camera, EquirectangularCamera, FisheyeCamera, PinholeCamera
from regionpose.cameras.colmap import CORNER_TO_CENTER
from regionpose.io.calibrations.xml_items import Element

KINDS = ("frame", "fisheye", "equirectangular", "spherical")
WITHOUT_PLACE = ("b2", "k4", "p3", "p4")
"""Terms of a frame camera that OpenCV's model has no place for: skew, the eighth power, the higher tangential ones."""


def describes(root: Element) -> bool:
    """Whether an element `calibration` holds a focal length, or states that it has none."""
    return any(one.child("f") is not None or _kind(one) in KINDS[2:] for one in root.all("calibration"))


def read_camera(root: Element, name: str | None) -> Camera:
    """The camera of the file, `camera`, or of the sensor whose label is `name`."""
    if root.tag == "calibration":
        return root.source.camera({"camera": partial(_camera, root, root)}, name)
    builders = {}
    for sensor in root.all("sensor"):
        elements = [one for one in sensor.children if one.tag == "calibration"]
        # The adjusted calibration is the result, the initial one where it began.
        elements.sort(key=lambda one: one.attributes.get("class") == "adjusted")
        if elements:
            builders[sensor.attributes.get("label", sensor.attributes.get("id", "camera"))] = partial(
                _camera, elements[-1], sensor
            )
    return root.source.camera(builders, name)


def _kind(calibration: Element) -> str:
    named = calibration.child("projection")
    return (calibration.attributes.get("type", "frame") if named is None else named.text).strip().lower()


def _camera(calibration: Element, sensor: Element) -> Camera:
    source, kind = calibration.source, _kind(calibration)
    if kind not in KINDS:
        raise source.error("projection", repr(kind), f"one of {', '.join(KINDS)}", calibration.line)
    width, height = _size(calibration, sensor)
    if kind in KINDS[2:]:
        return EquirectangularCamera(width=width, height=height)
    other = [key for key in WITHOUT_PLACE if calibration.number(key, 0.0) and not (kind == "fisheye" and key == "k4")]
    if other:
        found = f"{other[0]} of {calibration.number(other[0]):g}"
        raise source.error("calibration", found, "a calibration without it (or 0)", calibration.line)
    focal = calibration.number("f")
    # Centers are counted from the middle of the image, whose outer corner is at zero.
    cx = 0.5 * width + calibration.number("cx", 0.0) - CORNER_TO_CENTER
    cy = 0.5 * height + calibration.number("cy", 0.0) - CORNER_TO_CENTER
    lens = (focal + calibration.number("b1", 0.0), focal, cx, cy)
    k1, k2, k3, k4, p1, p2 = (calibration.number(key, 0.0) for key in ("k1", "k2", "k3", "k4", "p1", "p2"))
    if kind == "fisheye":
        if p1 or p2:
            raise source.error("calibration", "p1 or p2 of a fisheye", "one without tangential terms", calibration.line)
        return FisheyeCamera(*lens, distortion=(k1, k2, k3, k4), width=width, height=height)
    # Metashape's p1 goes with x, OpenCV's with y.
    return PinholeCamera(*lens, distortion=(k1, k2, p2, p1, k3), width=width, height=height)


def _size(calibration: Element, sensor: Element) -> tuple[int, int]:
    """Width and height: elements of the calibration, or the attributes of its or the sensor's resolution."""
    source = calibration.source
    resolution = calibration.child("resolution") or sensor.child("resolution")
    if resolution is not None:
        words = [resolution.attributes.get(key, "") for key in ("width", "height")]
        width, height = (source.whole_number("resolution", word, resolution.line) for word in words)
    else:
        width, height = (int(calibration.number(key)) for key in ("width", "height"))
    return width, height
