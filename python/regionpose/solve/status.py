"""Whether to trust a pose: the one place that decides."""

from __future__ import annotations

from collections.abc import Iterable
from enum import StrEnum

from regionpose.solve.warning import PoseWarning
from regionpose.solve.warning_code import WarningCode


class PoseStatus(StrEnum):
    """Whether to trust a pose (docs/reference/warnings.md)."""

    TRUSTED = "trusted"
    """No warning: confidence and standard deviations are within their limits."""

    CHECK = "check"
    """Warnings, none of which indicates that the true pose is a different one."""

    DOUBTFUL = "doubtful"
    """The true pose may be a different one."""


DOUBTFUL_CODES = frozenset(
    {
        WarningCode.AMBIGUOUS_MATCHING,
        WarningCode.AMBIGUOUS_POSE,
        WarningCode.CAMERA_POSITION_CONFLICT,
        WarningCode.EDGE_MISMATCH,
        WarningCode.FOCAL_LENGTH_CONFLICT,
        WarningCode.INITIAL_POSE_CONFLICT,
        WarningCode.NOT_CONVERGED,
        WarningCode.OCCLUDED_REGION,
        WarningCode.UNCONFIRMED_MATCHING,
        WarningCode.UP_DIRECTION_CONFLICT,
        WarningCode.VIEWPOINT_CONFLICT,
    }
)
"""Warnings after which the true pose may be a different one."""

LEAST_CONFIDENCE = 0.5
"""Confidence below which a pose is more likely wrong than right."""


def pose_status(confidence: float, warnings: Iterable[PoseWarning]) -> PoseStatus:
    """The status of a pose of a confidence, with its warnings."""
    codes = {warning.code for warning in warnings}
    if not codes:
        return PoseStatus.TRUSTED
    if codes & DOUBTFUL_CODES or confidence < LEAST_CONFIDENCE:
        return PoseStatus.DOUBTFUL
    return PoseStatus.CHECK
