"""How the frames of a rig fit their joint pose."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from regionpose.cameras import Camera
from regionpose.geometry.pose import Pose
from regionpose.validation.arrays import KeptArrays

Array = NDArray[np.float64]

Outcome = Literal["refined", "confirmed", "weak"]

OUTLIER_RATIO = 3.0
"""Distances of a frame's contours from where the others put them, over those expected, above which it disagrees."""


@dataclass(frozen=True, eq=False, repr=False)
class FrameFit(KeptArrays):
    """How a frame fits the joint pose.

    Parameters
    ----------
    name : str
        The frame's.
    overlap_error : float
        Of all its regions together, a fraction as of `Diagnostics`.
    region_overlap_errors : (k,) array
        Region by region.
    residual_px : float
        Size of the distances between contours and projected outlines, pixels: root mean square, or robust standard
        deviation where that is less; infinite where an outline isn't wholly visible, NaN where each region is sampled
        along one scan line alone.
    """

    name: str
    overlap_error: float
    region_overlap_errors: Array
    residual_px: float

    def __repr__(self) -> str:
        """The name, the overlap error and the residual."""
        return f"FrameFit({self.name!r}, overlap_error={self.overlap_error:.4f}, residual_px={self.residual_px:.2f})"


@dataclass(frozen=True, eq=False, repr=False)
class LeaveOneOut(KeptArrays):
    """The pose of the other frames without one, and how that one fits it.

    Parameters
    ----------
    name : str
        The frame's that is left out.
    pose : Pose
        That of the others.
    covariance : (6, 6) array
        Of its left increment, rad and meters.
    rotation_deg : float
        The angle between both, degrees.
    shift_m : float
        How far apart both put the middle of all regions, meters.
    residual_px : float
        Of the frame's own distances at the others' pose, as of `FrameFit`; infinite where an outline isn't wholly
        visible.
    expected_px : float
        Expected from the others' own residuals and the covariance of their pose.
    """

    name: str
    pose: Pose
    covariance: Array
    rotation_deg: float
    shift_m: float
    residual_px: float
    expected_px: float

    @property
    def is_outlier(self) -> bool:
        """Whether the frame disagrees with the others by more than their noise explains."""
        return self.residual_px > OUTLIER_RATIO * self.expected_px

    def __repr__(self) -> str:
        """The name, how far both poses are apart, and the residuals."""
        apart = f"rotation_deg={self.rotation_deg:.3f}, shift_m={self.shift_m:.4f}"
        residuals = f"residual_px={self.residual_px:.2f}, expected_px={self.expected_px:.2f}"
        return f"LeaveOneOut({self.name!r}, {apart}, {residuals})"


@dataclass(frozen=True)
class BetweenFrameSigma:
    """How far a frame is off as a whole, beside the noise of its regions (docs/math.md, eq. 12.8).

    Parameters
    ----------
    rotation_sigma_deg : float
        Standard deviation of its rotation about each of the camera's axes, degrees.
    center_sigma_m : float
        Standard deviation of the camera's place along each, meters.
    """

    rotation_sigma_deg: float
    center_sigma_m: float


@dataclass(frozen=True, eq=False, repr=False)
class CameraRefinement(KeptArrays):
    """The contours' evidence on a camera.

    Parameters
    ----------
    camera : Camera
        The one to use.
    pose : Pose
        The one that belongs to it.
    outcome : {"refined", "confirmed", "weak"}
        "confirmed" where the given camera is within the noise, "weak" where the geometry does not determine it; the
        given one is kept then.
    parameters : tuple of str
        Names, in order.
    given, found : (p,) array
        Their values, focal lengths and center in pixels.
    covariance : (6 + p, 6 + p) array
        Of `[omega (rad), tau (meters), parameters]`, found jointly.
    weak : tuple of str
        The parameters that are not determined.
    residual_px : tuple of 2 float
        Robust standard deviation of the distances between contours and outlines, pixels, with the given camera and with
        the parameters found.
    """

    camera: Camera
    pose: Pose
    outcome: Outcome
    parameters: tuple[str, ...]
    given: Array
    found: Array
    covariance: Array
    weak: tuple[str, ...]
    residual_px: tuple[float, float]

    @property
    def sigma(self) -> Array:
        """Standard deviations of the parameters, (p,)."""
        return np.sqrt(np.diag(self.covariance)[6:])

    def __repr__(self) -> str:
        """The outcome, and the parameters with their standard deviations."""
        found = zip(self.parameters, self.found, self.sigma, strict=True)
        values = ", ".join(f"{name}={value:.5g} +- {sigma:.2g}" for name, value, sigma in found)
        return f"CameraRefinement({self.outcome!r}, {values})"


@dataclass(frozen=True, eq=False, repr=False)
class RigDiagnostics:
    """How the frames of a rig fit their joint pose.

    Parameters
    ----------
    camera : Camera
        The given one, or the refined one.
    frames : tuple of FrameFit
        In the frames' order.
    leave_one_out : tuple of LeaveOneOut
        In the frames' order; none where there is one frame only.
    between_frame_sigma : BetweenFrameSigma or None
        How far a frame is off as a whole; None where fewer than two frames have a pose of their own, or these do not
        add up to the joint one.
    refinement : CameraRefinement or None
        Of the camera, None where it wasn't asked for.
    """

    camera: Camera
    frames: tuple[FrameFit, ...]
    leave_one_out: tuple[LeaveOneOut, ...]
    between_frame_sigma: BetweenFrameSigma | None
    refinement: CameraRefinement | None

    def __repr__(self) -> str:
        """The number of frames, those that are outliers, and how far frames are off as wholes."""
        outliers = [one.name for one in self.leave_one_out if one.is_outlier]
        named = f", outliers: {', '.join(outliers)}" if outliers else ""
        return f"RigDiagnostics({len(self.frames)} frames{named}, {self.between_frame_sigma!r})"
