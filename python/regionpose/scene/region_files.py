"""The confirmed regions of a frame as files that scene files read: labels of its photo and of its cloud."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import numpy as np
import shapely
from numpy.typing import NDArray
from PIL import Image

from regionpose.io.clouds import Cloud
from regionpose.scene.confirmed import ConfirmedRegion
from regionpose.scene.estimate import SceneEstimate
from regionpose.scene.region_values import REGION_POINTS

Labels = NDArray[np.uint8]

REGION_LABELS = "regions.png"

MOST_LABELS = 255
"""Regions that have a label of a byte."""


def region_files(view: SceneEstimate) -> dict[str, Callable[[Path], object]]:
    """Writers of the labels of a frame's photo and cloud by file name; none where no region is confirmed."""
    check, cloud = view.regions_found, view.sides.cloud
    found = None if check is None else check.frames[0]
    if found is None or cloud is None or not found.regions:
        return {}
    regions, (height, width) = found.regions[:MOST_LABELS], view.sides.image.shape[:2]
    return {
        REGION_LABELS: partial(_write_image, _image_labels(regions, height, width)),
        REGION_POINTS: partial(_write_array, _point_labels(regions, cloud)),
    }


def _image_labels(regions: Sequence[ConfirmedRegion], height: int, width: int) -> Labels:
    """The label (h, w) of each pixel whose center is in a region, 0 elsewhere; smaller regions lie over larger ones."""
    labels = np.zeros((height, width), dtype=np.uint8)
    rows, columns = np.indices((height, width))
    for label, region in sorted(enumerate(regions, start=1), key=lambda each: -each[1].image.area):
        for ring in region.image.rings:
            labels[shapely.contains_xy(shapely.Polygon(ring), columns, rows)] = label
    return labels


def _point_labels(regions: Sequence[ConfirmedRegion], cloud: Cloud) -> Labels:
    """The label (n,) of each point of the cloud's file."""
    labels = np.zeros(len(cloud) + cloud.dropped, dtype=np.uint8)
    for label, region in enumerate(regions, start=1):
        labels[cloud.to_file_indices(region.indices)] = label
    return labels


def _write_image(labels: Labels, path: Path) -> None:
    Image.fromarray(labels).save(path, format="PNG")


def _write_array(labels: Labels, path: Path) -> None:
    with path.open("wb") as file:
        np.save(file, labels)
