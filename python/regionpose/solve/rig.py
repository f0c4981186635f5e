"""One rigid pose from many frames of a rig, what each frame does to it, and the camera refined with it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from regionpose import _core
from regionpose.cameras import Camera
from regionpose.geometry.pose import Pose
from regionpose.regions.image import ImageRegion
from regionpose.regions.world import WorldRegion
from regionpose.solve.between_frame_sigma import Factor, Scattered, scattered
from regionpose.solve.contours import Contours, contours_of, distances_of, robust_sigma
from regionpose.solve.core_inputs import core_problem
from regionpose.solve.estimate import PoseError, PoseEstimate
from regionpose.solve.frame import Frame, check_has_regions, named_frames
from regionpose.solve.intrinsics import (
    CameraPart,
    ContourProblem,
    parameter_names,
    refined_camera,
)
from regionpose.solve.options import EXACT_EXPOSURE, Solver, checked_solver
from regionpose.solve.prior import Prior
from regionpose.solve.reevaluate import scattered_estimate
from regionpose.solve.rig_diagnostics import OUTLIER_RATIO, CameraRefinement, FrameFit, LeaveOneOut, RigDiagnostics
from regionpose.solve.single import estimate_pose
from regionpose.solve.warning import PoseWarning
from regionpose.solve.warning_code import WarningCode
from regionpose.solve.warning_texts import Value
from regionpose.validation.arguments import checked_arguments

Array = NDArray[np.float64]

MOST_LOST = 3.0
"""Times the joint pose's deviations, in any direction, beyond which frames by themselves don't add up to it, as where
each shows a scan line alone: 10 of five such frames, 1.9 at most of natural ones, whose own poses are near normal."""

ANOTHER_PLACE = np.radians(5.0)
"""Rotation from which on two poses are different places, as of `PoseEstimate.confidence`."""


@checked_arguments
def estimate_rig(
    camera: Camera,
    frames: Sequence[Frame],
    *,
    prior: Prior | None = None,
    solver: Solver | None = None,
    refine_camera: Sequence[CameraPart] = (),
) -> PoseEstimate:
    """The one pose `camera_from_world` at which all frames of a rig project onto the observed regions.

    Every frame is left out in turn and compared with the pose of the others. Errors of whole frames, as of the time
    between photo and scan, are in no region's covariance: their size is estimated from the scatter of the frames' own
    poses, and the pose and its covariance allow for them. An error that is the same in all frames does not show.

    Parameters
    ----------
    camera : Camera
        That took all frames.
    frames : sequence of Frame
        With regions, the world regions in the rig's frame, such as its lidar's, meters.
    prior : Prior, optional
        What is known of the pose, as of `estimate_pose`.
    solver : Solver, optional
        How the poses are computed.
    refine_camera : sequence of {"focal", "center", "distortion"}
        Which of fx and fy, cx and cy, k1 and k2 are estimated together with the pose (docs/math.md, section 12), and
        taken where they are determined and differ from the given ones by more than noise.

    Returns
    -------
    PoseEstimate
        The pose `camera_from_world`, the world being the rig's frame, of all regions together, frame after frame; it
        and its covariance allow for errors of whole frames. `diagnostics.rig` holds each frame's fit, the pose without
        each frame, and the camera. Warnings are those of all regions, `outlier-frame` for each frame that disagrees
        with the others (found one after the other, the worst first), and `unobservable-intrinsics` where the camera
        could not be refined.

    Raises
    ------
    ValueError
        For bad input, naming the frame, as for a frame without regions.
    PoseError
        A ValueError, where no pose shows every region.

    """
    listed = _checked_frames(camera, frames)
    names = parameter_names(camera, refine_camera)
    rig = _Rig.of(camera, listed, prior, solver)
    if names and all(region.is_line for region in _sides(listed)[1]):
        raise ValueError(
            "refine_camera found regions sampled along one scan line alone; needed one that has an outline"
        )
    estimate = rig.joint(listed)
    refinement = None
    contours = _contours(camera, estimate.pose, listed) if names else None
    if contours is not None:
        refinement = refined_camera(camera, estimate.pose, contours, refine_camera)
        if refinement.outcome == "refined":
            rig = replace(rig, camera=refinement.camera)
            near = rig if rig.prior.initial is not None else rig.started_at(refinement.pose)
            estimate = near.joint(listed)
    estimate, found = rig.with_scatter(listed, estimate)
    leave_one_out = rig.leave_one_out(listed, estimate.pose)
    fits = RigDiagnostics(
        camera=rig.camera,
        frames=_frame_fits(rig.camera, listed, estimate),
        leave_one_out=leave_one_out,
        between_frame_sigma=None if found is None else found.between_frame_sigma,
        refinement=refinement,
    )
    warnings = (*estimate.warnings, *rig.outlier_warnings(listed, leave_one_out), *_camera_warnings(refinement))
    return replace(estimate, warnings=warnings, diagnostics=replace(estimate.diagnostics, rig=fits))


def rig_pose(camera: Camera, frames: Sequence[Frame], prior: Prior | None, solver: Solver | None) -> PoseEstimate:
    """The pose as of `estimate_rig`, without what each frame does to it."""
    listed = _checked_frames(camera, frames)
    rig = _Rig.of(camera, listed, prior, solver)
    return rig.with_scatter(listed, rig.joint(listed))[0]


@dataclass(frozen=True)
class _Rig:
    """Poses of some frames of a rig, all found in the same way."""

    camera: Camera
    prior: Prior
    solver: Solver
    options: Solver
    """As given; `solver` leaves out of it how far frames of several are off as wholes, which their scatter tells."""

    @classmethod
    def of(cls, camera: Camera, frames: Sequence[Frame], prior: Prior | None, solver: Solver | None) -> _Rig:
        """The rig of these frames."""
        options = checked_solver(solver)
        own = replace(options, **EXACT_EXPOSURE) if len(frames) > 1 else options
        return cls(camera, prior or Prior(), own, options)

    def started_at(self, pose: Pose) -> _Rig:
        """The same from a pose that is a start alone, in place of the prior's."""
        return replace(self, prior=self.prior.started_at(pose))

    def joint(self, frames: Sequence[Frame]) -> PoseEstimate:
        """The pose of all the frames."""
        try:
            return estimate_pose(self.camera, *_sides(frames), prior=self.prior, solver=self.solver)
        except PoseError:
            raise
        except ValueError as error:
            raise self._of_frame(frames, error) from error

    def _of_frame(self, frames: Sequence[Frame], error: ValueError) -> ValueError:
        """An error about all frames' regions as one about those of the frame that it comes from."""
        for frame in frames:
            try:
                core_problem(self.camera, frame.image_regions, frame.world_regions, self.solver)
            except ValueError as own:
                return ValueError(f"{frame.name}: {own}")
        return error

    def with_scatter(self, frames: Sequence[Frame], joint: PoseEstimate) -> tuple[PoseEstimate, Scattered | None]:
        """The estimate of all frames that allows for errors of whole frames, and how they scatter."""
        found = self.scattered(frames, joint)
        if found is not None:
            pose = joint.pose.retract(found.increment)
            # Errors of the calibration are the same in all frames.
            calibration = self.options.calibration_covariance(
                joint.diagnostics.focal_shift, joint.diagnostics.pixel_angle_rad
            )
            covariance = found.covariance + calibration
            return scattered_estimate(joint, pose, covariance, self.camera, *_sides(frames), self.solver), found
        if len(frames) > 1:
            # How far frames are off cannot be estimated.
            options = replace(self.options, driver=self.solver.driver)
            return replace(self.started_at(joint.pose), solver=options).joint(frames), None
        return joint, None

    def scattered(self, frames: Sequence[Frame], joint: PoseEstimate) -> Scattered | None:
        """The pose that allows for errors of whole frames, at the place of the joint one; None where fewer than two
        frames have a pose of their own there, what these hold does not add up to the joint one, or that one leaves a
        direction free.
        """
        distance = float(np.linalg.norm(joint.pose.transform(_middle(frames))))
        deviations = ANOTHER_PLACE * np.array([1.0, 1.0, 1.0, distance, distance, distance])
        if len(frames) < 2 or not np.isfinite(joint.covariance).all():
            return None
        own = [self._factor(frame, joint, deviations) for frame in frames]
        factors = [factor for factor in own if factor is not None]
        if len(factors) < 2:
            return None
        known = Factor.about(deviations)
        if any(_is_sampled(frame) for frame in frames):
            # Outlines' poses know nothing of the prior but which of them it leaves.
            prior = self.prior.core.gaussian(joint.pose.rotation_matrix, joint.pose.translation)
            known = Factor(*(ours + given for ours, given in zip(known, prior, strict=True)))
        together = np.linalg.inv(known.information + sum(factor.information for factor in factors))
        wider = np.linalg.eigvals(np.linalg.pinv(joint.covariance, hermitian=True) @ together).real.max()
        return None if wider > MOST_LOST**2 else scattered(factors, known)

    def _factor(self, frame: Frame, joint: PoseEstimate, deviations: Array) -> Factor | None:
        """A frame's own information on the pose, about the joint one; None where no solution of its own is at that
        place, or it leaves a direction free.
        """
        about = Prior(
            initial=joint.pose,
            initial_rotation_sigma_deg=float(np.degrees(deviations[0])),
            initial_center_sigma_m=float(deviations[-1]),
        )
        near = replace(self, prior=about, solver=replace(self.solver, start="paper"))
        try:
            alone = near.joint([frame])
        except PoseError:
            return None
        solutions = [
            (joint.pose.local_coordinates(solution.pose), solution.covariance)
            for solution in (alone, *alone.diagnostics.alternatives)
        ]
        increment, covariance = min(solutions, key=lambda solution: float(np.linalg.norm(solution[0] / deviations)))
        if np.linalg.norm(increment[:3]) > ANOTHER_PLACE or not np.isfinite(covariance).all():
            return None
        return Factor.of_posterior(increment, covariance, deviations, held=_is_sampled(frame))

    def leave_one_out(self, frames: Sequence[Frame], joint: Pose) -> tuple[LeaveOneOut, ...]:
        """The pose of all frames but one, for each; nothing of a single frame."""
        if len(frames) < 2:
            return ()
        near, middle = self.started_at(joint), _middle(frames)
        contours = [_contours(self.camera, joint, [frame]) for frame in frames]
        found = []
        for index, frame in enumerate(frames):
            others = [*frames[:index], *frames[index + 1 :]]
            without = near.joint(others)
            pose, covariance = without.pose, without.covariance
            beside = [*contours[:index], *contours[index + 1 :]]
            residual, expected = _held_out(self.camera, pose, covariance, contours[index], beside)
            found.append(
                LeaveOneOut(
                    name=frame.name,
                    pose=pose,
                    covariance=covariance,
                    rotation_deg=float(np.degrees(np.linalg.norm(pose.local_coordinates(joint)[:3]))),
                    shift_m=float(np.linalg.norm(joint.transform(middle) - pose.transform(middle))),
                    residual_px=residual,
                    expected_px=expected,
                )
            )
        return tuple(found)

    def outlier_warnings(self, frames: Sequence[Frame], leave_one_out: Sequence[LeaveOneOut]) -> list[PoseWarning]:
        """A warning for each frame that disagrees; the worst is left out before the others are tested again.

        Of two frames that disagree either may be wrong, so both are named.
        """
        warnings: list[PoseWarning] = []
        places = _places(frames)
        while disagreeing := [one for one in leave_one_out if one.is_outlier]:
            if len(frames) == 2:
                return warnings + [self._outlier_warning(one, frames, places) for one in disagreeing]
            worst = max(disagreeing, key=lambda one: one.residual_px / one.expected_px)
            warnings.append(self._outlier_warning(worst, frames, places))
            frames = [frame for frame in frames if frame.name != worst.name]
            leave_one_out = self.leave_one_out(frames, worst.pose)
        return warnings

    def _outlier_warning(self, one: LeaveOneOut, frames: Sequence[Frame], places: Mapping[str, int]) -> PoseWarning:
        """The warning of a frame that disagrees, with those of its regions that do where others of it agree."""
        frame = next(frame for frame in frames if frame.name == one.name)
        others = [_contours(self.camera, one.pose, [other]) for other in frames if other.name != one.name]
        found = []
        for place, (image, world) in enumerate(zip(frame.image_regions, frame.world_regions, strict=True)):
            own = _contours(self.camera, one.pose, [replace(frame, image_regions=[image], world_regions=[world])])
            residual, expected = _held_out(self.camera, one.pose, one.covariance, own, others)
            found.append((places[one.name] + place, residual, expected))
        off = [(place, residual) for place, residual, expected in found if residual > OUTLIER_RATIO * expected]
        if not off or len(off) == len(found) > 1:
            return _frame_warning(one, [])
        return _frame_warning(one, off)


