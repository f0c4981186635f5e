"""A scene run from its files to its pose."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import accumulate
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from regionpose.alignment.calibration import calibrate_with
from regionpose.alignment.photo_cloud import PhotoCloud
from regionpose.alignment.region_evidence import RegionEvidence
from regionpose.cameras import Camera
from regionpose.geometry.pose import Pose
from regionpose.io.clouds import Cloud
from regionpose.progress import check_wanted
from regionpose.regions.image import ImageRegion
from regionpose.regions.world import WorldRegion
from regionpose.scene.confirmed import RegionCheck, region_check
from regionpose.scene.exposure import SceneData, matched, scene_sides
from regionpose.scene.loading import Scene
from regionpose.scene.overlap_pairs import near_edges, paired_by_overlap, takes_edges
from regionpose.scene.sensors import SensorOrigin
from regionpose.scene.solver_config import given_pose, scene_prior, scene_solver
from regionpose.scene.stages import Stages
from regionpose.solve.edge_diagnostics import Alignment
from regionpose.solve.estimate import EdgeDiagnostics, PoseEstimate, RegionsOnly
from regionpose.solve.frame import Frame
from regionpose.solve.options import Solver
from regionpose.solve.prior import Prior
from regionpose.solve.rig import estimate_rig
from regionpose.solve.sample_fit import SampleFit, sample_fit
from regionpose.solve.single import estimate_pose
from regionpose.solve.warning import PoseWarning
from regionpose.validation.arguments import checked_arguments

Array = NDArray[np.float64]
Value = TypeVar("Value")


@dataclass(frozen=True, eq=False)
class SceneEstimate:
    """The pose of a scene's camera in the world of its clouds, and what it came from.

    `scene`: the whole of it. `frames`: the photos and clouds, one unless the scene has several. `estimate`: of all
    their regions, frame after frame, with the diagnostics of frames and edges. `seconds` per stage. `regions_found`:
    the planes that photos confirm at a pose by edges alone; None of others.
    """

    scene: Scene
    frames: tuple[SceneData, ...]
    estimate: PoseEstimate
    seconds: dict[str, float]
    regions_found: RegionCheck | None = None

    @property
    def sides(self) -> SceneData:
        """What the first frame holds, the only one of most scenes."""
        return self.frames[0]

    @property
    def camera(self) -> Camera:
        """The camera of all frames."""
        return self.sides.camera

    @property
    def names(self) -> tuple[str, ...]:
        """The regions' names, after that of their frame where the scene has frames."""
        return _names(self.frames)

    @property
    def views(self) -> tuple[SceneEstimate, ...]:
        """The run as each frame shows it: the same pose, with the frame's own regions."""
        ends = np.cumsum([len(one.names) for one in self.frames])[:-1]
        errors = np.split(self.estimate.diagnostics.region_overlap_errors, ends)
        return tuple(self._view(index, own) for index, own in enumerate(errors))

    def _view(self, index: int, errors: Array) -> SceneEstimate:
        if len(self.frames) == 1:
            return self
        whole, alignment = self.estimate.diagnostics, self.alignments[index]
        overlap_error = float("nan") if whole.rig is None else whole.rig.frames[index].overlap_error
        edges = whole.edges and replace(whole.edges, alignments=() if alignment is None else (alignment,))
        own = replace(whole, region_overlap_errors=errors, overlap_error=overlap_error, rig=None, edges=edges)
        planes = self.regions_found and self.regions_found.of_frame(index)
        estimate = replace(self.estimate, warnings=(), diagnostics=own)
        return replace(self, frames=(self.frames[index],), estimate=estimate, regions_found=planes)

    @property
    def alignments(self) -> tuple[Alignment | None, ...]:
        """How well photo and cloud of each frame agree; None of a frame without a cloud, or where they were not
        compared.
        """
        edges = self.estimate.diagnostics.edges
        found = iter(() if edges is None else edges.alignments)
        return tuple(None if sides.cloud is None else next(found, None) for sides in self.frames)

    @property
    def is_by_edges(self) -> bool:
        """Whether the pose is by edges alone, the scene having no regions."""
        edges = self.estimate.diagnostics.edges
        return edges is not None and edges.regions_only is None

    @property
    def scanner(self) -> SensorOrigin | None:
        """Where the scanner stood, by the first frame that knows."""
        return _scanner(self.frames)

    @property
    def prior(self) -> Prior:
        """What was known of the pose beforehand, in the clouds' world."""
        return _prior(self.frames)

    @property
    def local_pose(self) -> Pose:
        """The pose for points about the scene's local origin."""
        return self.estimate.pose.rebase(self.sides.origin)

    @property
    def local_initial(self) -> Pose | None:
        """The initial pose that the scene gives, for points about the local origin; None when it gives none."""
        given = given_pose(self.scene)
        return None if given is None else given.rebase(self.sides.origin)

    @cached_property
    def sample_fits(self) -> tuple[SampleFit | None, ...]:
        """On which sides of its contour each region's samples project at the estimate; None where it has none."""
        pairs = zip(*_regions(self.frames), strict=True)
        return tuple(sample_fit(self.camera, image, world, self.local_pose) for image, world in pairs)

    @property
    def errors_before(self) -> Array:
        """Each region's overlap error (k,) at the initial pose; NaN where there is none."""
        pose = given_pose(self.scene)
        if pose is None or not self.names:
            return np.full(len(self.names), np.nan)
        return np.concatenate([sides.overlap_errors(pose)[1] for sides in self.frames])


