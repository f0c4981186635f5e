"""A result as one HTML file that opens offline: pictures, tables and a verdict, nothing loaded from elsewhere."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from numpy.typing import NDArray
from PIL import Image

from regionpose.geometry.units import angle_text, length_text
from regionpose.solve.status import PoseStatus

LARGEST_SIDE = 1600
"""Pictures are scaled down to this, pixels: wide enough to inspect edges, small enough to mail."""

REDUCING_GAP = 1.5
"""Large pictures are first averaged to at least so many times that size, which takes a third of the time."""

JPEG_QUALITY = 88

TEMPLATE = "report.html.j2"

HEADINGS = {
    PoseStatus.TRUSTED: "No warnings",
    PoseStatus.CHECK: "Check before use",
    PoseStatus.DOUBTFUL: "Do not trust yet",
}


@dataclass(frozen=True, eq=False)
class Figure:
    """A picture (h, w, 3) uint8 and what it shows."""

    picture: NDArray[np.uint8]
    caption: str


@dataclass(frozen=True)
class Report:
    """The contents of a report.

    `result`: as `scene.scene_result` gives it. `views`: the cloud's pictures, side by side.
    """

    title: str
    result: Mapping[str, Any]
    figures: Sequence[Figure]
    views: Sequence[Figure] = ()


def report_html(report: Report) -> str:
    """The report as the text of one HTML file; the template escapes whatever it is given."""
    page = Environment(loader=PackageLoader("regionpose.scene", "."), autoescape=True, undefined=StrictUndefined)
    page.filters.update(data_url=data_url, numbers=_numbers, exponential=_exponential)
    result, found = report.result, report.result["diagnostics"]
    rig = found["rig"]
    heads, rows = _regions(found["regions"])
    return page.get_template(TEMPLATE).render(
        vars(report),
        found=found,
        heading=HEADINGS[PoseStatus(result["status"])],
        facts=_facts(result),
        region_heads=heads,
        region_rows=rows,
        sigma_rows=_sigmas(result),
        alternative_rows=_alternatives(found["alternatives"]),
        matching=[_matching(held) for held in found["matching"] or ()],
        frame_rows=_frames(None if rig is None else rig["frames"]),
        plane_rows=_planes(found["confirmed_regions"]),
        planes=_plane_words(found["confirmed_regions"]),
        settings=_settings(result),
    )


def data_url(picture: NDArray[np.uint8]) -> str:
    """The picture (h, w, 3), at most 1600 pixels a side, as a JPEG in a data URL."""
    image = Image.fromarray(picture)
    image.thumbnail((LARGEST_SIDE, LARGEST_SIDE), Image.Resampling.LANCZOS, reducing_gap=REDUCING_GAP)
    held = io.BytesIO()
    image.save(held, format="JPEG", quality=JPEG_QUALITY, optimize=True)
    return f"data:image/jpeg;base64,{base64.b64encode(held.getvalue()).decode('ascii')}"


def _facts(result: Mapping[str, Any]) -> list[tuple[str, str]]:
    return [
        (_percent(result["confidence"]), "confidence: the pose is within 5 deg"),
        *_fit(result["diagnostics"]),
        (angle_text(_worst(result["sigma"]["rotation_deg"])), "rotation, 1 sigma, worst axis"),
        (length_text(_worst(result["sigma"]["translation_m"])), "translation, 1 sigma, worst axis"),
        *_noise(result["diagnostics"]),
        (f"{sum(result['seconds'].values()):.1f} s", "for all stages"),
    ]


def _fit(found: Mapping[str, Any]) -> list[tuple[str, str]]:
    """How the regions fit: first by their samples, where all are given as such, since overlap errors are coarse then;
    how far the edges of photo and cloud agree of a scene without regions.
    """
    edges = found["edges"]
    if not found["regions"] and edges is not None:
        return [
            (f"{edges['count']:,}", "edges of clouds in view"),
            (_fixed(edges["log_odds"], 1), "log odds over chance"),
        ]
    fractions = [region["consistent_sample_fraction"] for region in found["regions"]]
    error = _percent(found["overlap_error"])
    known = [fraction for fraction in fractions if fraction is not None]
    if len(known) < len(fractions) or not known:
        return [(error, "overlap error, all regions")]
    less = "overlap error of outlines, which the scan leaves open; its samples count"
    return [(_percent(min(known)), "samples on their side, worst region"), (error, less)]


def _noise(found: Mapping[str, Any]) -> list[tuple[str, str]]:
    """The noise of the contours, where there are some."""
    if not found["regions"]:
        return []
    return [(f"{_fixed(found['boundary_noise_px'], 2)} px", "noise of the contours")]


def _regions(regions: Sequence[Mapping[str, Any]]) -> tuple[list[str], list[list[str]]]:
    """The heads and the rows of the table of regions."""
    compared = any("overlap_error_before" in region for region in regions)
    errors = ["overlap error before", "overlap error after"] if compared else ["overlap error"]
    heads = ["region", *errors, "image area (px)", "world area (m²)", "cloud points", "boundary from"]
    return [*heads, "samples on their side"], [_region(region, compared) for region in regions]


def _region(region: Mapping[str, Any], compared: bool) -> list[str]:
    return [
        region["name"],
        *([_percent(region.get("overlap_error_before"))] if compared else []),
        _percent(region["overlap_error"]),
        f"{region['image_area_px']:,.0f}",
        f"{region['world_area_m2']:.4g}",
        "" if region["cloud_points"] is None else f"{region['cloud_points']:,}",
        region["boundary_source"],
        "" if region["consistent_sample_fraction"] is None else _percent(region["consistent_sample_fraction"]),
    ]


def _matching(held: Mapping[str, Any]) -> str:
    """Which unpaired regions were found to be which."""
    left = [*held["unmatched_image_regions"], *held["unmatched_world_regions"]]
    where = f" in {held['frame']}" if "frame" in held else ""
    words = f"Pairs that were found{where}: {_pairs(held['pairs']) or 'none'}."
    words += f" Without a partner: {', '.join(left)}." if left else ""
    return words + "".join(f" Another assignment: {_pairs(other)}." for other in held["alternatives"])


def _pairs(pairs: Sequence[Sequence[str]]) -> str:
    return ", ".join(f"{image} is {world}" for image, world in pairs)


def _frames(frames: Sequence[Mapping[str, Any]] | None) -> list[list[str]]:
    """How the regions of each of several frames fit; nothing of frames without regions."""
    fitted = [frame for frame in frames or () if frame["leave_one_out"] is not None]
    return [[frame["name"], _percent(frame["overlap_error"]), *_frame(frame)] for frame in fitted]


def _frame(frame: Mapping[str, Any]) -> list[str]:
    other = frame["leave_one_out"]
    return [
        _fixed(frame["residual_px"], 2),
        _fixed(other["residual_px"], 2),
        _fixed(other["expected_px"], 2),
        _fixed(other["rotation_deg"], 3),
        _fixed(_scaled(other["shift_m"], 1000.0), 1),
    ]


def _planes(confirmed: Mapping[str, Any] | None) -> list[list[str]]:
    """The planes that photos confirm, frame after frame."""
    frames = [] if confirmed is None else confirmed["frames"]
    return [
        [
            f"{frame['frame']}: {region['name']}" if "frame" in frame else region["name"],
            _fixed(region["log_odds"], 1),
            _percent(region["edge_fraction"]),
            f"{region['image_area_px']:,.0f}",
            f"{region['world_area_m2']:.4g}",
            f"{region['cloud_points']:,}",
        ]
        for frame in frames
        for region in frame["regions"]
    ]


def _plane_words(confirmed: Mapping[str, Any] | None) -> list[str]:
    """How borders of planes fit, and the pose by the confirmed ones alone."""
    if confirmed is None:
        return []
    words = []
    for frame in confirmed["frames"]:
        name = f"{frame['frame']}: " if "frame" in frame else ""
        count = f"{len(frame['regions'])} of {frame['compared']} borders of planes are confirmed"
        words.append(f"{name}{count}; log odds of all over chance: {_fixed(frame['log_odds'], 1)}.")
    pose = confirmed["pose"]
    if pose is not None:
        turn, shift = _worst(pose["sigma"]["rotation_deg"]), _worst(pose["sigma"]["translation_m"])
        codes = ", ".join(dict.fromkeys(warning["code"] for warning in pose["warnings"]))
        words.append(
            f"The pose by these regions alone (1 sigma {angle_text(turn)} and {length_text(shift)}) is"
            f" {_fixed(pose['distance_sigmas'], 1)} standard deviations from the pose by edges, of six parameters"
            f" together.{f' Its warnings: {codes}.' if codes else ''}"
        )
    return words


def _sigmas(result: Mapping[str, Any]) -> list[list[str]]:
    sigma = result["sigma"]
    return [
        ["rotation about it (deg)", *(_fixed(value, 4) for value in sigma["rotation_deg"])],
        ["translation along it (mm)", *(_fixed(_scaled(value, 1000.0), 2) for value in sigma["translation_m"])],
    ]


def _alternatives(alternatives: Sequence[Mapping[str, Any]]) -> list[list[str]]:
    return [
        [
            str(number),
            _percent(other["confidence"]),
            _percent(other["overlap_error"]),
            _numbers(other["camera_from_world"]["quat_xyzw"]),
            _numbers(other["camera_from_world"]["translation_m"]),
        ]
        for number, other in enumerate(alternatives, start=1)
    ]


def _settings(result: Mapping[str, Any]) -> str:
    found = result["diagnostics"]
    versions = ", ".join(f"{name} {version}" for name, version in result["versions"].items())
    seconds = ", ".join(f"{name} {value:.2f} s" for name, value in result["seconds"].items())
    solver = ", ".join(f"{name} {value}" for name, value in result["solver"].items())
    solver += f"; {found['evaluations']} evaluations; {found['termination']}"
    return f"Solver: {solver}. Time: {seconds}. Versions: {versions}."


def _percent(fraction: float | None) -> str:
    return "unknown" if fraction is None else f"{100.0 * fraction:.2f} %"


def _scaled(value: float | None, scale: float) -> float | None:
    return None if value is None else value * scale


def _fixed(value: float | None, digits: int) -> str:
    return "unknown" if value is None else f"{value:.{digits}f}"


def _worst(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return None if len(known) < len(values) else max(known)


def _numbers(values: Iterable[float], digits: int = 9) -> str:
    return ", ".join(f"{value:.{digits}g}" for value in values)


def _exponential(value: float | None) -> str:
    return "      null" if value is None else f"{value: .3e}"
