"""The page's texts that are made of what was found: HTML with everything from outside escaped."""

from __future__ import annotations

from html import escape

import numpy as np

from regionpose.pick.outcome import Outcome
from regionpose.pick.parts import Picked

HEADINGS = {"trusted": "Trusted", "check": "Check before use", "doubtful": "Do not trust yet"}

EMPTY_LIST = """<div class="rp-empty">No regions yet. A region is a flat face that photo and cloud both show: a door, a sign, a
wall, a board.<ol><li><b>Click on it in the photo.</b> Its mask is proposed; the slider takes a smaller or a larger one.</li>
<li><b>Click on it in the cloud.</b> Its plane is grown.</li>
<li><b>Go on with the next one.</b> The pose appears with the first pair; three or four on different planes make it sure.</li></ol></div>"""

EMPTY_POSE = """<div class="rp-empty">The pose appears here as soon as one region has both sides, and again after every change.</div>"""

HELP = """<div class="rp-help"><h3>How it works</h3>Mark the same flat faces in the photo and in the cloud. From their outlines
alone the camera's pose follows: no corners, no guess to start from. The dashed outlines in the photo are the cloud's regions,
projected with the pose: where they lie on the masks, all is well. Faces on different planes, spread over the photo, hold it best.
<h3>Photo</h3><table>
<tr><td>click</td><td>propose a mask; the slider in the list takes a smaller or a larger one</td></tr>
<tr><td><kbd>Shift</kbd> click</td><td>propose another mask for the selected region</td></tr>
<tr><td>Polygon</td><td>click the corners, then the first one again or <kbd>Enter</kbd>; drag vertices, drag the small dots to add some, right-click removes</td></tr>
<tr><td>Hidden edges</td><td>click the edges of a polygon that are not the face's own, as where a car stands before it</td></tr></table>
<h3>Cloud</h3><table><tr><td>click</td><td>grow the plane there, in the range image (the view from the scanner) or in 3D</td></tr>
<tr><td>3D: drag, right drag</td><td>turn, shift</td></tr></table>
<h3>Both</h3><table><tr><td>wheel, drag</td><td>zoom, shift; <kbd>0</kbd> shows all</td></tr></table>
<h3>Keys</h3><table>
<tr><td><kbd>Ctrl</kbd> <kbd>Z</kbd>, <kbd>Ctrl</kbd> <kbd>Y</kbd></td><td>undo, redo</td></tr>
<tr><td><kbd>Ctrl</kbd> <kbd>S</kbd></td><td>save the scene file and its masks</td></tr>
<tr><td><kbd>1</kbd> <kbd>2</kbd> <kbd>3</kbd></td><td>take a proposal of the selected region's mask</td></tr>
<tr><td><kbd>C</kbd> <kbd>P</kbd> <kbd>H</kbd></td><td>click, polygon, hidden edges</td></tr>
<tr><td><kbd>N</kbd>, <kbd>Delete</kbd></td><td>begin a new region, remove the selected one</td></tr>
<tr><td><kbd>O</kbd></td><td>show or hide the projected outlines</td></tr></table></div>"""


def outcome_html(outcome: Outcome) -> str:
    """The verdict, the pose's numbers and its warnings."""
    if outcome.state == "failed":
        advice = "Look at the regions one by one: a wrong pair or a mask that leaked is the usual cause."
        return f'<div class="rp-verdict rp-failed"><b>No pose</b>{escape(outcome.message)} <span>{advice}</span></div>'
    if outcome.run is None or outcome.judged is None:
        waiting = '<div class="rp-empty"><span class="rp-spin"></span>Estimating the pose …</div>'
        return waiting if outcome.state == "busy" else EMPTY_POSE
    judged, estimate = outcome.judged, outcome.run.estimate
    heading = HEADINGS[judged.level]
    busy = outcome.state == "busy"
    spin = '<span class="rp-spin"></span>' if busy else ""
    said = f'<div class="rp-verdict rp-{judged.level}"><b>{spin}{heading}</b>{escape(judged.headline)}</div>'
    remarks = "".join(
        f'<div class="rp-warn">{escape(_sentence(what))}<em>{escape(advice)}</em></div>' for what, advice in judged.remarks
    )
    facts = [
        (f"{100.0 * estimate.confidence:.0f} %", "confidence"),
        (f"{np.max(estimate.rotation_sigma_deg):.3f}°", "rotation, 1 sigma"),
        (f"{1000.0 * np.max(estimate.translation_sigma):.0f} mm", "place, 1 sigma"),
        (f"{100.0 * estimate.overlap_error:.1f} %", "overlap error"),
    ]
    told = "".join(f"<div><b>{escape(value)}</b><span>{name}</span></div>" for value, name in facts)
    rows = "\n".join("  ".join(f"{value:10.5f}" for value in row) for row in estimate.pose.matrix[:3])
    matrix = f'<div class="rp-title" style="margin-bottom:4px">camera_from_world</div><pre class="rp-matrix">{rows}</pre>'
    return f'<div class="{"rp-busy" if busy else ""}">{said}<div class="rp-facts">{told}</div>{remarks}{matrix}</div>'


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:] + ("" if text.endswith(".") else ".")


def photo_hint(selected: Picked | None, mode: str) -> str:
    """What the next click in the photo does."""
    if mode == "polygon":
        return "<b>Polygon:</b> click the corners; the first one again or Enter closes it, Backspace takes one back, Esc all."
    if mode == "hide":
        editable = selected is not None and selected.image is not None and selected.image.chosen.is_polygon
        if editable:
            return "<b>Hidden edges:</b> click an edge that is not the face's own; click it again to take that back."
        return "<b>Hidden edges:</b> select a region whose side in the photo is a polygon first."
    return f"<b>Click</b> on a flat face {_whose(selected, 'image')}. Wheel zooms, drag shifts, Shift-click replaces."


def cloud_hint(selected: Picked | None) -> str:
    """What the next click in the cloud does."""
    return f"<b>Click</b> on the same face in the cloud {_whose(selected, 'world')}."


def _whose(selected: Picked | None, side: str) -> str:
    if selected is None or getattr(selected, side) is not None:
        return "to begin the next region"
    return f"for <b>{escape(selected.name)}</b>"
