"""A scene's estimate as plain values for JSON: frames and units in the names."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from regionpose.geometry.pose import Pose
from regionpose.io.exports.view import camera_values
from regionpose.scene.estimate import SceneEstimate
from regionpose.scene.exposure import SceneData
from regionpose.scene.headline import headline, limits
from regionpose.scene.inputs import input_values, versions
from regionpose.scene.loading import Scene
from regionpose.scene.paths import relative
from regionpose.scene.region_sides import WorldSide
from regionpose.scene.region_values import confirmed_values
from regionpose.scene.values import pose_values, sigma_values, warning_values
from regionpose.solve.estimate import RegionsOnly
from regionpose.solve.prior import Prior
from regionpose.solve.rig_diagnostics import FrameFit, LeaveOneOut

FORMAT = "regionpose result 2"

COVARIANCE_CONVENTION = (
    "order [omega_x, omega_y, omega_z (rad), tau_x, tau_y, tau_z (m)] along the camera's axes; "
    "increment on the left of camera_from_world: x_camera' = exp(omega) x_camera + tau"
)


def scene_result(run: SceneEstimate, folder: Path | None = None) -> dict[str, Any]:
    """The result of a run: finite numbers, or null where a number is not finite.

    Its paths are those of a file in `folder`, by default that of the scene file.
    """
    place = run.scene.path.parent if folder is None else folder
    values = _pose_section(run) | {"diagnostics": _diagnostics_section(run, place)} | _run_section(run, place)
    return {key: plain(value) for key, value in values.items()}


def _pose_section(run: SceneEstimate) -> dict[str, Any]:
    """Whether to trust the pose, the pose both ways, its precision and its warnings."""
    estimate = run.estimate
    max_rotation_deg, max_translation_m = limits(run)
    return {
        "format": FORMAT,
        "status": estimate.status.value,
        "headline": headline(run),
        "confidence": estimate.confidence,
        "camera_from_world": pose_values(estimate.pose, "x_camera = rotation_matrix @ x_world + translation_m"),
        "world_from_camera": pose_values(
            estimate.pose.inverse(), "x_world = rotation_matrix @ x_camera + translation_m"
        ),
        "camera_center_in_world_m": estimate.pose.camera_center,
        "covariance": estimate.covariance,
        "covariance_convention": COVARIANCE_CONVENTION,
        "sigma": sigma_values(estimate),
        "max_sigma": {"rotation_deg": max_rotation_deg, "translation_m": max_translation_m},
        "warnings": [warning_values(warning, run.names) for warning in estimate.warnings],
    }


def _diagnostics_section(run: SceneEstimate, folder: Path) -> dict[str, Any]:
    """How the pose was found, and how well regions, frames and edges fit it."""
    whole = run.estimate.diagnostics
    return {
        "mode_probability": whole.mode_probability,
        "overlap_error": whole.overlap_error,
        "boundary_noise_px": whole.boundary_noise_px,
        "outlier_fraction": whole.outlier_fraction,
        "alternatives": [
            {
                "camera_from_world": pose_values(other.pose),
                "confidence": other.confidence,
                "mode_probability": other.mode_probability,
                "overlap_error": other.overlap_error,
            }
            for other in whole.alternatives
        ],
        "regions": [values for view in run.views for values in region_values(view)],
        "matching": matching_values(run),
        "rig": rig_values(run, folder),
        "edges": edge_values(run),
        "confirmed_regions": confirmed_values(run),
        "sensor_origin": sensor_origin_values(run),
        "camera_near": camera_near_values(run),
        "converged": whole.converged,
        "termination": whole.termination,
        "evaluations": whole.evaluations,
    }


def image_path(scene: Scene, folder: Path) -> str:
    """The photo as a file in `folder` names it."""
    return relative(scene.file(scene.image), folder)


def cloud_path(scene: Scene, folder: Path) -> str | None:
    """The cloud as a file in `folder` names it; None without one."""
    return None if scene.cloud is None else relative(scene.file(scene.cloud.file), folder)


def _run_section(run: SceneEstimate, folder: Path) -> dict[str, Any]:
    """What it was computed from, and how."""
    return {
        "scene": relative(run.scene.path, folder),
        "camera": camera_values(run.camera),
        "image": image_path(run.sides.scene, folder) if len(run.frames) == 1 else None,
        "solver": run.scene.model.solver.model_dump(),
        "exports": exports(run.estimate.pose),
        "inputs": input_values(run.scene, folder),
        "versions": versions(),
        "seconds": seconds_values(run),
    }


def seconds_values(run: SceneEstimate) -> dict[str, float]:
    """The seconds of each stage so far."""
    return {name: round(seconds, 4) for name, seconds in run.seconds.items()}


def alignment_values(run: SceneEstimate) -> dict[str, Any] | None:
    """How well photos and clouds agree at the pose beside the regions; None where they were not compared."""
    held = [alignment for alignment in run.alignments if alignment is not None]
    if not held:
        return None
    agrees = np.concatenate([alignment.agrees for alignment in held])
    return {
        "edges": len(agrees),
        "edge_fraction": float(np.mean(agrees)) if len(agrees) else None,
        "log_odds": sum(alignment.log_odds for alignment in held),
    }


def sensor_origin_values(run: SceneEstimate) -> dict[str, Any] | None:
    """Where the scanner stood, meters, and the source; None where that isn't known."""
    scanner = run.scanner
    return None if scanner is None else {"place_in_world_m": scanner.place, "source": scanner.source}


