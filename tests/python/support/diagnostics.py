"""What frames and edges say of an estimate, for tests that know that it is there."""

from __future__ import annotations

import regionpose as rp


def rig_of(estimate: rp.PoseEstimate) -> rp.solve.RigDiagnostics:
    """How the frames of a rig fit."""
    assert estimate.diagnostics.rig is not None
    return estimate.diagnostics.rig


def edges_of(estimate: rp.PoseEstimate) -> rp.solve.EdgeDiagnostics:
    """What edges of photos and clouds say."""
    assert estimate.diagnostics.edges is not None
    return estimate.diagnostics.edges


def regions_only_of(estimate: rp.PoseEstimate) -> rp.solve.RegionsOnly:
    """The estimate without edges."""
    found = edges_of(estimate).regions_only
    assert found is not None
    return found


def refinement_of(estimate: rp.PoseEstimate) -> rp.solve.CameraRefinement:
    """The refinement of a rig's camera."""
    found = rig_of(estimate).refinement
    assert found is not None
    return found


def between_frame_sigma_of(estimate: rp.PoseEstimate) -> rp.solve.BetweenFrameSigma:
    """How far frames are off as wholes."""
    found = rig_of(estimate).between_frame_sigma
    assert found is not None
    return found


def focal_of(estimate: rp.PoseEstimate) -> rp.solve.FocalEvidence:
    """What edges say of the focal lengths."""
    found = edges_of(estimate).focal
    assert found is not None
    return found
