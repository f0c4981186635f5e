"""The page's texts that are made of what was found: HTML with everything from outside escaped."""

from __future__ import annotations

from html import escape
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from regionpose.app.outcome import Outcome
from regionpose.app.parts import Picked
from regionpose.geometry.units import angle_text, length_text
from regionpose.scene.estimate import SceneEstimate
from regionpose.scene.fit import scene_fit
from regionpose.scene.result import edge_values
from regionpose.scene.searched import searched_text
from regionpose.solve.status import PoseStatus

HEADINGS = {
    PoseStatus.TRUSTED: "Trusted",
    PoseStatus.CHECK: "Check before use",
    PoseStatus.DOUBTFUL: "Do not trust yet",
}

EMPTY_LIST = (
    '<div class="rp-empty">No regions yet. A region is a flat face that photo and cloud both show: a door, a sign, a'
    " wall, a board.<ol><li><b>Click on it in the photo.</b> Its mask is proposed; the slider takes a smaller or a"
    " larger one.</li><li><b>Click on it in the cloud.</b> The whole plane is taken;"
    " a further click takes a part of it, such as a sign.</li><li><b>Go on with the next one.</b>"
    " The pose follows from the first pair on; three or four on different planes make it certain.</li></ol></div>"
)

EDGES_ENOUGH = (
    '<div class="rp-empty">The pose comes from the edges of photo and cloud. Where the points over the photo lie on'
    " what they show, regions are not needed: save. Where they do not, mark regions.</div>"
)
"""The text before the list's help where the pose comes from edges."""

EMPTY_POSE = (
    '<div class="rp-empty">The pose appears here as soon as one region has both sides, and again after every change.'
    "</div>"
)

WITHOUT_POSE = {
    "busy": '<div class="rp-empty"><span class="rp-spin"></span>Estimating the pose …</div>',
    "searching": '<div class="rp-empty"><span class="rp-spin"></span>Searching the pose at which edges of the cloud lie'
    " on those of the photo …</div>",
    "stopped": '<div class="rp-empty">The estimate was stopped before there was a pose.</div>',
}
"""The text instead of a pose where there is none."""

FAILED = {
    False: "Look at the regions one by one: a wrong pair or a mask that leaked is the usual cause.",
    True: "Give the scanner's place and a prior, or mark regions in photo and cloud.",
}
"""What to do where there is no pose, by whether it was searched by edges."""

OF_REGIONS = {
    "regions": ("regions", "By the regions so far; edges of photo and cloud are being compared"),
    "stopped": ("regions", "By the regions alone; edges of photo and cloud were not compared"),
}
"""The levels and headings of poses that the regions alone gave."""

SCANNER_QUESTION = (
    '<div class="rp-help"><h3>Where did the scanner stand?</h3>In the frame of the cloud, mostly 0, 0, 0. That is'
    " proposed where the cloud looks like one scan around its zero. The place determines the regions far better: by"
    " the beams that met them and those that passed beside them.</div>"
)

PRIOR_QUESTION = (
    '<div class="rp-help"><h3>Prior of the pose</h3>In the frame of the cloud. It chooses between'
    " poses that fit about equally well, and warns of one that it contradicts. Without regions it is all that is"
    " searched. Leave empty what you do not know. Without a prior the camera is assumed within some meters of the"
    " scanner, without regions within 0.5 m (1 sigma).</div>"
)

HELP = (Path(__file__).parent / "help.html").read_text(encoding="utf-8")