def camera_near_values(run: SceneEstimate) -> dict[str, Any] | None:
    """The place that the camera was taken to be near, to what standard deviation (meters), and the source; None where
    nothing was.
    """
    item = run.scene.model.prior
    edges = run.estimate.diagnostics.edges
    prior = run.prior if edges is None else edges.prior
    if prior.camera_near is None:
        return None
    by = "prior.camera_near" if item.camera_near is not None else "sensor_origin" if run.scanner else "assumption"
    return {"place_in_world_m": prior.camera_near, "sigma_m": prior.core.camera_near_sigma_m, "source": by}


def region_values(run: SceneEstimate) -> list[dict[str, Any]]:
    """Each region's overlap error (a fraction), also before where the scene gives an initial pose, the fraction of its
    samples that project on their side of its contour, the fraction that the cloud hides, and its sizes.
    """
    errors, before, fits = run.estimate.diagnostics.region_overlap_errors, run.errors_before, run.sample_fits
    found = {} if run.sides.matching is None else dict(run.sides.matching.pairs)
    given = run.local_initial is not None
    return [
        {
            "name": name,
            **({"world_region": found[size["name"]]} if size["name"] in found else {}),
            "overlap_error": float(error),
            **({"overlap_error_before": float(first)} if given else {}),
            "consistent_sample_fraction": None if fit is None else fit.consistent_fraction,
            "hidden_fraction": hidden,
            **{key: value for key, value in size.items() if key != "name"},
        }
        for name, size, error, first, fit, hidden in zip(
            run.names, region_sizes(run.sides), errors, before, fits, hidden_fractions(run), strict=True
        )
    ]


def hidden_fractions(run: SceneEstimate) -> list[float | None]:
    """How much of each region of a frame the cloud hides; None where that was not tested."""
    held = [alignment for alignment in run.alignments if alignment is not None]
    return [each.hidden_fraction for alignment in held for each in alignment.occlusions] or [None] * len(run.names)


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


def rig_values(run: SceneEstimate, folder: Path) -> dict[str, Any] | None:
    """How each of several frames fits, and how far frames are off as wholes; None of one photo."""
    if len(run.frames) == 1:
        return None
    rig = run.estimate.diagnostics.rig
    if rig is None:
        return {"frames": [_unfitted_frame(view, folder) for view in run.views], "between_frame_sigma": None}
    fits = zip(rig.frames, rig.leave_one_out, run.views, strict=True)
    frames = [_frame_values(fit, other, view, folder) for fit, other, view in fits]
    sigma = rig.between_frame_sigma
    return {"frames": frames, "between_frame_sigma": None if sigma is None else asdict(sigma)}


