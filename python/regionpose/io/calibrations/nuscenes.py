"""nuScenes' calibrated_sensor.json."""

from __future__ import annotations

from functools import partial

import numpy as np

from regionpose.cameras import Camera, PinholeCamera
from regionpose.io.calibrations.yaml_items import YamlItem, YamlMapping


def describes(root: YamlItem) -> bool:
    """Whether records hold a camera_intrinsic."""
    return bool(camera_records(root))


def camera_records(root: YamlItem) -> dict[str, YamlMapping]:
    """The records of cameras by their tokens: of a list, or the only one."""
    items = root.entries() if root.is_sequence else [root] if root.is_mapping else []
    records = [one.mapping() for one in items if one.is_mapping]
    cameras = [one for one in records if (item := one.get("camera_intrinsic")) is not None and _is_filled(item)]
    return {one.need("token", "sensor_token").text(): one for one in cameras}


def _is_filled(item: YamlItem) -> bool:
    """Whether a matrix is written: lidars and radars have none."""
    return item.is_sequence and bool(item.entries())


def read_camera(root: YamlItem, name: str | None) -> Camera:
    """The camera of the record whose token is `name`; photos without distortion, of a size not in the file."""

    def build(record: YamlMapping) -> Camera:
        return PinholeCamera.from_matrix(np.reshape(record.need("camera_intrinsic").counted(9), (3, 3)))

    return root.source.camera({key: partial(build, one) for key, one in camera_records(root).items()}, name)
