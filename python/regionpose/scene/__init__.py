"""Scene files: a camera, an image, a cloud and regions named in one YAML or JSON file, run from there to a pose."""

from __future__ import annotations

from regionpose.scene.document import SceneError
from regionpose.scene.estimate import SceneEstimate, estimate_scene, estimate_sides
from regionpose.scene.exposure import SceneData, scene_sides
from regionpose.scene.loading import Scene, load_scene, scene_schema
from regionpose.scene.result import scene_result
from regionpose.scene.stages import Stages

__all__ = [
    "Scene",
    "SceneData",
    "SceneError",
    "SceneEstimate",
    "Stages",
    "estimate_scene",
    "estimate_sides",
    "load_scene",
    "scene_result",
    "scene_schema",
    "scene_sides",
]
