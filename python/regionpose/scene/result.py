"""A scene's estimate as plain values for JSON: frames and units in the names."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from regionpose.alignment.calibration import Calibration
from regionpose.geometry.pose import Pose
from regionpose.io.exports.view import camera_values
from regionpose.scene.estimate import SceneEstimate
from regionpose.scene.exposure import SceneData
from regionpose.scene.inputs import input_values, versions
from regionpose.scene.loading import Scene
from regionpose.scene.paths import relative
from regionpose.scene.region_sides import WorldSide
from regionpose.scene.region_values import confirmed_values
from regionpose.scene.values import pose_values, warning_values
from regionpose.scene.verdict import limits
from regionpose.solve.estimate import PoseEstimate

FORMAT = "regionpose result 1"

COVARIANCE_CONVENTION = (
    "order [omega_x, omega_y, omega_z (rad), tau_x, tau_y, tau_z (m)] along the camera's axes; "
    "increment on the left of camera_from_world: x_camera' = exp(omega) x_camera + tau"
)


def scene_result(run: SceneEstimate, folder: Path | None = None) -> dict[str, Any]:
    """The result of a run: finite numbers, or null where a number is not finite.

    Its paths are those of a file in `folder`, by default that of the scene file.
    """
    place = run.scene.path.parent if folder is None else folder
    told = _told_of_pose(run, place) | _told_of_fit(run) | _told_of_regions(run, place) | _told_of_run(run, place)
    return {key: plain(value) for key, value in told.items()}


def _told_of_pose(run: SceneEstimate, folder: Path) -> dict[str, Any]:
    """The pose both ways, whose camera's it is, and how well it is known."""
    estimate = run.estimate
    max_rotation_sigma_deg, max_translation_sigma_m = limits(run)
    return {
        "format": FORMAT,
        "scene": relative(run.scene.path, folder),
        "camera": camera_values(run.camera),
        "image": image_path(run.sides.scene, folder) if len(run.frames) == 1 else None,
        "camera_from_world": pose_values(estimate.pose, "x_camera = rotation_matrix @ x_world + translation_m"),
        "world_from_camera": pose_values(
            estimate.pose.inverse(), "x_world = rotation_matrix @ x_camera + translation_m"
        ),
        "camera_center_in_world_m": estimate.pose.camera_center,
        "covariance": estimate.covariance,
        "covariance_convention": COVARIANCE_CONVENTION,
        "rotation_sigma_deg": estimate.rotation_sigma_deg,
        "translation_sigma_m": estimate.translation_sigma_m,
        "max_rotation_sigma_deg": max_rotation_sigma_deg,
        "max_translation_sigma_m": max_translation_sigma_m,
    }


def _told_of_fit(run: SceneEstimate) -> dict[str, Any]:
    """How well it fits the regions and the edges of photo and cloud."""
    estimate = run.estimate
    return {
        "confidence": estimate.confidence,
        "mode_probability": estimate.mode_probability,
        "overlap_error": estimate.overlap_error,
        "boundary_noise_px": estimate.boundary_noise_px,
        "outlier_fraction": estimate.outlier_fraction,
        "scene_agreement": agreement_values(run),
        "edge_search": edge_search_values(run),
        "confirmed_regions": confirmed_values(run),
        "sensor_origin": sensor_origin_values(run),
        "camera_near": camera_near_values(run),
    }


def _told_of_regions(run: SceneEstimate, folder: Path) -> dict[str, Any]:
    """Region by region and frame by frame; other poses, and warnings."""
    estimate = run.estimate
    return {
        "regions": [values for view in run.views for values in region_values(view)],
        "matching": matching_values(run),
        "frames": frame_values(run, folder),
        "between_frame_sigma": None if run.between_frame_sigma is None else asdict(run.between_frame_sigma),
        "alternatives": [
            {
                "camera_from_world": pose_values(other.pose),
                "confidence": other.confidence,
                "mode_probability": other.mode_probability,
                "overlap_error": other.overlap_error,
            }
            for other in estimate.alternatives
        ],
        "warnings": [warning_values(warning, run.names) for warning in estimate.warnings],
    }


def image_path(scene: Scene, folder: Path) -> str:
    """The photo as a file in `folder` names it."""
    return relative(scene.file(scene.image), folder)


def cloud_path(scene: Scene, folder: Path) -> str | None:
    """The cloud as a file in `folder` names it; None without one."""
    return None if scene.cloud is None else relative(scene.file(scene.cloud.file), folder)


