"""Which camera model a calibration file names, and the camera of a matrix with coefficients."""

from __future__ import annotations

import re
from typing import Literal, get_args

import numpy as np

from regionpose.calibration.text import CalibrationError
from regionpose.calibration.yaml_items import YamlItem, YamlMapping
from regionpose.cameras import Camera, FisheyeCamera, OcamCamera, PinholeCamera, UnifiedCamera

CameraModel = Literal["pinhole", "fisheye", "unified", "ocam"]

CLASSES: dict[CameraModel, type[Camera]] = {
    "pinhole": PinholeCamera,
    "fisheye": FisheyeCamera,
    "unified": UnifiedCamera,
    "ocam": OcamCamera,
}

MODEL_KEYS = ("model", "cameramodel", "distortionmodel", "modeltype", "cameratype", "lensmodel")
"""Keys, in lower case and without separators, under which files name a model."""

SPELLINGS: dict[CameraModel, str] = {
    "pinhole": "pinhole perspective opencv plumbbob radtan radialtangential rationalpolynomial brownconrady none",
    "fisheye": "fisheye opencvfisheye cv2fisheye equidistant kannalabrandt kannalabrandt4 kb4",
    "unified": "unified omni omnidir opencvomnidir cv2omnidir mei",
}
WORDS = {word: model for model, words in SPELLINGS.items() for word in words.split()}
"""What OpenCV, ROS, Kalibr, COLMAP and their like call each model, written as the keys are."""

SWITCHED_OFF = ("0", "false", "no", "off")


def checked_model(model: str | None) -> CameraModel | None:
    """A model that a caller gives; CalibrationError for a name that is none."""
    known: tuple[CameraModel, ...] = get_args(CameraModel)
    found = next((one for one in known if one == model), None)
    if model is not None and found is None:
        raise CalibrationError(f"model: found {model!r}; needed one of {', '.join(known)}")
    return found


def model_of(camera: Camera) -> CameraModel:
    """The name of a camera's model."""
    return next(name for name, kind in CLASSES.items() if isinstance(camera, kind))


def matrix_camera(
    document: YamlMapping, matrix: YamlItem, coefficients: YamlItem, size: tuple[int | None, int | None]
) -> Camera:
    """The camera of a matrix K and distortion coefficients, in the model that caller or file names.

    Without a name, four coefficients could be a pinhole's `k1 k2 p1 p2` or a fisheye's `k1 k2 k3 k4`: CalibrationError.
    """
    k = np.reshape(matrix.counted(9), (3, 3))
    model = document.source.model or named_model(document) or _implied(document, coefficients)
    if model == "fisheye":
        return FisheyeCamera.from_matrix(k, distortion=coefficients.counted(4), width=size[0], height=size[1])
    if model == "unified":
        return UnifiedCamera.from_matrix(
            k,
            distortion=_radial_tangential(coefficients),
            width=size[0],
            height=size[1],
            xi=document.need("xi").number(),
        )
    if model == "ocam":
        raise matrix.error("a camera matrix", "an OCamCalib file for model=ocam")
    return PinholeCamera.from_matrix(k, distortion=_radial_tangential(coefficients), width=size[0], height=size[1])


def named_model(document: YamlMapping) -> CameraModel | None:
    """The model that the file's keys name, None where none does; CalibrationError for names unknown or at odds."""
    named = {model for item in document.items.values() if (model := _named_by(item)) is not None}
    # Kalibr and ROS call a camera a pinhole whose distortion is a fisheye's.
    special = sorted(named - {"pinhole"})
    if len(special) > 1:
        raise document.source.error("camera model", " and ".join(special), "one of them, or model= to choose")
    return special[0] if special else next(iter(named), None)


def _named_by(item: YamlItem) -> CameraModel | None:
    """The model that an item names: by its value under a key for that, or by a key that says fisheye."""
    key = _plain(item.name.rpartition(".")[2])
    if key in MODEL_KEYS:
        word = _plain(item.text())
        if word not in WORDS:
            known = ", ".join(SPELLINGS)
            raise item.error(f"the model {item.text()!r}", f"one of {known}, or model= to say which of these it is")
        return WORDS[word]
    if "fisheye" in key:
        return "pinhole" if item.is_scalar and item.text().lower() in SWITCHED_OFF else "fisheye"
    return None


def _implied(document: YamlMapping, coefficients: YamlItem) -> CameraModel:
    """The model of a file that names none."""
    if "xi" in document:
        return "unified"
    values = coefficients.numbers()
    if len(values) == 4 and any(values):
        found = "4 coefficients and no model: a pinhole's k1 k2 p1 p2, or a fisheye's k1 k2 k3 k4"
        raise coefficients.error(found, "model=pinhole or model=fisheye, or a key model in the file")
    return "pinhole"


def _radial_tangential(item: YamlItem) -> list[float]:
    """0, 4, 5 or 8 coefficients; 12 or 14 when the thin prism and tilt terms are zero."""
    values = item.counted(0, 4, 5, 8, 12, 14)
    if any(values[8:]):
        raise item.error("thin prism or tilt coefficients other than 0", "up to 8 coefficients")
    return values[:8]


def _plain(name: str) -> str:
    """A name in lower case, without what separates its words."""
    return re.sub(r"[^a-z0-9]", "", name.lower())
