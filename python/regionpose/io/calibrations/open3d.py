"""Cameras that Open3D writes as JSON: PinholeCameraIntrinsic and PinholeCameraParameters."""

from __future__ import annotations

import numpy as np

from regionpose.cameras import Camera, PinholeCamera
from regionpose.io.calibrations.yaml_items import YamlMapping


def describes(document: YamlMapping) -> bool:
    """Whether there is an intrinsic_matrix, or an item `intrinsic` with one."""
    return "intrinsic_matrix" in _intrinsic(document)


def read_camera(document: YamlMapping, name: str | None) -> Camera:
    """The camera of the file, called `camera`, whose matrix is written column by column."""
    intrinsic = _intrinsic(document)

    def build() -> Camera:
        matrix = np.reshape(intrinsic.need("intrinsic_matrix").counted(9), (3, 3)).T
        width, height = intrinsic.size(("width",), ("height",))
        return PinholeCamera.from_matrix(matrix, width=width, height=height)

    return document.source.camera({"camera": build}, name)


def _intrinsic(document: YamlMapping) -> YamlMapping:
    inner = document.get("intrinsic")
    return inner.mapping() if inner is not None and inner.is_mapping else document
