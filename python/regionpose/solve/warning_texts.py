"""Texts and advice of all warnings, by code: the one table that results, reports, the page and the reference show."""

from __future__ import annotations

import math
import string
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from regionpose.geometry.units import angle_text, length_text
from regionpose.solve.warning_code import WarningCode

Value = float | str | tuple[float, ...]


@dataclass(frozen=True)
class WarningText:
    """The wording of a warning.

    Parameters
    ----------
    text : str
        As of `str.format`, with the values by name: `{0}` is the first region, `{shift_m:length}` a length,
        `{turn_deg:angle}` an angle, `{fraction:.1%}` a percentage.
    advice : str
        What to do about it.
    otherwise : str
        The text where one of its numbers is absent or not finite.
    details : mapping
        Clauses that are appended where the value of their name is there; `regions` is there with any region.

    """

    text: str
    advice: str
    otherwise: str = ""
    details: Mapping[str, str] = field(default_factory=dict)


class _Formatter(string.Formatter):
    """`str.format` with lengths, angles, directions and percentages as the house writes them."""

    def format_field(self, value: Any, format_spec: str) -> str:
        if format_spec == "length":
            return length_text(value)
        if format_spec == "angle":
            return angle_text(value)
        if format_spec == "direction":
            return "[" + ", ".join(f"{part:.2f}" for part in value) + "]"
        if format_spec.endswith("%"):
            return f"{100.0 * value:{format_spec[:-1]}f} %"
        return format(value, format_spec)


def warning_text(code: WarningCode, regions: Sequence[str], values: Mapping[str, Value]) -> str:
    """The text of a warning about `regions`, as they are to be called."""
    wording, formatter = TEXTS[code], _Formatter()
    known = {**values, **({"regions": " and ".join(regions)} if regions else {})}
    names = [name for _, name, _, _ in formatter.parse(wording.text) if name and not name.isdigit()]
    whole = all(name in known and _is_finite(known[name]) for name in names)
    clauses = [wording.text if whole or not wording.otherwise else wording.otherwise]
    clauses += [clause for name, clause in wording.details.items() if name in known]
    return formatter.vformat("; ".join(clauses), regions, known)


def _is_finite(value: Value) -> bool:
    return not isinstance(value, float) or math.isfinite(value)