def _frame_values(fit: FrameFit, other: LeaveOneOut, view: SceneEstimate, folder: Path) -> dict[str, Any]:
    """How a frame fits, and how far the pose of the others is from that of all."""
    return {
        "name": fit.name,
        "image": image_path(view.sides.scene, folder),
        "cloud": cloud_path(view.sides.scene, folder),
        "overlap_error": fit.overlap_error,
        "residual_px": fit.residual_px,
        "leave_one_out": {
            "residual_px": other.residual_px,
            "expected_px": other.expected_px,
            "rotation_deg": other.rotation_deg,
            "shift_m": other.shift_m,
            "is_outlier": other.is_outlier,
        },
        "alignment": alignment_values(view),
    }


def _unfitted_frame(view: SceneEstimate, folder: Path) -> dict[str, Any]:
    """A frame without regions, of several."""
    scene = view.sides.scene
    return {
        "name": scene.name,
        "image": image_path(scene, folder),
        "cloud": cloud_path(scene, folder),
        "overlap_error": None,
        "residual_px": None,
        "leave_one_out": None,
        "alignment": alignment_values(view),
    }


def edge_values(run: SceneEstimate) -> dict[str, Any] | None:
    """The evidence of the edges of photos and clouds for the pose; None where they were not compared.

    Logarithms of odds: for the pose over chance, and over the likeliest other place.
    """
    found = run.estimate.diagnostics.edges
    if found is None:
        return None
    focal, regions = found.focal, found.regions_only
    return {
        "log_odds": found.log_odds,
        "log_odds_over_next": found.log_odds_over_next,
        "count": found.count,
        "alignment": alignment_values(run),
        "prior": _prior_values(found.prior),
        "assumed": list(found.assumed),
        "focal": focal and {"log_odds": focal.log_odds, "factor": focal.factor, "shift_m": focal.shift_m},
        "regions_only": None if regions is None else _regions_only_values(regions),
    }


def _prior_values(prior: Prior) -> dict[str, Any]:
    initial = prior.initial
    return {
        "camera_near_m": prior.camera_near,
        "camera_near_sigma_m": prior.camera_near_sigma_m,
        "up": prior.up,
        "up_sigma_deg": prior.up_sigma_deg,
        "initial_camera_from_world": None if initial is None else pose_values(initial),
        "initial_rotation_sigma_deg": prior.initial_rotation_sigma_deg,
        "initial_center_sigma_m": prior.initial_center_sigma_m,
    }


def _regions_only_values(regions: RegionsOnly) -> dict[str, Any]:
    """The regions' solution alone, and what edges did to it."""
    estimate = regions.estimate
    return {
        "confidence": estimate.confidence,
        "solutions": 1 + len(estimate.diagnostics.alternatives),
        "rank": regions.rank,
        "rotation_deg": regions.rotation_deg,
        "shift_m": regions.shift_m,
        "camera_from_world": pose_values(estimate.pose if regions.pose is None else regions.pose),
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
    """Each region's name, areas (pixels, square meters) and cloud points, and the source of its 3D boundary."""
    pairs = zip(sides.names, sides.image_regions, sides.world_sides, strict=True)
    return [{"name": name, "image_area_px": observed.area, **world_sizes(world)} for name, observed, world in pairs]


def world_sizes(side: WorldSide) -> dict[str, Any]:
    """The area (square meters) and cloud points of a region's 3D side, and the source of its boundary."""
    return {
        "world_area_m2": side.region.area,
        "cloud_points": None if side.indices is None else len(side.indices),
        "boundary_source": boundary_source(side),
    }


def boundary_source(side: WorldSide) -> str:
    """The number of samples of a region's boundary, or that it is given by its outline, and why."""
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
