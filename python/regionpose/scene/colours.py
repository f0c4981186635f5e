"""The image's colours on a cloud, for files."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from regionpose.cameras import Camera
from regionpose.clouds import Cloud
from regionpose.fusion import colorize
from regionpose.pose import Pose

VISIBLE_FIELD = "visible"


def coloured_cloud(cloud: Cloud, picture: NDArray[np.uint8], camera: Camera, pose: Pose) -> tuple[Cloud, NDArray[np.bool_]]:
    """The cloud with the colours of a picture (h, w, 3), and which points (n,) the camera sees.

    `pose` is for points about the cloud's origin. Points that are not seen keep their colour, or are black; the field `visible` (0, 1) tells.
    """
    colours, visible = colorize(cloud.points, picture, camera, pose)
    before = np.zeros_like(colours) if cloud.colours is None else cloud.colours
    merged = np.where(visible[:, None], colours, before).astype(np.uint8)
    fields = {**cloud.fields, VISIBLE_FIELD: visible.astype(np.uint8)}
    return replace(cloud, colours=merged, fields=fields), visible
