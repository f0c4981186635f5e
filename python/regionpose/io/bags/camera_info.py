"""Calibrations of a bag's messages, CameraInfo, as the text that `ros2 topic echo` makes of one."""

from __future__ import annotations

from typing import Any

import numpy as np

from regionpose.io.bags.messages import read_messages, usual_fields
from regionpose.io.bags.place import BagPlace
from regionpose.io.reading import FileError
from regionpose.io.yaml_text import to_yaml

KINDS = ("CameraInfo",)

ROI_FIELDS = ("x_offset", "y_offset", "height", "width")


def camera_info_text(place: BagPlace) -> str:
    """The YAML of a place's message; FileError for other messages and for several, else as of `read_messages`."""
    if place.count != 1:
        raise FileError(f"{place}: found {place.count} messages selected; needed one of a camera")
    message = read_messages(place, KINDS)[0].content
    with usual_fields(place):
        return to_yaml(_values(message))


def _values(message: Any) -> dict[str, Any]:
    """The fields of a message, whose matrices ROS 1 writes in capital letters."""
    matrices = {name: getattr(message, name, None) for name in "dkrp"}
    fields = {name: getattr(message, name.upper()) if value is None else value for name, value in matrices.items()}
    values: dict[str, Any] = {
        "height": int(message.height),
        "width": int(message.width),
        "distortion_model": str(message.distortion_model),
        **{name: np.asarray(value, dtype=np.float64).tolist() for name, value in fields.items()},
        "binning_x": int(message.binning_x),
        "binning_y": int(message.binning_y),
    }
    roi = {name: int(getattr(message.roi, name)) for name in ROI_FIELDS}
    return values | {"roi": roi | {"do_rectify": bool(message.roi.do_rectify)}}