def _told_of_run(run: SceneEstimate, folder: Path) -> dict[str, Any]:
    """How it was computed, and from which files."""
    estimate = run.estimate
    return {
        "converged": estimate.converged,
        "termination": estimate.termination,
        "evaluations": estimate.evaluations,
        "solver": run.scene.model.solver.model_dump(),
        "exports": exports(estimate.pose),
        "inputs": input_values(run.scene, folder),
        "versions": versions(),
        "seconds": {name: round(seconds, 4) for name, seconds in run.seconds.items()},
    }


def agreement_values(run: SceneEstimate) -> dict[str, Any] | None:
    """How well photos and clouds agree at the pose beside the regions; None where they were not compared."""
    held = [alignment for alignment in run.alignments if alignment is not None]
    if not held:
        return None
    agrees = np.concatenate([alignment.agrees for alignment in held])
    return {
        "edges": len(agrees),
        "share_on_edges": float(np.mean(agrees)) if len(agrees) else None,
        "log_odds": sum(alignment.log_odds for alignment in held),
    }


def sensor_origin_values(run: SceneEstimate) -> dict[str, Any] | None:
    """Where the scanner stood, meters, and who says so; None where that isn't known."""
    scanner = run.scanner
    return None if scanner is None else {"place_in_world_m": scanner.place, "source": scanner.source}


def camera_near_values(run: SceneEstimate) -> dict[str, Any] | None:
    """The place that the camera was taken to be near, to what standard deviation (meters), and who says so; None where
    nothing was.
    """
    item = run.scene.model.prior
    prior = run.prior if run.calibration is None else run.calibration.prior.rebase(-run.sides.origin)
    if prior.camera_near is None:
        return None
    by = "prior.camera_near" if item.camera_near is not None else "sensor_origin" if run.scanner else "assumption"
    return {"place_in_world_m": prior.camera_near, "sigma_m": prior.core.camera_near_sigma_m, "source": by}


def region_values(run: SceneEstimate) -> list[dict[str, Any]]:
    """Each region's overlap error (a fraction), also before where the scene gives an initial pose, the share of its
    samples that are seen on their side of its contour, the share that the cloud hides, and its sizes.
    """
    errors, before, fits = run.estimate.region_overlap_errors, run.errors_before, run.sample_fits
    found = {} if run.sides.matching is None else dict(run.sides.matching.pairs)
    given = run.local_initial is not None
    return [
        {
            "name": name,
            **({"world_region": found[size["name"]]} if size["name"] in found else {}),
            "overlap_error": float(error),
            **({"overlap_error_before": float(first)} if given else {}),
            "samples_on_their_side": None if fit is None else fit.share,
            "hidden_share": hidden,
            **{key: value for key, value in size.items() if key != "name"},
        }
        for name, size, error, first, fit, hidden in zip(
            run.names, region_sizes(run.sides), errors, before, fits, hidden_shares(run), strict=True
        )
    ]


def hidden_shares(run: SceneEstimate) -> list[float | None]:
    """How much of each region of a frame the cloud hides; None where that was not looked at."""
    held = [alignment for alignment in run.alignments if alignment is not None]
    return [each.share for alignment in held for each in alignment.occlusions] or [None] * len(run.names)


def matching_values(run: SceneEstimate) -> list[dict[str, Any]] | None:
    """Of each frame with unpaired regions, which were found to be which; None where there are none."""
    matched = [(sides.scene.name, sides.matching) for sides in run.frames if sides.matching is not None]
    return [
        {
            **({"frame": name} if name else {}),
            "pairs": matching.pairs,
            "unmatched_image_regions": matching.unmatched_image,
            "unmatched_world_regions": matching.unmatched_world,
            "alternatives": matching.alternatives,
        }
        for name, matching in matched
    ] or None


def frame_values(run: SceneEstimate, folder: Path) -> list[dict[str, Any]] | None:
    """How each of several frames fits, and how far the pose of the others is from that of all; None of one photo."""
    if not run.fits:
        return None if len(run.frames) == 1 else [_unfitted_frame(view, folder) for view in run.views]
    return [
        {
            "name": fit.name,
            "image": image_path(view.sides.scene, folder),
            "cloud": cloud_path(view.sides.scene, folder),
            "overlap_error": fit.overlap_error,
            "residual_px": fit.residual_px,
            "without_it": {
                "residual_px": other.residual_px,
                "expected_px": other.expected_px,
                "turned_deg": other.rotation_deg,
                "moved_m": other.shift_m,
                "disagrees": other.is_outlier,
            },
            "scene_agreement": agreement_values(view),
        }
        for fit, other, view in zip(run.fits, run.leave_one_out, run.views, strict=True)
    ]