def _regions(frames: Sequence[SceneData]) -> tuple[list[ImageRegion], list[WorldRegion]]:
    """Image and world regions of all frames, frame after frame."""
    images = [region for sides in frames for region in sides.image_regions]
    return images, [side.region for sides in frames for side in sides.world_sides]


def _names(frames: Sequence[SceneData]) -> tuple[str, ...]:
    return tuple(f"{one.scene.name}: {name}" if one.scene.name else name for one in frames for name in one.names)


def _scanner(frames: Sequence[SceneData]) -> SensorOrigin | None:
    """Where the scanner stood, by the first frame that knows."""
    return next((sides.sensor_origin for sides in frames if sides.sensor_origin is not None), None)


def _prior(frames: Sequence[SceneData]) -> Prior:
    return scene_prior(frames[0].scene, _scanner(frames))


def _region_prior(frames: Sequence[SceneData]) -> Prior:
    """What regions are solved with: pairs that follow from a pose by edges hold no farther from it."""
    poses = [one.matching.pose for one in frames if one.matching is not None and one.matching.pose is not None]
    return near_edges(_prior(frames), poses[0]) if poses else _prior(frames)


@checked_arguments
def estimate_scene(scene: Scene, stages: Stages | None = None) -> SceneEstimate:
    """The pose of a scene, of one photo or of several frames.

    Parameters
    ----------
    scene : Scene
        As of `load_scene`.
    stages : Stages, optional
        Reports each stage of the run when it begins; keeps the seconds of each.

    Raises
    ------
    SceneError
        A ValueError, for bad input, naming the line.
    PoseError
        A ValueError, where no pose shows every region.
    """
    stages = stages or Stages()
    frames: list[SceneData] = []
    for index, frame in enumerate(scene.frames):
        with stages.within(frame_label(frame, index, len(scene.model.frames))):
            frames.append(scene_sides(frame, stages, origin=frames[0].origin if frames else None))
    return estimate_frames(scene, frames, stages)


def estimate_sides(sides: SceneData, stages: Stages | None = None) -> SceneEstimate:
    """The pose of the camera that saw both sides of a scene's regions; errors as of `estimate_scene`."""
    return estimate_frames(sides.scene, [sides], stages)


def estimate_frames(
    scene: Scene, given: Sequence[SceneData], stages: Stages | None = None, *, with_planes: bool = True
) -> SceneEstimate:
    """The one pose of the camera in all frames of a scene; `with_planes`: with the planes that photos confirm at a pose
    by edges alone. Errors as of `estimate_scene`.
    """
    stages = stages or Stages()
    if not has_regions(given):
        return estimate_edges(scene, given, stages, with_planes=with_planes)
    return with_edges(estimate_regions(scene, given, stages), stages)


def has_regions(frames: Sequence[SceneData]) -> bool:
    """Whether any frame has pairs of regions, or regions to be matched."""
    return any(sides.names or sides.unpaired.can_match for sides in frames)


def estimate_edges(
    scene: Scene, given: Sequence[SceneData], stages: Stages | None = None, *, with_planes: bool = True
) -> SceneEstimate:
    """The one pose of all frames by the edges of their photos and clouds alone, as of `calibrate`."""
    frames, stages = tuple(given), stages or Stages()
    with stages.stage("edges"):
        found, scanner = _explained(lambda: _by_edges(frames, stages), frames), _scanner(frames)
    estimate = _in_world(found, frames)
    if not with_planes:
        return SceneEstimate(scene, frames, estimate, stages.seconds)
    with stages.stage("planes"):
        place = _edges_of(found).prior.camera_near if scanner is None else scanner.place - frames[0].origin
        seen, solver = photo_clouds(frames), scene_solver(scene)
        planes = region_check(
            frames[0].camera, seen, found, sensor_origin=place, solver=solver, progress=stages.progress
        )
    return SceneEstimate(scene, frames, estimate, stages.seconds, regions_found=planes)


