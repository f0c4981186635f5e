"""How far to trust a pose, in one sentence."""

from __future__ import annotations

import numpy as np

from regionpose.alignment.odds import DECISIVE
from regionpose.geometry.units import angle_text, length_text
from regionpose.scene.estimate import SceneEstimate
from regionpose.scene.fit import scene_fit
from regionpose.scene.solver_config import scene_solver
from regionpose.solve.status import DOUBTFUL_CODES, PoseStatus
from regionpose.solve.warning_code import WarningCode


def headline(run: SceneEstimate) -> str:
    """How a run fits, and its standard deviations where these count."""
    estimate = run.estimate
    fit = _fit(run) + _by_edges(run)
    turn, shift = float(np.max(estimate.sigma.rotation_deg)), float(np.max(estimate.sigma.translation_m))
    sigma = f"1 sigma: {angle_text(turn)}, {length_text(shift)} ({_limits(run)}){_by_focal(run)}"
    if estimate.status == PoseStatus.TRUSTED:
        return f"{fit}. {sigma}."
    if any(warning.code in DOUBTFUL_CODES for warning in estimate.warnings):
        return f"{fit}, but the true pose may be a different one."
    if estimate.status == PoseStatus.DOUBTFUL:
        return f"{fit}, but the pose is more likely wrong than right."
    return f"{fit}. If the pose is right, {sigma}."


def limits(run: SceneEstimate) -> tuple[float, float]:
    """The largest standard deviations of a trusted pose: degrees, meters."""
    most_deg, fraction = scene_solver(run.scene).limits
    return most_deg, fraction * run.estimate.diagnostics.distance_m


def _count(count: int, what: str) -> str:
    return f"the {what}" if count == 1 else f"{count} {what}s"


def _photos(run: SceneEstimate) -> str:
    return "the photo" if len(run.frames) == 1 else "their photos"


def _limits(run: SceneEstimate) -> str:
    most_deg, most_m = limits(run)
    return f"trusted up to {angle_text(most_deg)} and {length_text(most_m)}"


def _by_edges(run: SceneEstimate) -> str:
    """What the edges of photo and cloud did to the regions' pose: chose it among solutions, refined it."""
    edges = run.estimate.diagnostics.edges
    if edges is None or edges.regions_only is None:
        return ""
    before = edges.regions_only
    rank, count = before.rank, 1 + len(before.estimate.diagnostics.alternatives)
    if rank is None:
        return "; edges of photo and cloud give a pose that the regions alone do not have"
    parts = []
    ambiguous = any(warning.code == WarningCode.AMBIGUOUS_POSE for warning in run.estimate.warnings)
    if rank > 1 or (count > 1 and not ambiguous):
        parts.append(f"chosen among {count} poses by edges of photo and cloud")
    if before.is_refined:
        change = f"{angle_text(before.rotation_deg)}, {length_text(before.shift_m)}"
        parts.append(f"refined by edges of photo and cloud: {change}")
    return "".join(f"; {part}" for part in parts)


def _by_focal(run: SceneEstimate) -> str:
    """What an error of the focal lengths adds to that, where it is known."""
    edges = run.estimate.diagnostics.edges
    if edges is None or edges.focal is None or edges.regions_only is None:
        return ""
    return f"; focal lengths 1 % off would move it by {length_text(edges.focal.shift_m)}"


def _fit(run: SceneEstimate) -> str:
    """How the projected regions fit the observed ones: by their samples where all have such, else by their areas; of a
    scene without regions how the edges of photos and clouds agree.
    """
    found = run.estimate.diagnostics.edges
    if found is not None and run.is_by_edges:
        edges, log_odds = f"The edges of {_count(len(run.frames), 'cloud')}", found.log_odds
        if log_odds < DECISIVE:
            return f"{edges} lie on those of {_photos(run)} nowhere much better than by chance"
        return f"{edges} lie on those of {_photos(run)} at this pose, by odds of e^{log_odds:.0f} to 1 against chance"
    fit = scene_fit(run)
    if fit.on_their_side is None:
        fraction = 100.0 * fit.overlap_error
        return f"The projected regions differ from the observed ones by {fraction:.2f} % of their area"
    return f"Of the scan's samples {100.0 * fit.on_their_side:.1f} % lie on their side of the observed outlines"
