"""A scene run from its files to its pose."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from regionpose.cameras import Camera
from regionpose.clouds import Cloud
from regionpose.estimation.answer import PoseEstimate
from regionpose.estimation.options import Solver
from regionpose.estimation.prior import Prior
from regionpose.estimation.sample_fit import SampleFit, sample_fit
from regionpose.estimation.sides import overlap_errors
from regionpose.estimation.single import estimate_pose
from regionpose.estimation.warning import PoseWarning
from regionpose.pose import Pose
from regionpose.regions.image import ImageRegion
from regionpose.sanity import check_camera, check_regions, check_unit
from regionpose.scene.loading import Scene
from regionpose.scene.models import CameraFromWorld, QuaternionPose, SolverItem, WorldFromCamera
from regionpose.scene.sensors import (
    Picture,
    SensorOrigin,
    fitted_camera,
    named,
    scene_camera,
    scene_cloud,
    scene_image,
    sensor_origin,
)
from regionpose.scene.sides import Scan, WorldSide, image_side, scene_origin, world_side
from regionpose.scene.witness import SceneWitness, witnessed
from regionpose.witness import (
    Alignment,
    Photo,
    SceneFrame,
    SceneRefinement,
    check_alignment,
    refine_with_scene,
)

Array = NDArray[np.float64]


@dataclass
class Stages:
    """The seconds that each stage of a run took; `begin` is told its name when it begins."""

    begin: Callable[[str], object] = lambda name: None
    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Time a block as the stage `name`."""
        self.begin(name)
        start = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start