def _checked_frames(camera: Camera, frames: Sequence[Frame]) -> list[Frame]:
    named = named_frames(frames, "frame")
    for frame in named:
        check_has_regions(frame)
        _solid_angles(camera, frame)
    return named


def _sides(frames: Sequence[Frame]) -> tuple[list[ImageRegion], list[WorldRegion]]:
    """Image and world regions of all frames, frame after frame."""
    images = [region for frame in frames for region in frame.image_regions]
    return images, [region for frame in frames for region in frame.world_regions]


def _middle(frames: Sequence[Frame]) -> Array:
    """The middle (3,) of all regions."""
    rings = [ring.mean(axis=0) for region in _sides(frames)[1] for ring in region.rings]
    return np.asarray(np.mean(rings, axis=0), dtype=np.float64)


def _is_sampled(frame: Frame) -> bool:
    """Whether a frame's pose is that of samples, which a prior moves."""
    return any(region.samples is not None for region in frame.world_regions)


def _solid_angles(camera: Camera, frame: Frame) -> Array:
    """Solid angles (k,) of a frame's image regions; ValueError where the camera sees no ray."""
    try:
        bearings = [region.bearings(camera) for region in frame.image_regions]
    except ValueError as error:
        raise ValueError(f"{frame.name}: {error}") from error
    return np.array([float(_core.spherical_moments(rings, 0)[0, 0, 0]) for rings in bearings])


