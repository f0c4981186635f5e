"""A result as one HTML file that opens offline: pictures, tables and a verdict, nothing loaded from elsewhere."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

LARGEST_SIDE = 1600
"""Pictures are scaled down to this, pixels: wide enough to judge edges by, small enough to mail."""

JPEG_QUALITY = 88

STYLE = """
:root{color-scheme:light dark;--ink:#1c2430;--soft:#5b6675;--paper:#fff;--line:#dfe4ea;--card:#f6f8fa;
--good:#1a7f4b;--check:#a86400;--bad:#b42318}
@media(prefers-color-scheme:dark){:root{
--ink:#e7ebf0;--soft:#9aa6b5;--paper:#14181e;--line:#2c343f;--card:#1c222b;--good:#4cc38a;--check:#f0a945;--bad:#ff7a6b}}
*{box-sizing:border-box}
body{margin:0 auto;max-width:1080px;padding:2rem 1.25rem 4rem;background:var(--paper);
color:var(--ink);font:16px/1.55 system-ui,sans-serif}
h1{font-size:1.6rem;margin:0 0 .25rem}h2{font-size:1.15rem;margin:2.4rem 0 .6rem}
.soft{color:var(--soft)}
.verdict{border-left:5px solid;padding:.8rem 1.1rem;background:var(--card);border-radius:4px;margin:1.2rem 0}
.verdict p{margin:.25rem 0}.verdict strong{font-size:1.1rem}
.trusted{border-color:var(--good)}.check{border-color:var(--check)}.doubtful{border-color:var(--bad)}
.trusted strong{color:var(--good)}.check strong{color:var(--check)}.doubtful strong{color:var(--bad)}
.facts{display:grid;grid-template-columns:repeat(auto-fit,minmax(180px,1fr));gap:.8rem;margin:1.2rem 0}
.facts div{background:var(--card);border-radius:6px;padding:.7rem .9rem}
.facts b{display:block;font-size:1.25rem;font-variant-numeric:tabular-nums}
.facts span{color:var(--soft);font-size:.85rem}
figure{margin:1rem 0}figure img{width:100%;height:auto;border-radius:6px;display:block}
figcaption{color:var(--soft);font-size:.9rem;margin-top:.35rem}
.pair{display:grid;grid-template-columns:repeat(auto-fit,minmax(320px,1fr));gap:1rem}
.wide{overflow-x:auto}
table{border-collapse:collapse;width:100%;font-variant-numeric:tabular-nums}
th,td{text-align:right;padding:.4rem .7rem;border-bottom:1px solid var(--line);white-space:nowrap}
th:first-child,td:first-child{text-align:left}th{color:var(--soft);font-weight:600;font-size:.88rem}
pre{background:var(--card);padding:.8rem 1rem;border-radius:6px;overflow-x:auto;font-size:.85rem;line-height:1.45}
td:first-child{white-space:normal}td code{font-size:.78rem;white-space:normal;overflow-wrap:anywhere}
@page{margin:14mm}
@media print{:root{color-scheme:light;--ink:#000;--soft:#444;--paper:#fff;--line:#bbb;--card:#fff;
--good:#1a7f4b;--check:#a86400;--bad:#b42318}
body{max-width:none;padding:0;font-size:11px}
h2{break-after:avoid}figure,tr,.verdict,.facts,pre{break-inside:avoid}
figure img{max-height:11cm;width:auto;max-width:100%}
.facts div,.verdict,pre{border:1px solid var(--line)}pre{white-space:pre-wrap;overflow-wrap:anywhere}
.wide{overflow:visible}th,td{white-space:normal}}
"""

VIEWPORT = '<meta name="viewport" content="width=device-width,initial-scale=1">'

HEADINGS = {"trusted": "No warnings", "check": "Check before use", "doubtful": "Do not trust yet"}


@dataclass(frozen=True, eq=False)
class Figure:
    """A picture (h, w, 3) uint8 and what it shows."""

    picture: NDArray[np.uint8]
    caption: str


@dataclass(frozen=True)
class Report:
    """What a report says.

    `result`: as `scene.scene_result` gives it. `level`: trusted, check or doubtful; `headline` and `remarks`,
    (warning, advice) pairs, as in `scene.verdict.Verdict`. `views`: the cloud's pictures, side by side.
    """

    title: str
    level: str
    headline: str
    remarks: Sequence[tuple[str, str]]
    result: Mapping[str, Any]
    figures: Sequence[Figure]
    views: Sequence[Figure] = ()


def report_html(report: Report) -> str:
    """The report as the text of one HTML file."""
    result = report.result
    parts = [
        f"<h1>{escape(report.title)}</h1>",
        f'<p class="soft">regionpose {escape(result["versions"]["regionpose"])}, scene {escape(result["scene"])}</p>',
        _verdict(report),
        _facts(result),
        *[_figure(figure) for figure in report.figures],
        f'<div class="pair">{"".join(_figure(view) for view in report.views)}</div>' if report.views else "",
        "<h2>Regions</h2>",
        _regions(result["regions"]),
        _matching(result["matching"]),
        _frames(result["frames"]),
        _truth(result.get("truth_errors")),
        "<h2>Pose</h2>",
        _pose("camera_from_world", result["camera_from_world"]),
        _pose("world_from_camera", result["world_from_camera"]),
        f"<p>Camera center in the world: <code>{_numbers(result['camera_center_in_world_m'])}</code> m.</p>",
        _known(result),
        "<h2>Uncertainty</h2>",
        _uncertainty(result),
        _alternatives(result["alternatives"]),
        "<h2>For other tools</h2>",
        _exports(result["exports"]),
        "<h2>Inputs and versions</h2>",
        _inputs(result),
    ]
    body = "\n".join(part for part in parts if part)
    head = f'<meta charset="utf-8">{VIEWPORT}<title>{escape(report.title)}</title>'
    return (
        f'<!doctype html>\n<html lang="en"><head>{head}<style>{STYLE}</style></head>\n<body>\n{body}\n</body></html>\n'
    )


def _known(result: Mapping[str, Any]) -> str:
    """Where the scanner stood and the camera near it, and who says so."""
    told = [("Scanner at", result["sensor_origin"]), ("The camera was taken to be near", result["camera_near"])]
    parts = [
        f"{what} <code>{_numbers(said['place_in_world_m'])}</code> m"
        + (f" (1 sigma {said['sigma_m']:g} m)" if "sigma_m" in said else "")
        + f", by {escape(said['said_by'])}."
        for what, said in told
        if said is not None
    ]
    return f"<p>{' '.join(parts)}</p>" if parts else ""


def data_url(picture: NDArray[np.uint8]) -> str:
    """The picture (h, w, 3), at most 1600 pixels a side, as a JPEG in a data URL."""
    image = Image.fromarray(picture)
    image.thumbnail((LARGEST_SIDE, LARGEST_SIDE), Image.Resampling.LANCZOS)
    held = io.BytesIO()
    image.save(held, format="JPEG", quality=JPEG_QUALITY, optimize=True)
    return f"data:image/jpeg;base64,{base64.b64encode(held.getvalue()).decode('ascii')}"


def _verdict(report: Report) -> str:
    remarks = "".join(f"<p>{escape(what)}. <em>{escape(advice)}</em></p>" for what, advice in report.remarks)
    heading = f"<strong>{HEADINGS[report.level]}</strong>"
    return f'<div class="verdict {report.level}">{heading}<p>{escape(report.headline)}</p>{remarks}</div>'


def _facts(result: Mapping[str, Any]) -> str:
    facts = [
        (_percent(result["confidence"]), "confidence: the pose is within 5 deg"),
        (_percent(result["overlap_error"]), "overlap error, all regions"),
        (f"{_worst(result['rotation_sigma_deg'], 1.0)} deg", "rotation, 1 sigma, worst axis"),
        (f"{_worst(result['translation_sigma_m'], 1000.0)} mm", "translation, 1 sigma, worst axis"),
        (f"{_fixed(result['boundary_noise_px'], 2)} px", "noise of the contours"),
        (f"{sum(result['seconds'].values()):.1f} s", "for all stages"),
    ]
    return (
        f'<div class="facts">{"".join(f"<div><b>{value}</b><span>{name}</span></div>" for value, name in facts)}</div>'
    )


def _figure(figure: Figure) -> str:
    caption = escape(figure.caption)
    return f'<figure><img alt="{caption}" src="{data_url(figure.picture)}"><figcaption>{caption}</figcaption></figure>'


def _regions(regions: Sequence[Mapping[str, Any]]) -> str:
    compared = any("overlap_error_before" in region for region in regions)
    rows = [
        [
            escape(region["name"]),
            *([_percent(region.get("overlap_error_before"))] if compared else []),
            _percent(region["overlap_error"]),
            f"{region['image_area_px']:,.0f}",
            f"{region['world_area_m2']:.4g}",
            "" if region["cloud_points"] is None else f"{region['cloud_points']:,}",
            escape(region["known_by"]),
            "" if region["samples_on_their_side"] is None else _percent(region["samples_on_their_side"]),
        ]
        for region in regions
    ]
    errors = ["overlap error before", "overlap error after"] if compared else ["overlap error"]
    return _table(
        ["region", *errors, "image area (px)", "world area (m²)", "cloud points", "known by", "samples on their side"],
        rows,
    )


def _matching(matched: Sequence[Mapping[str, Any]] | None) -> str:
    """Which unpaired regions were found to be which."""
    parts = []
    for held in matched or ():
        pairs = ", ".join(f"{image} is {world}" for image, world in held["pairs"]) or "none"
        left = [*held["unmatched_image_regions"], *held["unmatched_world_regions"]]
        words = f"Pairs that were found{_of_frame(held)}: {pairs}."
        words += f" Without a partner: {', '.join(left)}." if left else ""
        for other in held["alternatives"]:
            words += " Another assignment: " + ", ".join(f"{image} is {world}" for image, world in other) + "."
        parts.append(f"<p>{escape(words)}</p>")
    return "".join(parts)


def _of_frame(held: Mapping[str, Any]) -> str:
    return f" in {held['frame']}" if "frame" in held else ""


def _frames(frames: Sequence[Mapping[str, Any]] | None) -> str:
    """How each of several frames fits."""
    if frames is None:
        return ""
    heads = ["frame", "overlap error", "contours (px)", "without it (px)", "expected (px)", "turn (deg)", "shift (mm)"]
    rows = []
    for frame in frames:
        other = frame["without_it"]
        own = [escape(frame["name"]), _percent(frame["overlap_error"]), _fixed(frame["residual_px"], 2)]
        apart = [_fixed(other["turned_deg"], 3), _fixed(_scaled(other["moved_m"], 1000.0), 1)]
        rows.append([*own, _fixed(other["residual_px"], 2), _fixed(other["expected_px"], 2), *apart])
    words = (
        "How far each frame's contours lie from its projected outlines: at the pose, at the pose of the other frames,"
        " and what their noise leads to expect; and how far that pose is from the pose of all."
    )
    return f'<h2>Frames</h2>{_table(heads, rows)}<p class="soft">{words}</p>'


def _truth(errors: Mapping[str, Any] | None) -> str:
    if errors is None:
        return ""
    center = 1000.0 * errors["camera_center_m"]
    turn = f"{errors['rotation_deg']:.4f} deg in rotation"
    return f"<p>Against the truth: {turn}, {center:.2f} mm in the camera's center.</p>"


def _pose(name: str, pose: Mapping[str, Any]) -> str:
    lines = ["[" + ", ".join(f"{value:14.9f}" for value in row) + "]" for row in pose["matrix"]]
    text = f"{name}: {pose['meaning']}\n\nmatrix\n" + "\n".join(lines)
    text += f"\n\nquat_xyzw      [{_numbers(pose['quat_xyzw'])}]\ntranslation_m  [{_numbers(pose['translation_m'])}]"
    return f"<pre>{escape(text)}</pre>"


def _uncertainty(result: Mapping[str, Any]) -> str:
    rows = [
        ["rotation about it (deg)", *(_fixed(value, 4) for value in result["rotation_sigma_deg"])],
        ["translation along it (mm)", *(_fixed(_scaled(value, 1000.0), 2) for value in result["translation_sigma_m"])],
    ]
    table = _table(["1 sigma, camera axis", "x (right)", "y (down)", "z (forward)"], rows)
    covariance = "\n".join(
        "  ".join("      null" if value is None else f"{value: .3e}" for value in row) for row in result["covariance"]
    )
    convention = escape(result["covariance_convention"])
    return f'{table}<p class="soft">Covariance: {convention}.</p><pre>{covariance}</pre>'


def _alternatives(alternatives: Sequence[Mapping[str, Any]]) -> str:
    if not alternatives:
        return ""
    rows = [
        [
            str(number),
            _percent(other["confidence"]),
            _percent(other["overlap_error"]),
            _numbers(other["camera_from_world"]["quat_xyzw"]),
            _numbers(other["camera_from_world"]["translation_m"]),
        ]
        for number, other in enumerate(alternatives, start=1)
    ]
    heads = ["", "confidence", "overlap error", "quat_xyzw", "translation_m"]
    return "<h2>Other poses that fit</h2>" + _table(heads, rows)


def _exports(exports: Mapping[str, Any]) -> str:
    pose = _numbers(exports["direct_visual_lidar_calibration"]["T_lidar_camera"], 12)
    lidar = f'direct_visual_lidar_calibration, calib.json ([t, qx qy qz qw])\n"T_lidar_camera": [{pose}]'
    text = f"{lidar}\n\nKITTI\n{exports['kitti_Tr_velo_to_cam']}"
    return f"<pre>{escape(text)}</pre>"


def _inputs(result: Mapping[str, Any]) -> str:
    rows = [
        [
            escape(", ".join(entry["roles"])),
            f"<code>{escape(entry['path'])}</code>",
            f"{entry['bytes']:,}",
            f"<code>{entry['sha256']}</code>",
        ]
        for entry in result["inputs"]
    ]
    versions = ", ".join(f"{name} {version}" for name, version in result["versions"].items())
    seconds = ", ".join(f"{name} {value:.2f} s" for name, value in result["seconds"].items())
    solver = ", ".join(f"{name} {value}" for name, value in result["solver"].items())
    solver += f"; {result['evaluations']} evaluations; {result['termination']}"
    words = f"Solver: {solver}. Time: {seconds}. Versions: {versions}."
    return _table(["input", "file", "bytes", "SHA-256"], rows) + f'<p class="soft">{escape(words)}</p>'


def _table(names: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table of cells that are already HTML."""
    head = "".join(f"<th>{name}</th>" for name in names)
    body = "".join(f"<tr>{''.join(f'<td>{cell}</td>' for cell in row)}</tr>" for row in rows)
    return f'<div class="wide"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>'


def _percent(fraction: float | None) -> str:
    return "unknown" if fraction is None else f"{100.0 * fraction:.2f} %"


def _scaled(value: float | None, scale: float) -> float | None:
    return None if value is None else value * scale


def _fixed(value: float | None, digits: int) -> str:
    return "unknown" if value is None else f"{value:.{digits}f}"


def _worst(values: Sequence[float | None], scale: float) -> str:
    known = [value for value in values if value is not None]
    return "unknown" if len(known) < len(values) else f"{scale * max(known):.3g}"


def _numbers(values: Iterable[float], digits: int = 9) -> str:
    return ", ".join(f"{value:.{digits}g}" for value in values)
