"""Whether to trust a pose, in plain words."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from regionpose.alignment.odds import DECISIVE
from regionpose.geometry.units import angle_text, length_text
from regionpose.scene.estimate import SceneEstimate
from regionpose.scene.fit import scene_fit
from regionpose.scene.solver_config import scene_solver

ADVICE = {
    "ambiguous-matching": "Pair the regions yourself (regions with both sides), or add one whose shape is its own.",
    "outlier-frame": "Look at this frame's overlay: a pair is wrong, or photo and cloud were not taken at one time.",
    "unconfirmed-matching": "Add regions on either side, or pair the regions yourself.",
    "ambiguous": "Add a region without symmetry, or say what is known: prior.up, prior.camera_near, prior.initial and"
    " its deviations, viewpoint of a region's world side.",
    "ambiguous-region": "This region or the one that the pose itself leaves out is wrong: its mask, its outline, or the"
    " pair.",
    "focal-contradicted": "Check the calibration: whether it is of this lens and zoom, and of photos of this size; with"
    " the right focal lengths the pose is another one.",
    "hidden-region": "Look at depth.png: something of the cloud stands before this region. Check the regions'"
    " pairs, the focal length, and that photo and cloud are of one time; or say what is known of the camera.",
    "initial-contradicted": "One of them is wrong: check the regions' pairs, or prior.initial and how rough it is.",
    "regions-contradicted": "Look at depth.png and edges.png: if they fit, a region's mask, outline or pair is wrong;"
    " if not, photo and cloud don't show the same scene.",
    "scene-disagrees": "Look at edges.png: at a right pose most dots are green. Check the regions' pairs, the"
    " calibration, and that photo and cloud show the same scene.",
    "low-confidence": "Look at the overlay; add a region, or take its mask from nearer by.",
    "not-converged": "Do not use this pose before looking at the overlay; check that each pair shows the same place.",
    "outlier-region": "Leave this region out, or correct it: its mask, its outline, or the pair is wrong.",
    "place-contradicted": "One of them is wrong: check the regions' pairs, or prior.camera_near, which is the scanner's"
    " place unless it is given, and camera_near_sigma_m; null for a camera that may stand anywhere.",
    "poor-overlap": "Look at this region in the overlay: its mask or outline is wrong, or the pair does not match.",
    "samples-unused": "Look at the overlay: check the regions' pairs, sensor_origin and the returns that are marked.",
    "side-contradicted": "Either viewpoint is on the wrong side, or the pair or an outline is wrong.",
    "sparse-sampling": "Use a denser scan, a region that is larger or nearer, or its known outline as a polygon.",
    "up-contradicted": "One of them is wrong: check the regions' pairs, or the direction prior.up.",
    "weak-geometry": "Add a region in another plane or further from the others, or more frames; or, if this is precise"
    " enough, raise solver.max_rotation_sigma_deg or solver.max_translation_sigma_percent.",
}
"""What to do about each warning whose message doesn't say so itself."""

EDGE_ADVICE = {
    "ambiguous": "Look at depth.png and runner_up.png; add frames (edges of several add up) or regions, or say what is"
    " known: prior.up, prior.camera_near, prior.initial and its deviations.",
    "low-confidence": "Look at depth.png; add frames or regions, or say what is known: prior.up, prior.camera_near,"
    " prior.initial and its deviations.",
    "weak-geometry": "Add frames, or regions; or, if this is precise enough, raise solver.max_rotation_sigma_deg or"
    " solver.max_translation_sigma_percent.",
}
"""The same for a pose by edges alone."""

TRUSTED, CHECK, DOUBTFUL = "trusted", "check", "doubtful"

DOUBTS = {
    "not-converged",
    "ambiguous",
    "ambiguous-matching",
    "focal-contradicted",
    "hidden-region",
    "initial-contradicted",
    "place-contradicted",
    "scene-disagrees",
    "side-contradicted",
    "unconfirmed-matching",
    "up-contradicted",
}
"""Warnings after which the pose may be another one altogether."""

STATED = 0.5
"""Least confidence with which a precision is stated: below it the pose is rather wrong than right."""


