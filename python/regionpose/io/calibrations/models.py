"""Which camera model a calibration file names, and the camera of a matrix with coefficients."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import get_args

import numpy as np

from regionpose.cameras import (
    Camera,
    FisheyeCamera,
    PinholeCamera,
    UnifiedCamera,
)
from regionpose.cameras.distortion import COEFFICIENT_COUNTS
from regionpose.cameras.models import CameraModel
from regionpose.io.calibrations.text import CalibrationError
from regionpose.io.calibrations.yaml_items import YamlItem, YamlMapping

MODEL_KEYS = ("model", "cameramodel", "distortionmodel", "modeltype", "cameratype", "lensmodel")
"""Keys, in lower case and without separators, under which files name a model."""

SPELLINGS: dict[CameraModel, str] = {
    "pinhole": "pinhole perspective opencv plumbbob radtan radialtangential rationalpolynomial brownconrady none"
    " pinholeradtan frame simplepinhole simpleradial radial fullopencv rectified",
    "fisheye": "fisheye opencvfisheye cv2fisheye equidistant kannalabrandt kannalabrandt4 kannalabrandt8 kb4 kb8"
    " equidistantcamera simpleradialfisheye radialfisheye",
    "unified": "unified omni omnidir opencvomnidir cv2omnidir mei",
    "fov": "fov atan",
    "equirectangular": "equirectangular spherical",
}
WORDS = {word: model for model, words in SPELLINGS.items() for word in words.split()}
"""What OpenCV, ROS, Kalibr, COLMAP and their like call each model, written as the keys are."""

OPENCV_NAMES = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
"""Coefficients in OpenCV's order."""

SWITCHED_OFF = ("0", "false", "no", "off")


def checked_model(model: str | None) -> CameraModel | None:
    """A model that a caller gives; CalibrationError for a name that is none."""
    supported: tuple[CameraModel, ...] = get_args(CameraModel)
    found = next((one for one in supported if one == model), None)
    if model is not None and found is None:
        raise CalibrationError(f"model: found {model!r}; needed one of {', '.join(supported)}")
    return found


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
    if model in {"fov", "ocam", "equirectangular"}:
        raise matrix.error("a camera matrix", f"a file without one for model={model}")
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
    """The model that an item names, by its value under a key for models or by a key that contains "fisheye"."""
    key = _plain(item.name.rpartition(".")[2])
    if key in MODEL_KEYS:
        word = _plain(item.text())
        if word not in WORDS:
            supported = ", ".join(SPELLINGS)
            raise item.error(f"the model {item.text()!r}", f"one of {supported}, or model= with one of these")
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
    """OpenCV's coefficients, without thin prism and tilt where these are zero."""
    values = item.counted(*COEFFICIENT_COUNTS)
    return values if any(values[8:]) else values[:8]


@dataclass(frozen=True)
class NamedLens:
    """Intrinsics and coefficients that a file gives one by one: fx, fy, cx, cy, then k1, k2, p1, ... by name.

    `item` is named in errors; `word` is what the file calls the model, None where it does not.
    """

    item: YamlItem
    intrinsics: tuple[float, float, float, float]
    coefficients: Mapping[str, float]
    size: tuple[int | None, int | None] = (None, None)
    word: str | None = None

    def camera(self) -> PinholeCamera | FisheyeCamera:
        """The camera; CalibrationError for a model that is unknown, or that neither file nor caller names."""
        model = self.model or self._implied()
        width, height = self.size
        if model == "fisheye":
            self._check_coefficients("k1 k2 k3 k4")
            angular = tuple(self.coefficients.get(name, 0.0) for name in ("k1", "k2", "k3", "k4"))
            return FisheyeCamera(*self.intrinsics, distortion=angular, width=width, height=height)
        if model != "pinhole":
            raise self.item.error(f"fx, fy, cx, cy for a camera that is {model}", "a pinhole or fisheye camera")
        self._check_coefficients(" ".join(OPENCV_NAMES))
        values = [self.coefficients.get(name, 0.0) for name in OPENCV_NAMES]
        count = 8 if any(values[5:]) else 5 if "k3" in self.coefficients else 4 if self.coefficients else 0
        return PinholeCamera(*self.intrinsics, distortion=tuple(values[:count]), width=width, height=height)

    @property
    def model(self) -> CameraModel | None:
        """The model that the caller or the file names; CalibrationError for an unknown name."""
        requested = checked_model(self.item.source.model)
        if requested is not None or self.word is None:
            return requested
        model = WORDS.get(_plain(self.word))
        if model is None:
            raise self.item.error(f"the model {self.word!r}", f"one of {', '.join(SPELLINGS)}, or model= to choose")
        return model

    def _implied(self) -> CameraModel:
        """The model that the coefficients' names imply: only a pinhole has tangential ones."""
        if any(self.coefficients.values()) and not {"p1", "p2"} <= self.coefficients.keys():
            found = f"the coefficients {', '.join(self.coefficients)} and no model"
            raise self.item.error(found, "model=pinhole or model=fisheye")
        return "pinhole"

    def _check_coefficients(self, supported: str) -> None:
        """CalibrationError for coefficients other than 0 that the model has no place for."""
        other = [name for name, value in self.coefficients.items() if value and name not in supported.split()]
        if other:
            raise self.item.error(f"a coefficient {other[0]} of {self.coefficients[other[0]]:g}", f"{supported} alone")


def _plain(name: str) -> str:
    """A name in lower case, without what separates its words."""
    return re.sub(r"[^a-z0-9]", "", name.lower())