def _frame_fits(camera: Camera, frames: Sequence[Frame], estimate: PoseEstimate) -> tuple[FrameFit, ...]:
    """The overlap error of a frame is the mean of its regions', weighted by their observed areas on the sphere."""
    ends = np.cumsum([len(frame.image_regions) for frame in frames])[:-1]
    fits = []
    for frame, errors in zip(frames, np.split(estimate.diagnostics.region_overlap_errors, ends), strict=True):
        overlap_error = float(np.average(errors, weights=_solid_angles(camera, frame)))
        residual = _residual_px(camera, estimate.pose, _contours(camera, estimate.pose, [frame]))
        fits.append(FrameFit(frame.name, overlap_error, errors, residual))
    return tuple(fits)


def _places(frames: Sequence[Frame]) -> dict[str, int]:
    """The place of each frame's first region among those of all, by the frame's name."""
    starts = np.cumsum([0, *(len(frame.image_regions) for frame in frames)])[:-1].tolist()
    return dict(zip((frame.name for frame in frames), starts, strict=True))


def _held_out(
    camera: Camera, pose: Pose, covariance: Array, own: Contours | None, others: Sequence[Contours | None]
) -> tuple[float, float]:
    """Size of a frame's distances at the pose of the others, of this covariance, and the one to expect, pixels.

    `expected^2 = s^2 + mean of diag(J C J^T)`: the median over the others of their distances' root mean square, and
    what the covariance C of their pose moves the frame's outlines by. A frame, not a vertex, counts as one among the
    others: an error of its plane puts all of its outline off.
    """
    residual = _residual_px(camera, pose, own)
    parts = [contours for contours in others if contours is not None]
    if own is None or not parts or not np.isfinite(covariance).all():
        return residual, float("inf")
    distances = [distances_of(camera, part, pose) for part in parts]
    scatter = float(np.median([np.inf if part is None else _root_mean_square(part.values) for part in distances]))
    problem = ContourProblem(camera, pose, own)
    jacobian = problem.jacobian(np.zeros(6)) / problem.unit
    propagated = float(np.mean(np.einsum("mi,ij,mj->m", jacobian, covariance, jacobian)))
    return residual, float(np.hypot(scatter, np.sqrt(propagated)))