def _edges_of(estimate: PoseEstimate) -> EdgeDiagnostics:
    """The diagnostics of an estimate by edges."""
    assert estimate.diagnostics.edges is not None
    return estimate.diagnostics.edges


def _by_edges(frames: Sequence[SceneData], stages: Stages) -> PoseEstimate:
    """The pose of all frames by edges alone, about the local origin."""
    return _calibrated(frames, None, _edge_prior(frames), scene_solver(frames[0].scene), stages)


def estimate_regions(scene: Scene, given: Sequence[SceneData], stages: Stages | None = None) -> SceneEstimate:
    """The one pose of all frames by their regions alone, before edges are compared; errors as above."""
    stages = stages or Stages()
    frames = tuple(_matched(sides, stages, frame_label(sides.scene, k, len(given))) for k, sides in enumerate(given))
    with stages.stage("pose"):
        return _explained(lambda: _run(scene, frames, stages.seconds), frames)


def frame_label(frame: Scene, index: int, count: int) -> str:
    """Which of several frames this is, for the progress; nothing of a scene of one photo."""
    return f"frame {index + 1} of {count}, {frame.name}" if frame.name else ""


def _matched(sides: SceneData, stages: Stages, which: str) -> SceneData:
    """The sides with what is to be matched in pairs; ValueError that names the frame where nothing matches."""
    if not sides.unpaired.can_match:
        return sides
    with stages.within(which), stages.stage("matching"):
        if takes_edges(sides):
            sides = paired_by_overlap(sides, lambda: _by_edges([sides], stages))
        return _explained(lambda: matched(sides), [sides])


def _run(
    scene: Scene, frames: tuple[SceneData, ...], seconds: dict[str, float], nearest: Pose | None = None
) -> SceneEstimate:
    """The run by the regions alone; with the solution first that is nearest to a pose, if one is given."""
    prior = _region_prior(frames)
    if nearest is not None:
        prior = prior.started_at(nearest)
    prior, solver, camera = prior.rebase(frames[0].origin), scene_solver(frames[0].scene), frames[0].camera
    if len(frames) == 1:
        local = estimate_pose(camera, *_regions(frames), prior=prior, solver=solver)
        return SceneEstimate(scene, frames, _in_world(local, frames), seconds)
    given = [Frame(*_regions([sides]), name=sides.scene.name) for sides in frames]
    rig = estimate_rig(camera, given, prior=prior, solver=solver)
    return SceneEstimate(scene, frames, _in_world(rig, frames), seconds)


def uses_edges(run: SceneEstimate) -> bool:
    """Whether edges are to be compared: the scene wants it, and there is a cloud."""
    return run.scene.model.solver.edges and any(sides.cloud is not None for sides in run.frames)


def with_edges(run: SceneEstimate, stages: Stages | None = None) -> SceneEstimate:
    """The run of regions alone with the edges of photos and clouds in the same posterior, as far as the scene asks for
    that.

    It takes far longer than the regions' pose; `progress.while_wanted` ends it.
    """
    if not uses_edges(run):
        return run
    origin, solver, latest = run.frames[0].origin, scene_solver(run.scene), run
    rig = run.estimate.diagnostics.rig
    if rig is not None and rig.between_frame_sigma is not None:
        sigma = rig.between_frame_sigma
        solver = replace(solver, frame_sigma_deg=sigma.rotation_sigma_deg, frame_sigma_m=sigma.center_sigma_m)

    def reestimate(pose: Pose) -> PoseEstimate:
        nonlocal latest
        check_wanted()
        latest = _run(run.scene, run.frames, run.seconds, pose.rebase(-origin))
        return _rebased(latest.estimate, origin)

    counts = accumulate((len(sides.names) for sides in run.frames), initial=0)
    starts = tuple(start for start, sides in zip(counts, run.frames, strict=False) if sides.cloud is not None)
    regions = RegionEvidence(_rebased(run.estimate, origin), run.camera, _regions(run.frames), starts, reestimate)
    stages = stages or Stages()
    with stages.stage("edges"):
        found = _explained(lambda: _calibrated(run.frames, regions, run.prior, solver, stages), run.frames)
    return replace(latest, estimate=_rebased(found, -origin))


