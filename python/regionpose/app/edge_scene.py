"""The scene of a session without its regions, whose pose comes from the edges of photos and clouds."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from numpy.typing import NDArray

from regionpose.cameras import Camera
from regionpose.io.clouds import Cloud
from regionpose.scene.exposure import SceneData, checked
from regionpose.scene.loading import Scene
from regionpose.scene.sensors import Picture, sensor_origin

REGION_KEYS = ("regions", "image_regions", "world_regions")
"""Keys of a scene, or of a frame, that hold its regions."""


def without_regions(values: Mapping[str, Any]) -> dict[str, Any]:
    """The values of a scene file, or of one of its frames, without its regions."""
    return {key: value for key, value in values.items() if key not in REGION_KEYS}


def compares_edges(values: Mapping[str, Any]) -> bool:
    """Whether a scene file lets edges of photo and cloud be compared."""
    return bool((values.get("solver") or {}).get("edges", True))


def bare_sides(
    scene: Scene, image: Picture, camera: Camera, cloud: Cloud, origin: NDArray[Any] | None = None
) -> SceneData:
    """Photo and cloud of a scene of one photo, without regions; the cloud about `origin` (3,), or its own."""
    about = cloud if origin is None else cloud.rebase(origin)
    return checked(SceneData(scene, camera, image, about, about.origin, sensor_origin(scene, cloud), (), (), ()))