def _contours(camera: Camera, pose: Pose, frames: Sequence[Frame]) -> Contours | None:
    """The contours of all regions that are not single scan lines, beside their outlines; None without any."""
    shaped = [pair for pair in zip(*_sides(frames), strict=True) if not pair[1].is_line]
    if not shaped:
        return None
    images, worlds = zip(*shaped, strict=True)
    return contours_of(camera, images, worlds, pose)


def _residual_px(camera: Camera, pose: Pose, contours: Contours | None) -> float:
    """Size of the distances, pixels; infinite where an outline isn't wholly visible, NaN without outlines.

    The root mean square, or the robust standard deviation where that is less: a few edges put off as wholes make the
    median of their distances a poor guess, a part of the contour that is another object's does so to the square.
    """
    if contours is None:
        return float("nan")
    distances = distances_of(camera, contours, pose)
    if distances is None:
        return float("inf")
    return min(_root_mean_square(distances.values), robust_sigma(distances.values))


def _root_mean_square(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _frame_warning(one: LeaveOneOut, off: Sequence[tuple[int, float]]) -> PoseWarning:
    """The warning of a frame, whose regions at these places, as far off in pixels, are what disagrees."""
    residual = max((residual for _, residual in off), default=one.residual_px)
    values: dict[str, Value] = {"name": one.name, "expected_px": one.expected_px}
    if np.isfinite(residual):
        values["residual_px"] = residual
    return PoseWarning(WarningCode.OUTLIER_FRAME, tuple(place for place, _ in off), values)


def _camera_warnings(refinement: CameraRefinement | None) -> list[PoseWarning]:
    if refinement is None or refinement.outcome != "weak":
        return []
    sigmas = dict(zip(refinement.parameters, refinement.sigma, strict=True))
    named = ", ".join(f"{name} (standard deviation {sigmas[name]:.2g})" for name in refinement.weak)
    return [PoseWarning(WarningCode.UNOBSERVABLE_INTRINSICS, values={"parameters": named})]