TEXTS: Mapping[WarningCode, WarningText] = {
    WarningCode.AMBIGUOUS_POSE: WarningText(
        "{others:.0f} other pose(s) fit about as well, turned by {rotation_deg:angle} and moved by {shift_m:length} or"
        " more",
        "Add a region without symmetry, frames of other places, or a prior: prior.up, prior.camera_near, prior.initial"
        " with its deviations, viewpoint of a region's world side. Compare depth.png with runner_up.png.",
    ),
    WarningCode.WEAK_GEOMETRY: WarningText(
        "1 sigma: {rotation_sigma_deg:angle} and {translation_sigma_m:length}, above the limits of"
        " {max_rotation_sigma_deg:angle} and {max_translation_sigma_m:length}",
        "Add a region in another plane or further from the others, or more frames; or, if this is precise enough,"
        " raise solver.max_rotation_sigma_deg or solver.max_translation_sigma_percent.",
        otherwise="the regions leave a direction of the pose free",
        details={
            "rotation_axis": "weakest about camera axis {rotation_axis:direction} and along"
            " {translation_axis:direction}",
            "is_coplanar": "all regions lie in one plane",
            "frontal_deg": "the plane is seen frontally, {frontal_deg:.0f} deg off the line of sight",
            "line_regions": "{line_regions} region(s) are sampled along one scan line only",
            "largest_px": "no region is more than {largest_px:.0f} px across",
        },
    ),
    WarningCode.POOR_OVERLAP: WarningText(
        "{0}, projected with this pose, misses the observed region by {overlap_error:.1%} of its area",
        "Look at this region in the overlay: its mask or outline is wrong, or the pair does not match.",
    ),
    WarningCode.OUTLIER_REGION: WarningText(
        "{0} does not fit this pose: {contour_fraction:.0%} of its contour lies on its projection, of the others"
        " {contour_fraction_of_others:.0%}",
        "Leave this region out, or correct it: its mask, its outline or the pair is wrong.",
    ),
    WarningCode.AMBIGUOUS_REGION: WarningText(
        "{0} does not fit another pose that fits about as well, {rotation_deg:angle} away: {contour_fraction:.0%} of"
        " its contour lies on its projection, of the others {contour_fraction_of_others:.0%}",
        "This region or the one that does not fit the pose itself is wrong: its mask, its outline or the pair.",
    ),
    WarningCode.SAMPLES_UNUSED: WarningText(
        "no pose agrees with the samples of the regions: this pose is that of their outlines, by which they are"
        " compared",
        "Look at the overlay: check the pairs, sensor_origin and the returns that are marked.",
    ),
    WarningCode.LOW_CONFIDENCE: WarningText(
        "low confidence ({confidence:.1%}): too little of contours or edges matches",
        "Look at the overlay or depth.png; add a region, a sharper mask, frames, or a prior.",
    ),
    WarningCode.NOT_CONVERGED: WarningText(
        "the search did not converge: {termination}",
        "Do not use this pose before looking at the overlay; check that each pair shows the same place.",
    ),
    WarningCode.INITIAL_POSE_CONFLICT: WarningText(
        "the pose is {rotation_deg:angle} and {shift_m:length} from the initial pose",
        "One of them is wrong: check the pairs, or prior.initial and its deviations.",
        details={"sigmas": "{sigmas:.1f} standard deviations of both"},
    ),
    WarningCode.UP_DIRECTION_CONFLICT: WarningText(
        "prior.up is {angle_deg:angle} off the image's up direction, {sigmas:.1f} standard deviations",
        "One of them is wrong: check the pairs, or the direction prior.up.",
    ),
    WarningCode.CAMERA_POSITION_CONFLICT: WarningText(
        "the camera is {shift_m:length} from prior.camera_near, {sigmas:.1f} standard deviations",
        "One of them is wrong: check the pairs, or prior.camera_near, which is the scanner's place unless it is given,"
        " and camera_near_sigma_m; null for a camera that may be anywhere.",
    ),
    WarningCode.VIEWPOINT_CONFLICT: WarningText(
        "{0} is seen from behind: from the side opposite to its viewpoint",
        "Check viewpoint, the pair and the outline: one of them is wrong.",
    ),
    WarningCode.REGION_EDGE_CONFLICT: WarningText(
        "the pose by edges of photo and cloud outside the regions is {rotation_deg:angle} and {shift_m:length} from"
        " that of the regions, {sigmas:.1f} of its standard deviations: one of them is wrong",
        "Look at depth.png and edges.png: if they fit, a region's mask, outline or pair is wrong; if not, photo and"
        " cloud do not show the same scene.",
    ),
    WarningCode.OCCLUDED_REGION: WarningText(
        "the photo shows {0}, but at this pose the cloud hides {hidden_fraction:.0%} of it, {distance_m:.1f} m from the"
        " camera, before the region at {region_distance_m:.1f} m",
        "Look at depth.png: something of the cloud stands before this region. Check the pairs, the focal length, and"
        " that photo and cloud are of one time; or add a prior.",
    ),
    WarningCode.FOCAL_LENGTH_CONFLICT: WarningText(
        "photo and cloud agree better with focal lengths {factor:.2f} times as long, by odds of e^{log_odds:.0f} to 1",
        "Check the calibration: its lens and zoom, and the size of its photos. With the right focal lengths the pose is"
        " another one.",
    ),
    WarningCode.EDGE_MISMATCH: WarningText(
        "edges of photo and cloud beside the regions do not agree at this pose; the confidence falls from"
        " {confidence_before:.1%} to {confidence:.1%}",
        "Look at edges.png: at a right pose most dots are green. Check the pairs, the calibration, and that photo and"
        " cloud show the same scene.",
    ),
    WarningCode.SPARSE_SAMPLING: WarningText(
        "{0}: {remark}",
        "Use a denser scan, a region that is larger or nearer, or its known outline as a polygon.",
    ),
    WarningCode.DUPLICATE_REGIONS: WarningText(
        "{0} and {1} are one region on the {side} side: they share {fraction:.1%} of their union",
        "Two clicks grew one surface, or it was marked twice: mark one of them again, or leave it out.",
    ),
    WarningCode.LEAKED_MASK: WarningText(
        "the mask of {0} covers {fraction:.0%} of the photo and reaches {sides} of its sides: it seems to have leaked",
        "Lower its tolerance, click elsewhere, or draw a polygon, unless the surface is that large.",
    ),
    WarningCode.SUSPICIOUS_UNIT: WarningText(
        "the world side of {0} would be {size_m:.0f} m across: the coordinates look like a unit of {unit_m:g} m, of"
        " which it would be {scaled_size_m:.2g} m",
        "Multiply the coordinates of cloud and scene by that unit; otherwise all lengths in meters are wrong.",
        otherwise="the cloud's file states a unit of {unit_m:.7g} m",
    ),
    WarningCode.NO_INTENSITY: WarningText(
        "the intensity in the cloud's file has no finite number and is left out: photo and cloud are compared by depth"
        " alone",
        "Export the cloud with its intensity, if the scanner measures one.",
    ),
    WarningCode.OFF_CENTER_PRINCIPAL_POINT: WarningText(
        "the camera's optical axis meets the photo of {width_px} x {height_px} pixels at ({x_px:.0f}, {y_px:.0f}), far"
        " from its middle: the calibration seems to be for photos of about {calibrated_width_px:.0f} x"
        " {calibrated_height_px:.0f}",
        "Use a photo of the calibrated size, scale the calibration, or give its width and height if the photo was cut.",
    ),
    WarningCode.NON_INVERTIBLE_DISTORTION: WarningText(
        "the lens model folds {angle_deg:.3g} deg off the axis, inside the photo: {pixel_fraction:.3%} of its pixels"
        " lie beyond, where bearings are ambiguous or missing",
        "Check the coefficients and their order, calibrate with targets out to the corners, or keep regions away from"
        " there.",
    ),
    WarningCode.RECTIFIED_PHOTO: WarningText(
        "the photo is called {name}, as rectified ones are, but its camera has distortion",
        "State it where it is rectified (camera: {file, rectified: true} in a scene); otherwise rename it.",
    ),
    WarningCode.OUTLIER_FRAME: WarningText(
        "{name} disagrees with the other frames: at their pose its contours lie {residual_px:.1f} px off,"
        " {expected_px:.1f} px are expected",
        "Check the regions named, the frame's pairs and its time, or leave it out.",
        otherwise="{name} disagrees with the other frames: at their pose its regions are not wholly in view",
        details={"regions": "concerned: {regions}"},
    ),
    WarningCode.UNOBSERVABLE_INTRINSICS: WarningText(
        "the regions do not determine {parameters}; the camera stays as it was given",
        "Add frames with regions near the image's border.",
    ),
    WarningCode.AMBIGUOUS_MATCHING: WarningText(
        "{others} other assignment(s) explain the image about as well",
        "Pair the regions yourself (regions with both sides), add one whose shape is unique, or a prior.",
    ),
    WarningCode.UNCONFIRMED_MATCHING: WarningText(
        "a single pair of {images} image and {worlds} world regions was found: no other confirms it",
        "Add regions on either side, or pair the regions yourself.",
    ),
}
"""The wording of each warning."""