@dataclass(frozen=True, eq=False)
class SceneSides:
    """What a scene's files hold: sensors and both sides of each region, in the scene's order.

    `cloud.local_points` and the world sides are about `origin` (3,), meters; `sensor_origin`, where the
    scanner stood, isn't. `warnings`: what speaks against them before any pose is known.
    """

    scene: Scene
    camera: Camera
    image: Picture
    cloud: Cloud | None
    origin: Array
    sensor_origin: SensorOrigin | None
    image_regions: tuple[ImageRegion, ...]
    world_sides: tuple[WorldSide, ...]
    warnings: tuple[PoseWarning, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """The regions' names."""
        return tuple(region.name for region in self.scene.model.regions)

    def overlap_errors(self, pose: Pose) -> tuple[float, Array]:
        """The overlap error of all regions and of each (k,) at a pose in the cloud's world; as of the solver's."""
        regions = [side.region for side in self.world_sides]
        return overlap_errors(self.camera, self.image_regions, regions, pose.about(self.origin))


@dataclass(frozen=True, eq=False)
class SceneEstimate:
    """The pose of a scene's camera in the world of its cloud, and what it came from. `seconds` per stage; `witness`,
    `refinement`: what the rest of the scene said, None where it wasn't asked.
    """

    sides: SceneSides
    estimate: PoseEstimate
    seconds: dict[str, float]
    witness: SceneWitness | None = None
    refinement: SceneRefinement | None = None

    @property
    def prior(self) -> Prior:
        """What was known of the pose beforehand, in the cloud's world."""
        return scene_prior(self.sides.scene, self.sides.sensor_origin)

    @property
    def local_pose(self) -> Pose:
        """The pose for points about the scene's local origin."""
        return self.estimate.pose.about(self.sides.origin)

    @property
    def local_initial(self) -> Pose | None:
        """The initial pose that the scene gives, for points about the local origin; None when it gives none."""
        given = given_pose(self.sides.scene)
        return None if given is None else given.about(self.sides.origin)

    @property
    def sample_fits(self) -> tuple[SampleFit | None, ...]:
        """On which sides of its contour each region's samples are seen at the estimate; None where it has none."""
        sides = self.sides
        pairs = zip(sides.image_regions, sides.world_sides, strict=True)
        return tuple(sample_fit(sides.camera, self.local_pose, image, world.region) for image, world in pairs)

    @property
    def errors_before(self) -> Array:
        """Each region's overlap error (k,) at the initial pose; NaN where there is none."""
        pose = given_pose(self.sides.scene)
        return np.full(len(self.sides.names), np.nan) if pose is None else self.sides.overlap_errors(pose)[1]


def scene_sides(scene: Scene, stages: Stages | None = None) -> SceneSides:
    """The sensors and regions of a scene; SceneError that names the line for a file that cannot be used."""
    stages = stages or Stages()
    with stages.stage("read files"):
        image = scene_image(scene)
        camera = fitted_camera(scene, scene_camera(scene), image)
        cloud = scene_cloud(scene)
    origin, scanner = scene_origin(scene, cloud), sensor_origin(scene, cloud)
    count = len(scene.model.regions)
    with stages.stage("image regions"):
        image_regions = tuple(image_side(scene, index, image) for index in range(count))
    with stages.stage("world regions"):
        scan = Scan.of(cloud, origin, scanner)
        world_sides = tuple(world_side(scene, index, scan) for index in range(count))
    sides = SceneSides(scene, camera, image, cloud, origin, scanner, image_regions, world_sides)
    with stages.stage("checks"):
        return checked(sides)


def estimate_scene(scene: Scene, stages: Stages | None = None) -> SceneEstimate:
    """The pose of a scene.

    Parameters
    ----------
    scene : Scene
        As of `load_scene`.
    stages : Stages, optional
        Told when each stage of the run begins; keeps the seconds of each.

    Raises
    ------
    SceneError
        A ValueError, for bad input, naming the line.
    PoseError
        A ValueError, where no pose shows every region.
    """
    stages = stages or Stages()
    return estimate_sides(scene_sides(scene, stages), stages)


def estimate_sides(sides: SceneSides, stages: Stages | None = None) -> SceneEstimate:
    """The pose of the camera that saw both sides of a scene's regions; errors as of `estimate_scene`."""
    stages = stages or Stages()
    with stages.stage("pose"):
        try:
            estimate = _estimate(sides)
        except ValueError as error:
            raise _explained(error, sides) from error
    return _heard(SceneEstimate(sides, estimate, stages.seconds), stages)


def _heard(run: SceneEstimate, stages: Stages) -> SceneEstimate:
    """The run after the rest of the scene was heard, as far as the scene asks for that."""
    sides, solver = run.sides, run.sides.scene.model.solver
    if sides.cloud is None or not (solver.witness or solver.refine == "scene"):
        return run
    rest = RestOfScene(sides, sides.cloud)
    if solver.witness:
        with stages.stage("witness"):
            heard = witnessed(run.estimate, rest.align, lambda pose: _estimate(sides, pose))
            run = replace(run, estimate=heard.estimate, witness=heard.witness)
    if solver.refine == "scene":
        with stages.stage("refinement"):
            run = _refined(run, rest)
    return run


class RestOfScene:
    """The photo and the cloud of a scene away from its regions, for poses in the cloud's world."""

    def __init__(self, sides: SceneSides, cloud: Cloud) -> None:
        """Take the sides of a scene that has a cloud."""
        self._origin = sides.origin
        self._frame = SceneFrame(Photo.of(sides.image), cloud.local_points, sides.camera, sides.image_regions)

    def align(self, pose: Pose) -> Alignment:
        """How well they agree at a pose."""
        frame = self._frame
        return check_alignment(frame.image, frame.points, frame.camera, pose.about(self._origin), regions=frame.regions)

    def refine(self, estimate: PoseEstimate) -> SceneRefinement:
        """The pose of an estimate refined by them."""
        found = refine_with_scene(estimate.pose.about(self._origin), estimate.covariance, [self._frame])
        return replace(found, pose=found.pose.about(-self._origin), before=estimate.pose)


def _refined(run: SceneEstimate, rest: RestOfScene) -> SceneEstimate:
    """The run with its pose refined by the rest of the scene, if that says enough."""
    refinement = rest.refine(run.estimate)
    run = replace(run, refinement=refinement)
    if not refinement.refined:
        return run
    whole, errors = run.sides.overlap_errors(refinement.pose)
    estimate = replace(
        run.estimate,
        pose=refinement.pose,
        covariance=refinement.covariance,
        region_overlap_errors=errors,
        overlap_error=whole,
    )
    witness = run.witness and replace(run.witness, alignment=rest.align(refinement.pose))
    return replace(run, estimate=estimate, witness=witness)


def _explained(error: ValueError, sides: SceneSides) -> ValueError:
    """The error about a scene without a pose, with what spoke against its regions beforehand: often the cause."""
    remarks = "; ".join(warning.message_for(sides.names) for warning in sides.warnings)
    return type(error)(f"{error}; {remarks}") if remarks else error


def _estimate(sides: SceneSides, nearest: Pose | None = None) -> PoseEstimate:
    """The estimate by the regions alone; with the answer first that is nearest to a pose, if one is given."""
    model = sides.scene.model.solver
    prior = scene_prior(sides.scene, sides.sensor_origin)
    if nearest is not None:
        prior = prior.started_at(nearest)
    local = estimate_pose(
        sides.camera,
        sides.image_regions,
        [side.region for side in sides.world_sides],
        prior=prior.about(sides.origin),
        solver=_solver(model),
    )
    alternatives = tuple(replace(other, pose=other.pose.about(-sides.origin)) for other in local.alternatives)
    warnings = (*local.warnings, *sides.warnings)
    return replace(local, pose=local.pose.about(-sides.origin), alternatives=alternatives, warnings=warnings)


def _solver(item: SolverItem) -> Solver:
    """How the scene asks for its pose to be computed."""
    return Solver(
        system=item.system,
        integration=item.integration,
        mesh_size=item.mesh_size,
        start=item.start,
        refine=None if item.refine == "none" else "contour",
        driver=item.driver,
    )


def checked(sides: SceneSides) -> SceneSides:
    """The sides with the warnings about camera, cloud and regions that hold before any pose is known."""
    size = (sides.image.shape[1], sides.image.shape[0])
    sparse = (
        PoseWarning("sparse-sampling", "{0}: {remark}", (index,), {"remark": remark})
        for index, side in enumerate(sides.world_sides)
        for remark in side.remarks
    )
    regions = check_regions(sides.image_regions, [side.region for side in sides.world_sides], size)
    unit = () if sides.cloud is None else check_unit(sides.cloud)
    return replace(sides, warnings=(*check_camera(sides.camera, size), *unit, *regions, *sparse))


def scene_prior(scene: Scene, scanner: SensorOrigin | None) -> Prior:
    """What the scene says of the pose beforehand, in the cloud's world; SceneError for what is no prior.

    The camera stands near the scanner, where that is known, unless the scene says otherwise.
    """
    item = scene.model.prior
    initial = given_pose(scene)
    near = None if scanner is None or "camera_near" in item.model_fields_set else scanner.place
    return named(
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


def given_pose(scene: Scene) -> Pose | None:
    """The pose that the scene gives as `prior.initial`, in the cloud's world; None when it gives none."""
    given = scene.model.prior.initial
    if given is None:
        return None
    key = "camera_from_world" if isinstance(given, CameraFromWorld) else "world_from_camera"
    return named(scene, ("prior", "initial", key), lambda: _written_pose(given))


def _written_pose(given: CameraFromWorld | WorldFromCamera) -> Pose:
    item = given.camera_from_world if isinstance(given, CameraFromWorld) else given.world_from_camera
    if isinstance(item, QuaternionPose):
        pose = Pose.from_quat(item.quat_xyzw, item.translation_m)
    else:
        pose = Pose.from_matrix(item.matrix)
    return pose if isinstance(given, CameraFromWorld) else pose.inverse()
