"""The codes of all warnings."""

from __future__ import annotations

from enum import StrEnum


class WarningCode(StrEnum):
    """What a warning is about; the values are the same from version to version (docs/reference/warnings.md)."""

    AMBIGUOUS_POSE = "ambiguous-pose"
    AMBIGUOUS_REGION = "ambiguous-region"
    AMBIGUOUS_MATCHING = "ambiguous-matching"
    CAMERA_POSITION_CONFLICT = "camera-position-conflict"
    DUPLICATE_REGIONS = "duplicate-regions"
    EDGE_MISMATCH = "edge-mismatch"
    FOCAL_LENGTH_CONFLICT = "focal-length-conflict"
    INITIAL_POSE_CONFLICT = "initial-pose-conflict"
    LEAKED_MASK = "leaked-mask"
    LOW_CONFIDENCE = "low-confidence"
    NO_INTENSITY = "no-intensity"
    NON_INVERTIBLE_DISTORTION = "non-invertible-distortion"
    NOT_CONVERGED = "not-converged"
    OCCLUDED_REGION = "occluded-region"
    OFF_CENTER_PRINCIPAL_POINT = "off-center-principal-point"
    OUTLIER_FRAME = "outlier-frame"
    OUTLIER_REGION = "outlier-region"
    POOR_OVERLAP = "poor-overlap"
    RECTIFIED_PHOTO = "rectified-photo"
    REGION_EDGE_CONFLICT = "region-edge-conflict"
    SAMPLES_UNUSED = "samples-unused"
    SPARSE_SAMPLING = "sparse-sampling"
    SUSPICIOUS_UNIT = "suspicious-unit"
    UNCONFIRMED_MATCHING = "unconfirmed-matching"
    UNOBSERVABLE_INTRINSICS = "unobservable-intrinsics"
    UP_DIRECTION_CONFLICT = "up-direction-conflict"
    VIEWPOINT_CONFLICT = "viewpoint-conflict"
    WEAK_GEOMETRY = "weak-geometry"