@dataclass(frozen=True)
class Verdict:
    """`level`: trusted, check or doubtful. `headline`: one sentence. `remarks`: (warning, advice) pairs."""

    level: str
    headline: str
    remarks: tuple[tuple[str, str], ...]

    @property
    def values(self) -> dict[str, Any]:
        """The verdict as plain values."""
        reasons = [{"warning": warning, "advice": advice} for warning, advice in self.remarks]
        return {"level": self.level, "headline": self.headline, "reasons": reasons}


def verdict(run: SceneEstimate) -> Verdict:
    """The verdict on a run: trusted without warnings, of which one is that the standard deviations exceed the limits;
    doubtful where another pose may be the true one or the pose is more likely wrong than right, else to be checked.
    """
    estimate = run.estimate
    codes = {warning.code for warning in estimate.warnings}
    advice = ADVICE | EDGE_ADVICE if run.is_by_edges else ADVICE
    remarks = tuple((warning.message_for(run.names), advice.get(warning.code, "")) for warning in estimate.warnings)
    fit = _fit(run) + _by_edges(run)
    turn, shift = float(np.max(estimate.rotation_sigma_deg)), float(np.max(estimate.translation_sigma_m))
    sigma = f"{angle_text(turn)} and {length_text(shift)} (1 sigma; {_limits(run)}){_by_focal(run)}"
    if not codes:
        return Verdict(TRUSTED, f"{fit}; the pose is known to about {sigma}.", ())
    if codes & DOUBTS:
        return Verdict(DOUBTFUL, f"{fit}, but this may not be the true pose.", remarks)
    if estimate.confidence < STATED:
        return Verdict(DOUBTFUL, f"{fit}, but the pose is more likely wrong than right.", remarks)
    return Verdict(CHECK, f"{fit}; if the pose is right, it is known to about {sigma}.", remarks)


def limits(run: SceneEstimate) -> tuple[float, float]:
    """The largest standard deviations of a trusted pose: degrees, meters."""
    most_deg, share = scene_solver(run.scene).limits
    return most_deg, share * run.estimate.distance_m


def _count(count: int, what: str) -> str:
    return f"the {what}" if count == 1 else f"{count} {what}s"


def _photos(run: SceneEstimate) -> str:
    return "the photo" if len(run.frames) == 1 else "their photos"


def _limits(run: SceneEstimate) -> str:
    most_deg, most_m = limits(run)
    return f"trusted up to {angle_text(most_deg)} and {length_text(most_m)}"


def _by_edges(run: SceneEstimate) -> str:
    """What the edges of photo and cloud did to the regions' pose: chose it among answers, refined it."""
    found = run.calibration
    if found is None or found.regions is None:
        return ""
    rank, count = found.rank_before, 1 + len(found.regions.alternatives)
    if rank is None:
        return "; edges of photo and cloud lead to a pose that the regions alone don't have"
    said = []
    if rank or (count > 1 and not any(warning.code == "ambiguous" for warning in run.estimate.warnings)):
        said.append(f"choose this pose of {count} that fit")
    if found.is_refined:
        said.append(f"refine it by {angle_text(found.turned_deg)} and {length_text(found.moved_m)}")
    return f"; edges of photo and cloud {' and '.join(said)}" if said else ""


def _by_focal(run: SceneEstimate) -> str:
    """What an error of the focal lengths adds to that, where it is known."""
    found = run.calibration
    if found is None or found.focal is None or found.regions is None:
        return ""
    return f"; focal lengths 1 % off would move it by {length_text(found.focal.shift_m)}"


def _fit(run: SceneEstimate) -> str:
    """How the projected regions fit the observed ones: by their samples where all have such, else by their areas; of a
    scene without regions how the edges of photos and clouds agree.
    """
    if run.calibration is not None and run.is_by_edges:
        edges, log_odds = f"The edges of {_count(len(run.frames), 'cloud')}", run.calibration.log_odds
        if log_odds < DECISIVE:
            return f"{edges} lie on those of {_photos(run)} nowhere much better than by chance"
        return f"{edges} lie on those of {_photos(run)} at this pose, by odds of e^{log_odds:.0f} to 1 against chance"
    fit = scene_fit(run)
    if fit.on_their_side is None:
        share = 100.0 * fit.overlap_error
        return f"The projected regions differ from the observed ones by {share:.2f} % of their area"
    return f"Of the scan's samples {100.0 * fit.on_their_side:.1f} % lie on their side of the observed outlines"