def _calibrated(
    frames: Sequence[SceneData], regions: RegionEvidence | None, prior: Prior, solver: Solver, stages: Stages
) -> PoseEstimate:
    """The estimate by edges, with regions or without, about the local origin."""
    origin, scanner = frames[0].origin, _scanner(frames)
    photos = [frame for frame in photo_clouds(frames) if frame is not None]
    place = None if scanner is None else scanner.place - origin
    return calibrate_with(photos, regions, prior.rebase(origin), place, solver, stages.progress)


def _edge_prior(frames: Sequence[SceneData]) -> Prior:
    """What is known of a pose by edges alone: a deviation without a place is about the clouds' origin then."""
    scanner, item = _scanner(frames), frames[0].scene.model.prior
    if scanner is None and item.camera_near is None and item.camera_near_sigma_m is not None:
        scanner = SensorOrigin(np.zeros(3), "assumption")
    return scene_prior(frames[0].scene, scanner)


def photo_clouds(frames: Sequence[SceneData]) -> list[PhotoCloud | None]:
    """The photos and clouds of frames, with their regions; None of a frame without a cloud."""
    return [
        None if sides.cloud is None else PhotoCloud.of(sides.camera, _frame(sides, sides.cloud)) for sides in frames
    ]


def _frame(sides: SceneData, cloud: Cloud) -> Frame:
    """The frame of a scene, about the local origin."""
    # No brightness of colors: they may come from this very photo, at a wrong pose.
    return Frame(*_regions([sides]), image=sides.image, points=cloud.local_points, intensity=cloud.intensity)


def _explained(action: Callable[[], Value], frames: Sequence[SceneData]) -> Value:
    """What `action` returns; its errors list the warnings from before the pose, too: often the cause."""
    try:
        return action()
    except ValueError as error:
        names = _names(frames)
        own = f"{frames[0].scene.name}: " if len(frames) == 1 and frames[0].scene.name else ""
        remarks = "".join(f"; {warning.text_with(names)}" for warning in _warnings(frames))
        raise type(error)(f"{own}{error}{remarks}") from error


def _warnings(frames: Sequence[SceneData]) -> tuple[PoseWarning, ...]:
    """Warnings on cameras, clouds and regions from before the pose, once each, by the regions' places among all."""
    found: dict[tuple[str, str], PoseWarning] = {}
    names, before = _names(frames), 0
    for sides in frames:
        for warning in sides.warnings:
            shifted = replace(warning, regions=tuple(before + index for index in warning.regions))
            found.setdefault((shifted.code, shifted.text_with(names)), shifted)
        before += len(sides.names)
    return tuple(found.values())


def _in_world(local: PoseEstimate, frames: Sequence[SceneData]) -> PoseEstimate:
    """The estimate about the local origin in the clouds' world, with the warnings from before the pose."""
    return replace(_rebased(local, -frames[0].origin), warnings=(*local.warnings, *_warnings(frames)))


def _rebased(estimate: PoseEstimate, origin: Array) -> PoseEstimate:
    """The estimate for points about an origin (3,)."""
    whole = estimate.diagnostics
    alternatives = tuple(replace(other, pose=other.pose.rebase(origin)) for other in whole.alternatives)
    shared = tuple(replace(edge, ends=edge.ends - origin) for edge in whole.shared_edges)
    rig, edges = whole.rig, whole.edges
    if rig is not None:
        ones = tuple(replace(one, pose=one.pose.rebase(origin)) for one in rig.leave_one_out)
        refined = None if rig.refinement is None else replace(rig.refinement, pose=rig.refinement.pose.rebase(origin))
        rig = replace(rig, leave_one_out=ones, refinement=refined)
    diagnostics = replace(
        whole,
        alternatives=alternatives,
        shared_edges=shared,
        rig=rig,
        edges=None if edges is None else _rebased_edges(edges, origin),
    )
    return replace(estimate, pose=estimate.pose.rebase(origin), diagnostics=diagnostics)


def _rebased_edges(edges: EdgeDiagnostics, origin: Array) -> EdgeDiagnostics:
    """The diagnostics of edges for points about an origin (3,)."""
    return replace(
        edges,
        prior=edges.prior.rebase(origin),
        modes=tuple(replace(mode, pose=mode.pose.rebase(origin)) for mode in edges.modes),
        alignments=tuple(replace(each, nearest=each.nearest.rebase(origin)) for each in edges.alignments),
        regions_only=None if edges.regions_only is None else _rebased_regions(edges.regions_only, origin),
    )


def _rebased_regions(regions: RegionsOnly, origin: Array) -> RegionsOnly:
    pose = None if regions.pose is None else regions.pose.rebase(origin)
    return replace(regions, estimate=_rebased(regions.estimate, origin), pose=pose)
