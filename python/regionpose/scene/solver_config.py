"""The prior and the solver options of a scene."""

from __future__ import annotations

from typing import Any

from regionpose.geometry.pose import Pose
from regionpose.scene.loading import Scene
from regionpose.scene.models import CameraFromWorld, QuaternionPose, WorldFromCamera
from regionpose.scene.sensors import SensorOrigin, at_location
from regionpose.solve.options import Solver
from regionpose.solve.prior import SIGMAS, Prior


def scene_solver(scene: Scene) -> Solver:
    """How the scene asks for its pose to be computed."""
    item = scene.model.solver
    return Solver(
        system=item.system,
        integration=item.integration,
        mesh_size=item.mesh_size,
        start=item.start,
        refine=None if item.refine == "none" else "contour",
        driver=item.driver,
        frame_sigma_deg=item.frame_sigma_deg,
        frame_sigma_m=item.frame_sigma_m,
        focal_sigma_percent=item.focal_sigma_percent,
        center_sigma_px=item.center_sigma_px,
        max_rotation_sigma_deg=item.max_rotation_sigma_deg,
        max_translation_sigma_percent=item.max_translation_sigma_percent,
    )


def scene_prior(scene: Scene, scanner: SensorOrigin | None) -> Prior:
    """The scene's prior, in the cloud's world; SceneError for an invalid one.

    The camera stands near the scanner, where that is given, unless the scene's prior differs.
    """
    item = scene.model.prior
    initial = given_pose(scene)
    near = None if scanner is None or "camera_near" in item.model_fields_set else scanner.place
    return at_location(
        scene,
        ("prior",),
        lambda: Prior(
            up=item.up,
            up_sigma_deg=item.up_sigma_deg,
            initial=initial,
            initial_rotation_sigma_deg=item.initial_rotation_sigma_deg,
            initial_center_sigma_m=item.initial_center_sigma_m,
            camera_near=item.camera_near if near is None else near,
            camera_near_sigma_m=item.camera_near_sigma_m,
        ),
    )


def prior_values(prior: Prior) -> dict[str, Any]:
    """A prior as the scene's key `prior` holds it."""
    names = ("up", "camera_near", *SIGMAS)
    values = {name: getattr(prior, name) for name in names if getattr(prior, name) is not None}
    values = {name: list(value) if isinstance(value, tuple) else value for name, value in values.items()}
    if prior.initial is None:
        return values
    # Without the key the scanner's place counts, beside that of the pose.
    initial = {"camera_from_world": {"matrix": prior.initial.matrix.tolist()}}
    return {"camera_near": None, **values, "initial": initial}


def given_pose(scene: Scene) -> Pose | None:
    """The pose that the scene gives as `prior.initial`, in the cloud's world; None when it gives none."""
    given = scene.model.prior.initial
    if given is None:
        return None
    key = "camera_from_world" if isinstance(given, CameraFromWorld) else "world_from_camera"
    return at_location(scene, ("prior", "initial", key), lambda: _written_pose(given))


def _written_pose(given: CameraFromWorld | WorldFromCamera) -> Pose:
    item = given.camera_from_world if isinstance(given, CameraFromWorld) else given.world_from_camera
    if isinstance(item, QuaternionPose):
        pose = Pose.from_quat(item.quat_xyzw, item.translation_m)
    else:
        pose = Pose.from_matrix(item.matrix)
    return pose if isinstance(given, CameraFromWorld) else pose.inverse()