def _unfitted_frame(view: SceneEstimate, folder: Path) -> dict[str, Any]:
    """A frame without regions, of several."""
    scene = view.sides.scene
    return {
        "name": scene.name,
        "image": image_path(scene, folder),
        "cloud": cloud_path(scene, folder),
        "overlap_error": None,
        "residual_px": None,
        "without_it": None,
        "scene_agreement": agreement_values(view),
    }


def edge_search_values(run: SceneEstimate) -> dict[str, Any] | None:
    """What the edges of photos and clouds say of the pose; None where they were not looked at.

    Logarithms of odds: for the pose over chance, and over the likeliest other place.
    """
    found = run.calibration
    if found is None:
        return None
    prior, focal = found.prior.rebase(-run.sides.origin), found.focal
    initial = prior.initial
    return {
        "log_odds": found.log_odds,
        "log_odds_over_next": found.lead,
        "edges": found.edges,
        "prior": {
            "camera_near_m": prior.camera_near,
            "camera_near_sigma_m": prior.camera_near_sigma_m,
            "up": prior.up,
            "up_sigma_deg": prior.up_sigma_deg,
            "initial_camera_from_world": None if initial is None else pose_values(initial),
            "initial_rotation_sigma_deg": prior.initial_rotation_sigma_deg,
            "initial_center_sigma_m": prior.initial_center_sigma_m,
        },
        "assumed": list(found.assumed),
        "focal": focal
        and {"log_odds": focal.log_odds, "best_factor": focal.factor, "moved_m_by_1_percent": focal.shift_m},
        "regions": None if found.regions is None else _before_values(found, found.regions, run.sides.origin),
    }


def _before_values(found: Calibration, regions: PoseEstimate, origin: NDArray[np.float64]) -> dict[str, Any]:
    """The regions' answer alone, and what edges did to it."""
    before = regions.pose if found.before is None else found.before
    return {
        "confidence": regions.confidence,
        "answers": 1 + len(regions.alternatives),
        "rank": None if found.rank_before is None else found.rank_before + 1,
        "turned_deg": found.turned_deg,
        "moved_m": found.moved_m,
        "camera_from_world": pose_values(before.rebase(-origin)),
    }


def exports(pose: Pose) -> dict[str, Any]:
    """The pose as other tools write it.

    direct_visual_lidar_calibration: camera to lidar as [t (m), quaternion x y z w]. KITTI: the 12 numbers of [R t],
    row by row, lidar to camera.
    """
    inverse = pose.inverse()
    row = " ".join(f"{value:.12e}" for value in pose.matrix[:3].ravel())
    return {
        "direct_visual_lidar_calibration": {
            "T_lidar_camera": [*inverse.translation, *inverse.rotation.as_quat(canonical=True)]
        },
        "kitti_Tr_velo_to_cam": f"Tr_velo_to_cam: {row}",
    }


def region_sizes(sides: SceneData) -> list[dict[str, Any]]:
    """Each region's name, areas (pixels, square meters) and cloud points, and what its 3D side is known by."""
    pairs = zip(sides.names, sides.image_regions, sides.world_sides, strict=True)
    return [{"name": name, "image_area_px": observed.area, **world_sizes(world)} for name, observed, world in pairs]


def world_sizes(side: WorldSide) -> dict[str, Any]:
    """The area (square meters) and cloud points of a region's 3D side, and what it is known by."""
    return {
        "world_area_m2": side.region.area,
        "cloud_points": None if side.indices is None else len(side.indices),
        "known_by": known_by(side),
    }


def known_by(side: WorldSide) -> str:
    """How many samples tell where a region ends; or that its outline does, and why."""
    samples = side.region.samples
    if samples is None:
        return f"outline: {side.outline_because}"
    where = "samples on one scan line" if side.region.is_line else "samples"
    return f"{where}: {len(samples[0])} inside, {len(samples[1])} outside"


def plain(value: Any) -> Any:
    """Numpy values as lists and numbers; numbers that are not finite as None, since JSON has no word for them."""
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value
