"""The shipped scene: an image, a camera, a lidar cloud, six regions in both, and the true pose between the sensors."""

from __future__ import annotations

import json
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from regionpose.cameras import PinholeCamera
from regionpose.io.calibrations import load_camera
from regionpose.io.clouds import Cloud, read_cloud
from regionpose.io.reading import read_colors, read_pixels

IMAGE_FILE = "image.jpg"
LABELS_FILE = "labels.png"
CAMERA_FILE = "camera_info.yaml"
CLOUD_FILE = "cloud.ply"
POINT_LABELS_FILE = "point_labels.npz"
REGIONS_FILE = "regions.json"
TRUTH_FILE = "truth.json"

CLOUD_POINT = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "u1")])
"""One point of the cloud's PLY file."""


@dataclass(frozen=True)
class DemoRegion:
    """A planar region of the scene, known in the image and in the lidar's frame.

    Parameters
    ----------
    name : str
        Of the region.
    label : int
        Its value in `DemoScene.labels`.
    rings : tuple of (n, 3) arrays
        Meters, lidar frame, counter-clockwise as seen from the front.
    seed_pixel : tuple of 2 int
        A pixel (x, y) inside it.
    seed_point : (3,) array
        A point of the cloud on it.
    point_indices : (k,) array
        All points of the cloud on it.
    """

    name: str
    label: int
    rings: tuple[NDArray[np.float64], ...]
    seed_pixel: tuple[int, int]
    seed_point: NDArray[np.float64]
    point_indices: NDArray[np.intp]


@dataclass(frozen=True)
class DemoScene:
    """A courtyard seen by a camera and by a lidar.

    The truth is `x_camera = rotation @ x_lidar + translation`.

    Parameters
    ----------
    image : (h, w, 3) array of uint8
        sRGB.
    camera : PinholeCamera
        Of the image.
    camera_path : Path
        Its calibration file.
    points : (n, 3) array
        Meters, lidar frame, with 1 cm of range noise.
    intensities : (n,) array of uint8
        Of the points.
    labels : (h, w) array of uint8
        The regions' labels, exact at pixel centers, 0 outside.
    regions : tuple of DemoRegion
        Seen in both.
    rotation : (3, 3) array
        Of the true pose.
    translation : (3,) array
        Of the true pose, meters.
    """

    image: NDArray[np.uint8]
    camera: PinholeCamera
    camera_path: Path
    points: NDArray[np.float64]
    intensities: NDArray[np.uint8]
    labels: NDArray[np.uint8]
    regions: tuple[DemoRegion, ...]
    rotation: NDArray[np.float64]
    translation: NDArray[np.float64]

    def region(self, name: str) -> DemoRegion:
        """The region of that name; ValueError when there is none."""
        for region in self.regions:
            if region.name == name:
                return region
        names = ", ".join(region.name for region in self.regions)
        raise ValueError(f"the demo scene has no region {name!r}; it has {names}")


def demo_folder() -> Path:
    """The folder of the shipped files, for tools that take paths."""
    return Path(str(resources.files("regionpose.datasets") / "files"))


def load_demo(path: Path | None = None) -> DemoScene:
    """The shipped scene, or one that the generator wrote.

    Parameters
    ----------
    path : Path, optional
        The generator's folder.
    """
    folder = demo_folder() if path is None else path
    cloud = read_cloud(folder / CLOUD_FILE)
    truth = json.loads((folder / TRUTH_FILE).read_text(encoding="utf-8"))
    camera = load_camera(folder / CAMERA_FILE)
    if not isinstance(camera, PinholeCamera):
        raise ValueError(f"{CAMERA_FILE} holds a {type(camera).__name__}; the demo scene needs a PinholeCamera")
    return DemoScene(
        image=read_colors(folder / IMAGE_FILE),
        camera=camera,
        camera_path=folder / CAMERA_FILE,
        points=cloud.points,
        intensities=_intensities(cloud),
        labels=read_pixels(folder / LABELS_FILE).values,
        regions=read_regions(folder),
        rotation=np.array(truth["rotation"]),
        translation=np.array(truth["translation"]),
    )


def _intensities(cloud: Cloud) -> NDArray[np.uint8]:
    if cloud.intensity is None:
        raise ValueError(f"{CLOUD_FILE} holds no intensity; the demo scene needs one a point")
    return cloud.intensity.astype(np.uint8)


def read_regions(path: Path) -> tuple[DemoRegion, ...]:
    """The regions written in the folder `path`, in the order of their labels."""
    described = json.loads((path / REGIONS_FILE).read_text(encoding="utf-8"))["regions"]
    with np.load(path / POINT_LABELS_FILE) as stored:
        of_point = stored["labels"]
    return tuple(
        DemoRegion(
            name=entry["name"],
            label=entry["label"],
            rings=tuple(np.array(ring) for ring in entry["rings"]),
            seed_pixel=(entry["seed_pixel"][0], entry["seed_pixel"][1]),
            seed_point=np.array(entry["seed_point"]),
            point_indices=np.flatnonzero(of_point == entry["label"]),
        )
        for entry in described
    )
