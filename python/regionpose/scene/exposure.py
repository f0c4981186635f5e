"""What one photo and one cloud of a scene show: sensors, and both sides of its regions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from regionpose.cameras import Camera
from regionpose.geometry.pose import Pose
from regionpose.io.clouds import Cloud
from regionpose.progress import Progress, part, with_progress
from regionpose.regions.image import ImageRegion
from regionpose.scene.document import Place
from regionpose.scene.input_checks import check_camera, check_intensity, check_photo_name, check_regions, check_unit
from regionpose.scene.loading import Scene, named_regions
from regionpose.scene.models import ImageSide, RegionItem, WorldRegionItem
from regionpose.scene.region_sides import Scan, WorldSide, image_side, plane_sides, scene_origin, world_side
from regionpose.scene.sensors import Picture, SensorOrigin, read_sensors, sensor_origin
from regionpose.scene.solver_config import scene_prior, scene_solver
from regionpose.scene.stages import Stages
from regionpose.solve.core_inputs import overlap_errors
from regionpose.solve.matching import RegionMatches, match_regions
from regionpose.solve.warning import PoseWarning
from regionpose.solve.warning_code import WarningCode
from regionpose.validation.arrays import Array


@dataclass(frozen=True, eq=False)
class Unpaired:
    """Image regions and world regions without correspondences, and their names."""

    image_names: tuple[str, ...] = ()
    image_regions: tuple[ImageRegion, ...] = ()
    world_names: tuple[str, ...] = ()
    world_sides: tuple[WorldSide, ...] = ()

    @property
    def can_match(self) -> bool:
        """Whether there are some on either side."""
        return bool(self.image_regions and self.world_sides)


@dataclass(frozen=True)
class Matching:
    """Which image region was found to be which world region, by their names.

    `alternatives`: other pairs that explain the image about as well, best first. `pose`: at which the pairs overlap,
    in the cloud's world, where edges gave one.
    """

    pairs: tuple[tuple[str, str], ...]
    unmatched_image: tuple[str, ...]
    unmatched_world: tuple[str, ...]
    alternatives: tuple[tuple[tuple[str, str], ...], ...]
    pose: Pose | None = None


@dataclass(frozen=True, eq=False)
class SceneData:
    """What a scene's files hold: sensors and both sides of each region, in the scene's order, and their names.

    `cloud.local_points` and the world sides are about `origin` (3,), meters; `sensor_origin`, where the
    scanner stood, isn't. `unpaired`: regions of one side. `matching`: which of these are which, None where they were
    not matched. `warnings`: evidence against them before any pose is estimated.
    """

    scene: Scene
    camera: Camera
    image: Picture
    cloud: Cloud | None
    origin: Array
    sensor_origin: SensorOrigin | None
    names: tuple[str, ...]
    image_regions: tuple[ImageRegion, ...]
    world_sides: tuple[WorldSide, ...]
    unpaired: Unpaired = Unpaired()
    matching: Matching | None = None
    warnings: tuple[PoseWarning, ...] = ()

    def overlap_errors(self, pose: Pose) -> tuple[float, Array]:
        """The overlap error of all regions and of each (k,) at a pose in the cloud's world; as of the solver's."""
        regions = [side.region for side in self.world_sides]
        return overlap_errors(self.camera, self.image_regions, regions, pose.rebase(self.origin))


def scene_sides(scene: Scene, stages: Stages | None = None, *, origin: Array | None = None) -> SceneData:
    """The sensors and regions of a scene of one photo; SceneError that names the line for a file that cannot be used.

    `origin`: the local origin, that of the cloud where it is None.
    """
    stages = stages or Stages()
    if scene.model.frames:
        raise scene.error(("frames",), f"found {len(scene.model.frames)} frames; needed a scene of one photo")
    image, camera, cloud = read_sensors(scene, stages)
    if cloud is not None and origin is not None:
        cloud = cloud.rebase(origin)
    center = scene_origin(scene, cloud) if origin is None else origin
    scanner = sensor_origin(scene, cloud)
    with stages.stage("image regions"):
        imaged = with_progress(_imaged(scene), stages.progress)
        images = [image_side(scene, (*one.place, "image"), one.image, image) for one, _ in imaged]
    with stages.stage("world regions"):
        scan, paired, fraction = Scan.of(cloud, center, scanner), scene.model.regions, _fraction_of_pairs(scene)
        sides = _world_sides(scene, "regions", paired, scan, part(stages.progress, 0.0, fraction))
        world_names, worlds = _unpaired_worlds(scene, scan, part(stages.progress, fraction, 1.0))
    names, count = tuple(one.name for one in _imaged(scene)), len(paired)
    unpaired = Unpaired(names[count:], tuple(images[count:]), world_names, worlds)
    regions = (names[:count], tuple(images[:count]), sides, unpaired)
    with stages.stage("checks"):
        return checked(SceneData(scene, camera, image, cloud, center, scanner, *regions))


class Imaged(NamedTuple):
    """A region of the photo: its place in the scene, its name, and its side there as written."""

    place: Place
    name: str
    image: ImageSide


def _imaged(scene: Scene) -> list[Imaged]:
    """The regions with a side in the photo, those with both sides first."""
    return [Imaged(one.place, one.name, one.image) for one in named_regions(scene) if one.image is not None]


def _fraction_of_pairs(scene: Scene) -> float:
    """The fraction of the world regions that are those of pairs, for the progress; planes count as one."""
    pairs, world_regions = len(scene.model.regions), scene.model.world_regions
    return pairs / max(1, pairs + (len(world_regions) if isinstance(world_regions, list) else 1))


def _world_sides(
    scene: Scene, key: str, items: Sequence[RegionItem | WorldRegionItem], scan: Scan, progress: Progress | None
) -> tuple[WorldSide, ...]:
    """The world sides of the regions that the scene writes out at `key`."""
    return tuple(
        world_side(scene, (key, index, "world"), one.world, scan, progress=item_progress)
        for index, (one, item_progress) in enumerate(with_progress(items, progress))
    )


def _unpaired_worlds(
    scene: Scene, scan: Scan, progress: Progress | None
) -> tuple[tuple[str, ...], tuple[WorldSide, ...]]:
    """Names and sides of the world regions without an image region."""
    written = scene.model.world_regions
    if isinstance(written, list):
        names = tuple(one.name for one in written)
        return names, _world_sides(scene, "world_regions", written, scan, progress)
    planes = plane_sides(scene, scan, progress=progress)
    return tuple(planes), tuple(planes.values())


def checked(sides: SceneData) -> SceneData:
    """The sides with the warnings about camera, cloud and regions that hold before any pose is known."""
    shape = (sides.image.shape[0], sides.image.shape[1])
    sparse = (
        PoseWarning(WarningCode.SPARSE_SAMPLING, (index,), {"remark": remark})
        for index, side in enumerate(sides.world_sides)
        for remark in side.remarks
    )
    regions = check_regions(sides.image_regions, [side.region for side in sides.world_sides], shape)
    cloud = () if sides.cloud is None else (*check_unit(sides.cloud), *check_intensity(sides.cloud))
    camera = (*check_camera(sides.camera, shape), *check_photo_name(sides.camera, sides.scene.image))
    return replace(sides, warnings=(*camera, *cloud, *regions, *sparse))


def matched(sides: SceneData) -> SceneData:
    """The sides with the pairs that were found among the regions of one side; the same where there are none to match.

    The pairs that the scene gives are kept, and limit where the others are searched. ValueError for regions that the
    core refuses; PoseError where no image region looks like any world region.
    """
    unpaired, pair_count = sides.unpaired, len(sides.names)
    if not unpaired.can_match:
        return sides
    images = (*sides.image_regions, *unpaired.image_regions)
    worlds = (*sides.world_sides, *unpaired.world_sides)
    found = match_regions(
        sides.camera,
        images,
        [side.region for side in worlds],
        known=[(index, index) for index in range(pair_count)],
        prior=scene_prior(sides.scene, sides.sensor_origin).rebase(sides.origin),
        solver=scene_solver(sides.scene),
    )
    matching = _matching(sides, found)
    paired = replace(
        sides,
        names=(*sides.names, *(image for image, _ in matching.pairs)),
        image_regions=tuple(images[i] for i, _ in found.pairs),
        world_sides=tuple(worlds[j] for _, j in found.pairs),
        matching=matching,
    )
    with_warnings = checked(paired)
    return replace(with_warnings, warnings=(*with_warnings.warnings, *found.warnings))


def _matching(sides: SceneData, found: RegionMatches) -> Matching:
    """What was found by the regions' names, without the pairs that the scene gives."""
    pair_count = len(sides.names)
    images = (*sides.names, *sides.unpaired.image_names)
    worlds = (*sides.names, *sides.unpaired.world_names)

    def named_pairs(pairs: tuple[tuple[int, int], ...]) -> tuple[tuple[str, str], ...]:
        return tuple((images[i], worlds[j]) for i, j in pairs if i >= pair_count)

    return Matching(
        named_pairs(found.pairs),
        tuple(images[i] for i in found.unmatched_image),
        tuple(worlds[j] for j in found.unmatched_world),
        tuple(named_pairs(pairs) for pairs in found.alternatives),
    )
