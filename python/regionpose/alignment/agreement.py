"""How well a photo and a cloud agree at a pose, however that was found."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from regionpose import _core
from regionpose.alignment.edge_frame import EdgeFrame
from regionpose.alignment.odds import HIDDEN
from regionpose.alignment.photo import Photo
from regionpose.alignment.photo_cloud import PhotoCloud
from regionpose.alignment.pose_search import Density, log_mass, search_about
from regionpose.alignment.visibility import occlusions
from regionpose.cameras import Camera
from regionpose.geometry.pose import Pose
from regionpose.solve.edge_diagnostics import Alignment
from regionpose.solve.frame import Frame
from regionpose.solve.prior import Prior
from regionpose.validation.arguments import checked_arguments

Array = NDArray[np.float64]

TOLERANCE_DEG, TOLERANCE_M = 0.5, 0.1
"""Deviations, about and along each axis, of a pose that is right from the one at which photo and cloud agree: what
regions, calibrations and the times of photo and scan leave open. Conventions."""


@checked_arguments
def check_alignment(camera: Camera, frame: Frame, pose: Pose) -> Alignment:
    """How well photo and cloud agree at a pose, however it was found.

    Edges of the points' depth and intensity as the camera would see them, against edges of the photo; and whether
    points stand before the regions that the photo shows. The photo's edges are found once for calls with the same photo
    one after the other.

    Parameters
    ----------
    camera : Camera
        That took the photo.
    frame : Frame
        With `image` and `points`. Edges in and beside `image_regions` are left out: where the pose comes from these,
        they agree at any pose that the regions allow. `world_regions` can be left out; how much the points hide of each
        is in `occlusions`.
    pose : Pose
        `camera_from_world`.

    Raises
    ------
    ValueError
        For a frame without `image` or `points`, for arrays of another shape, for an image of another size than the
        camera's, and for world regions of another number than image regions.
    """
    photo_cloud = PhotoCloud.of(camera, frame)
    return aligned(photo_cloud, EdgeFrame(photo_cloud, pose.camera_center), pose)


def aligned(frame: PhotoCloud, edges: EdgeFrame, pose: Pose) -> Alignment:
    """How well a frame's photo and cloud agree at a pose, by their `edges`."""
    hidden = occlusions(frame, pose)
    places, agrees = _projected_edges(frame.photo, edges, pose)
    near = Prior(initial=pose, initial_rotation_sigma_deg=TOLERANCE_DEG, initial_center_sigma_m=TOLERANCE_M)
    modes = search_about([edges], pose, Density.of_prior(near, edges.origin)) if len(places) else []
    odds = log_mass(modes) if modes else 0.0
    nearest = modes[0].pose if odds > 0.0 else pose
    whole = odds + (HIDDEN if any(each.is_hidden for each in hidden) else 0.0)
    return Alignment(frame.photo.pixels(places), agrees, odds, whole, nearest, hidden)


def _projected_edges(photo: Photo, edges: EdgeFrame, pose: Pose) -> tuple[Array, NDArray[np.bool_]]:
    """Pixels (n, 2) of the reduced photo at which edges project at a pose, outside regions, and whether it shows an
    edge there.
    """
    local = pose.rebase(edges.origin)
    frame = edges.visible_from(local.camera_center, [local], with_regions=False)
    places, directions = frame.project_edges(local.rotation.as_matrix(), local.translation)
    columns, rows = np.round(places).astype(np.int64).T
    height, width = photo.luminance.shape
    shown = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    if edges.covered is not None:
        shown[shown] = ~edges.covered[rows[shown], columns[shown]]
    ratios = photo.log_ratios(float(_core.edge_spreads()[-1]))[directions[shown], rows[shown], columns[shown]]
    return places[shown], np.asarray(ratios > 0.0)
