"""The camera, the image and the cloud that a scene names."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from regionpose.cameras import Camera
from regionpose.cameras.base import resize_factor
from regionpose.cameras.models import camera_of_model
from regionpose.io.bags.pictures import read_bag_picture
from regionpose.io.bags.place import bag_place
from regionpose.io.calibrations import load_camera
from regionpose.io.clouds import Cloud, read_cloud
from regionpose.io.clouds.kinds import file_size
from regionpose.io.reading import read_colors, read_turn
from regionpose.progress import Progress
from regionpose.scene.document import Place
from regionpose.scene.loading import Scene
from regionpose.scene.models import CameraFile
from regionpose.scene.stages import Stages
from regionpose.validation.arrays import Array

Picture = NDArray[np.uint8]
Value = TypeVar("Value")

TURNED_CURE = (
    "the EXIF data of the photo turn it, and the calibration is that of the photo as stored: calibrate with photos as"
    " viewers show them, or remove the turn from the photo's EXIF data and take masks of the photo as stored"
)


def scene_camera(scene: Scene) -> Camera:
    """The scene's camera; SceneError that names the line for a file or parameters that give none."""
    item = scene.model.camera
    if isinstance(item, str):
        return at_location(scene, ("camera",), lambda: load_camera(scene.file(item)))
    if isinstance(item, CameraFile):
        file, rectified = scene.file(item.file), item.rectified
        return at_location(
            scene, ("camera", "file"), lambda: load_camera(file, item.name, model=item.model, rectified=rectified)
        )
    parameters: dict[str, Any] = item.model_dump(exclude={"model", "resized"})
    return at_location(scene, ("camera",), lambda: camera_of_model(item.model, parameters))


def scene_image(scene: Scene) -> Picture:
    """The scene's image (h, w, 3), sRGB, as viewers show it: turned by its EXIF data."""
    return at_location(scene, ("image",), lambda: read_picture(scene.file(scene.image)))


def fitted_camera(scene: Scene, camera: Camera, image: Picture) -> Camera:
    """The camera for the scene's image: scaled to it where the scene declares it resized.

    SceneError where image and calibration are of different sizes otherwise.
    """
    size, item = (image.shape[1], image.shape[0]), scene.model.camera
    if not isinstance(item, str) and item.resized:
        return at_location(scene, ("camera", "resized"), lambda: camera.resized(*size))
    remark = camera.other_size(*size)
    if remark is None:
        return camera
    if camera.other_size(*size[::-1]) is None and read_turn(scene.file(scene.image)) is not None:
        raise scene.error(("image",), f"{remark}; {TURNED_CURE}")
    resizable = resize_factor((camera.width or 1, camera.height or 1), size) is not None
    raise scene.error(("image",), remark + ", or camera.resized: true for a resized copy" * resizable)


def cloud_bytes(scene: Scene) -> int:
    """The bytes of the file of the scene's cloud; 0 where it names none, or one that isn't there."""
    return 0 if scene.cloud is None else file_size(scene.file(scene.cloud.file))


def scene_cloud(scene: Scene, *, progress: Progress | None = None) -> Cloud | None:
    """The scene's cloud, None when it names none; `progress` as of `read_cloud`."""
    cloud_file = scene.cloud
    if cloud_file is None:
        return None
    path, columns = scene.file(cloud_file.file), cloud_file.columns
    return at_location(scene, ("cloud",), lambda: read_cloud(path, columns=columns, progress=progress))


def read_sensors(scene: Scene, stages: Stages) -> tuple[Picture, Camera, Cloud | None]:
    """Photo, the camera for it, and cloud of a scene of one photo, as the stage "read files"; SceneErrors as above."""
    with stages.stage("read files"):
        image = scene_image(scene)
        camera = fitted_camera(scene, scene_camera(scene), image)
        stages.of_bytes(cloud_bytes(scene))
        return image, camera, scene_cloud(scene, progress=stages.progress)


@dataclass(frozen=True, eq=False)
class SensorOrigin:
    """Where the scanner stood: `place` (3,), meters, in the scene's world, and the `source` of that."""

    place: Array
    source: str


def sensor_origin(scene: Scene, cloud: Cloud | None) -> SensorOrigin | None:
    """Where the scanner of the scene's cloud stood, by the scene or else by the cloud's file; None where unknown."""
    if "sensor_origin" in scene.model.model_fields_set:
        given = scene.model.sensor_origin
        return None if given is None else SensorOrigin(np.array(given, dtype=np.float64), "the scene's sensor_origin")
    if cloud is None or cloud.sensor_origin is None:
        return None
    return SensorOrigin(cloud.sensor_origin, "the cloud's file")


def read_picture(path: Path) -> Picture:
    """The picture (h, w, 3) uint8 of an image file, or of a bag's message; errors as of `read_colors` and
    `read_bag_picture`.
    """
    place = bag_place(path)
    return read_colors(path) if place is None else read_bag_picture(place)


def at_location(scene: Scene, place: Place, action: Callable[[], Value]) -> Value:
    """Return what `action` returns; its errors about bad input get their location in the scene file."""
    try:
        return action()
    except FileNotFoundError as error:
        raise scene.error(place, _missing(scene, error)) from error
    except (ValueError, ImportError, OSError) as error:
        raise scene.error(place, str(error)) from error


def _missing(scene: Scene, error: FileNotFoundError) -> str:
    """What is not there: the file, or the first of the folders that lead to it."""
    # Commands make scenes of the paths that they are given.
    needed = "needed a path relative to the scene file" if scene.path.exists() else "needed a file"
    if error.filename is None:
        return f"{error}: no such file; {needed}"
    folder = next((place for place in reversed(Path(error.filename).parents) if not place.exists()), None)
    if folder is not None:
        return f"{error.filename}: no such folder as {folder}; {needed}"
    return f"{error.filename}: no such file; {needed}"