def outcome_html(outcome: Outcome) -> str:
    """The verdict, the pose's numbers and its warnings."""
    if outcome.state == "failed":
        advice = FAILED[outcome.searches_edges]
        return f'<div class="rp-verdict rp-failed"><b>No pose</b>{escape(outcome.message)} <span>{advice}</span></div>'
    if outcome.run is None:
        state = "searching" if outcome.searches_edges and outcome.state == "busy" else outcome.state
        return WITHOUT_POSE.get(state, EMPTY_POSE)
    estimate = outcome.run.estimate
    # By the regions alone nothing is trusted yet: edges of photo and cloud may choose another pose.
    level, heading = OF_REGIONS.get(outcome.state, (estimate.status.value, HEADINGS[estimate.status]))
    busy = outcome.state == "busy"
    spin = '<span class="rp-spin"></span>' if busy or outcome.state == "regions" else ""
    heading_html = f'<div class="rp-verdict rp-{level}"><b>{spin}{heading}</b>{escape(outcome.headline)}</div>'
    names = outcome.run.names
    remarks = "".join(
        f'<div class="rp-warn">{escape(_sentence(warning.text_with(names)))}<em>{escape(warning.advice)}</em></div>'
        for warning in estimate.warnings
    )
    facts = [
        # No pose is certain.
        (f"{min(100.0 * estimate.confidence, 99.9):.1f} %", "confidence"),
        (angle_text(float(np.max(estimate.sigma.rotation_deg)), "°"), "rotation, 1 sigma"),
        (length_text(float(np.max(estimate.sigma.translation_m))), "place, 1 sigma"),
        _fit(outcome.run),
    ]
    facts_items = "".join(f"<div><b>{escape(value)}</b><span>{name}</span></div>" for value, name in facts)
    rows = "\n".join("  ".join(f"{value:10.5f}" for value in row) for row in estimate.pose.matrix[:3])
    matrix = (
        f'<div class="rp-title" style="margin-bottom:4px">camera_from_world</div><pre class="rp-matrix">{rows}</pre>'
    )
    facts_html = f'<div class="rp-facts">{facts_items}</div>{_searched(outcome.run)}'
    return f'<div class="{"rp-busy" if busy else ""}">{heading_html}{facts_html}{remarks}{matrix}</div>'


def _fit(run: SceneEstimate) -> tuple[str, str]:
    """How well the pose fits, and by what measure: by regions, or by edges without these."""
    edges = run.estimate.diagnostics.edges
    if edges is not None and run.is_by_edges:
        return f"{edges.count:,}", "edges in view"
    fit = scene_fit(run)
    return fit.value, fit.measure


def _searched(run: SceneEstimate) -> str:
    """What was searched for a pose by edges, and what was assumed for that; nothing of another pose."""
    found = edge_values(run) if run.is_by_edges else None
    if found is None:
        return ""
    text = f"Searched: {searched_text(found)}."
    if run.scanner is None:
        text += " The scanner is taken to stand at the cloud's zero (assumed)."
    return f'<div class="rp-soft rp-searched">{escape(text)}</div>'


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:] + ("" if text.endswith(".") else ".")


def scanner_text(place: NDArray[np.float64] | None, asks: bool) -> str:
    """Where the scanner stood, as far as it is given."""
    if place is None:
        return "Scanner: where?" if asks else "Scanner: several places"
    return "Scanner: " + ", ".join(f"{round(value, 2):g}" for value in place.tolist())


def photo_hint(selected: Picked | None, mode: str) -> str:
    """What the next click in the photo does."""
    if mode == "polygon":
        ends = "Enter closes, Backspace takes one back, Esc all"
        return f"<b>Polygon:</b> click the corners; Shift hides the edge to one, Shift-drag a whole outline; {ends}."
    if mode == "hide":
        editable = selected is not None and selected.image is not None and selected.image.chosen.is_polygon
        if editable:
            return "<b>Hidden edges:</b> click an edge that is not the face's own; click it again to take that back."
        return "<b>Hidden edges:</b> select a region whose side in the photo is a polygon first."
    return f"<b>Click</b> on a flat face {_whose(selected, 'image')}. Wheel zooms, drag shifts, Shift-click replaces."


def cloud_hint(selected: Picked | None, cuts: bool) -> str:
    """What the next click in the cloud does."""
    if cuts and selected is not None and selected.world is not None:
        return (
            f"<b>Cut out:</b> Shift-drag around the points of <b>{escape(selected.name)}</b>, or click corners, Enter."
        )
    if cuts:
        whose = _whose(selected, "world")
        return f"<b>Cut out:</b> Shift-drag around a face's points {whose}, or click corners, Enter."
    if selected is not None and selected.world is not None and len(selected.world) > 1:
        return f"<b>Click</b> there again for a narrower part of <b>{escape(selected.name)}</b>, or on another face."
    return f"<b>Click</b> on the same face in the cloud {_whose(selected, 'world')}."


def _whose(selected: Picked | None, side: str) -> str:
    if selected is None or getattr(selected, side) is not None:
        return "to begin the next region"
    return f"for <b>{escape(selected.name)}</b>"
