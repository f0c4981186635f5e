"""Parts of an estimate's diagnostics that a test needs to be there."""

from __future__ import annotations

from typing import TypeVar

import regionpose as rp

Part = TypeVar("Part")


def present(part: Part | None) -> Part:
    """The part, which is not None."""
    assert part is not None
    return part


def rig_of(estimate: rp.PoseEstimate) -> rp.solve.RigDiagnostics:
    """How the frames of a rig fit."""
    return present(estimate.diagnostics.rig)


def edges_of(estimate: rp.PoseEstimate) -> rp.solve.EdgeDiagnostics:
    """The evidence of edges of photos and clouds."""
    return present(estimate.diagnostics.edges)


def regions_only_of(estimate: rp.PoseEstimate) -> rp.solve.RegionsOnly:
    """The estimate without edges."""
    return present(edges_of(estimate).regions_only)


def refinement_of(estimate: rp.PoseEstimate) -> rp.solve.CameraRefinement:
    """The refinement of a rig's camera."""
    return present(rig_of(estimate).refinement)


def between_frame_sigma_of(estimate: rp.PoseEstimate) -> rp.solve.BetweenFrameSigma:
    """How far frames are off as wholes."""
    return present(rig_of(estimate).between_frame_sigma)


def focal_of(estimate: rp.PoseEstimate) -> rp.solve.FocalEvidence:
    """The evidence of edges on the focal lengths."""
    return present(edges_of(estimate).focal)
