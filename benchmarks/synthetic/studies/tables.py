"""Rows as a table in Markdown: medians, quartiles, 95 % and solved shares of each condition."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np

from benchmarks.synthetic.measures import Summary, solved_share, summarize
from benchmarks.synthetic.studies.conditions import Value
from benchmarks.synthetic.studies.confidence import ranking, reliability
from benchmarks.synthetic.studies.coverage import LEVELS, bound_ratios, coverage
from benchmarks.synthetic.studies.rows import NEAREST, Results
from benchmarks.synthetic.studies.trust import RIGHT_DEG, WRONG_DEG, Verdicts, silent_rows, untold_rows

SHOWN_ERRORS = 5
"""Different error texts that are listed, the most frequent first."""

SHOWN_SILENT = 50
"""Silently wrong problems that are listed; the rows hold them all."""

QUANTILES = "median (quartiles; 95 %)"

BEST_NOTE = "The pose that the estimate reports."
NEAREST_NOTE = "The nearest of the pose and its alternatives: a symmetric shape fits from several."


def results_table(results: Results, title: str = "") -> str:
    """The rows as Markdown: the pose itself, the nearest answer, verdict, coverage, and what failed."""
    heading = [f"# {title}", ""] if title else []
    parts = [*heading, *_answer_table(results, "Pose", BEST_NOTE, "")]
    parts += ["", *_answer_table(results, "Nearest answer", NEAREST_NOTE, NEAREST)]
    parts += ["", *_verdict_table(results), *_mistakes_table(results), "", *_confidence_table(results)]
    parts += ["", *_coverage_table(results), *_bound_table(results)]
    return "\n".join([*parts, *_silent(results), *_failures(results), *_remarks(results)]) + "\n"


def _answer_table(results: Results, name: str, note: str, prefix: str) -> list[str]:
    heads = ["scenes", "solved", f"rotation, deg: {QUANTILES}", f"translation, mm: {QUANTILES}"]
    heads += ["overlap error", "ambiguous", f"time, ms: {QUANTILES}"]
    return [f"## {name}", "", note, "", *_table(results, heads, lambda group: _cells(group, prefix))]


def _cells(group: Results, prefix: str) -> list[str]:
    overlap = summarize(group.column(f"{prefix}overlap_error"))
    return [
        str(len(group.rows)),
        f"{100.0 * solved_share(group.column(f'{prefix}solved')):.1f} %",
        _quantiles(summarize(group.column(f"{prefix}rotation_deg"))),
        _quantiles(summarize(1000.0 * group.column(f"{prefix}translation_m"))),
        f"{100.0 * overlap.median:.2f} %",
        f"{100.0 * solved_share(group.column('ambiguous')):.1f} %",
        _quantiles(summarize(1000.0 * group.column("estimate_s"))),
    ]


def _quantiles(summary: Summary) -> str:
    middle = f"{_number(summary.lower_quartile)} to {_number(summary.upper_quartile)}"
    return f"{_number(summary.median)} ({middle}; {_number(summary.percentile_95)})"


def _number(value: float) -> str:
    """Three digits that count; `inf` where no pose was found."""
    return f"{value:#.3g}".rstrip(".") if value < 1000.0 else f"{value:.0f}"


def value_text(name: str, value: Value) -> str:
    """The value of a condition as people read it: shares in per cent, no solver options as the default."""
    if name in ("noise", "focal_error", "mislabeled") and isinstance(value, float):
        return f"{100.0 * value:g} %"
    if name == "solver" and value == "":
        return "default"
    return f"{value:g}" if isinstance(value, float) else ("-" if value is None else str(value))


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


VERDICT_NOTE = (
    f"The pose itself: right within {RIGHT_DEG:g} deg, wrong beyond {WRONG_DEG:g} deg; silent, or trusted, without any"
    " warning. Beyond 3 sigmas: trusted poses whose rotation or camera center is off by more than that."
    " False alarms are of right poses; a limit of the standard deviations is none, ambiguity is none where all shapes"
    " are symmetric or a region is wrong, nor a wrong region's name."
)
VERDICT_HEADS = [
    "scenes",
    "right",
    "right, warned",
    "false alarms",
    "between",
    "between, silent",
    "wrong",
    "wrong, silent",
    "trusted",
    "beyond 3 sigmas",
]


def _verdict_table(results: Results) -> list[str]:
    """Right, between and wrong poses, warned of or not; with wrong regions also which of them were named."""
    varying = results.varying()
    outliers = any(value != "none" for value in results.values("wrong"))
    heads = [*VERDICT_HEADS, "no answer", *(["named right", "named wrong"] if outliers else [])]
    lines = _table(results, heads, lambda group: _verdict_cells(group, outliers))
    if varying:
        lines.append(_line(["all", *[""] * (len(varying) - 1), *_verdict_cells(results, outliers)]))
    return ["## Verdict", "", VERDICT_NOTE, "", *lines]


def _verdict_cells(group: Results, outliers: bool) -> list[str]:
    found = Verdicts.of(group)
    counts = [found.scenes, found.right, found.right_warned, found.false_alarms]
    counts += [found.between, found.between_silent, found.wrong, found.wrong_silent]
    counts += [found.trusted, found.trusted_beyond, found.unanswered]
    return [str(count) for count in [*counts, *([found.named_right, found.named_wrong] if outliers else [])]]


MISTAKES_NOTE = (
    f"Per thousand problems: poses wrong beyond {WRONG_DEG:g} deg, those without any warning, those that are not"
    " wrong while no warning names a wrong region, and right poses. False alarms per thousand right poses."
)


def _mistakes_table(results: Results) -> list[str]:
    """Silent poses and untold regions by mistake, where there are several."""
    if len(results.values("mistake")) < 2:
        return []
    heads = ["mistake", "problems", "wrong", "silent", "untold", "right", "false alarms"]
    lines = [_line(heads), _line(["---"] * len(heads))]
    for values, group in results.groups(["mistake"]):
        found, count = Verdicts.of(group), len(group.rows)
        rates = [(found.wrong, count), (found.wrong_silent, count), (len(untold_rows(group)), count)]
        rates += [(found.right, count), (found.false_alarms, found.right)]
        shown = [f"{1000.0 * part / max(whole, 1):.1f}" for part, whole in rates]
        lines.append(_line([str(values["mistake"]), str(count), *shown]))
    return ["", "## Mistakes", "", MISTAKES_NOTE, "", *lines]


CONFIDENCE_NOTE = (
    f"All poses by their confidence, which states the probability of an error below {WRONG_DEG:g} deg; poses that fit"
    " alike share it."
)

RANKING_NOTE = (
    f"Of pairs of a pose within {WRONG_DEG:g} deg and one beyond, the former has the greater confidence in"
    " {found:.1f} % (area under the ROC curve); in {expected:.1f} % if each were right as often as it says."
)


def _confidence_table(results: Results) -> list[str]:
    heads = ["confidence", "scenes", "mean", f"within {WRONG_DEG:g} deg", f"within {RIGHT_DEG:g} deg"]
    lines = [_line(heads), _line(["---"] * len(heads))]
    for found in reliability(results):
        shares = [f"{100.0 * share:.1f} %" for share in (found.stated, found.held, found.right)]
        bounds = f"{100.0 * found.least:g} to {100.0 * found.most:g} %"
        lines.append(_line([bounds, str(found.count), *shares]))
    ranked = ranking(results)
    if ranked is not None:
        lines += ["", RANKING_NOTE.format(found=100.0 * ranked.found, expected=100.0 * ranked.expected)]
    return ["## Confidence", "", CONFIDENCE_NOTE, "", *lines]


COVERAGE_NOTE = (
    "True poses inside the ellipsoids of the estimate's covariance, of poses that are solved and the nearest answer."
    " Median ratio: of the squared Mahalanobis distance over chi-squared's; rotation: of error over its deviation."
)


def _coverage_table(results: Results) -> list[str]:
    heads = ["solved", *(f"in {100.0 * level:g} %" for level in LEVELS), "median ratio", "rotation, rms ratio"]
    return ["## Coverage", "", COVERAGE_NOTE, "", *_table(results, heads, _coverage_cells)]


def _coverage_cells(group: Results) -> list[str]:
    found = coverage(group)
    if found.count == 0:
        return ["0", *["-"] * (len(LEVELS) + 2)]
    shares = [f"{100.0 * share:.1f} %" for share in found.inside]
    return [str(found.count), *shares, _number(found.median_ratio), _number(found.rotation_ratio)]


BOUND_NOTE = (
    "Error of the nearest answer over its bound, of those that are solved: root of the mean square, and median. An"
    " estimate that reaches the bound has a root of the mean square of 1."
)


def _bound_table(results: Results) -> list[str]:
    """Errors over their bounds, where the rows hold them."""
    if not any(float(row["bound_rotation_deg"] or 0.0) > 0.0 for row in results.rows):
        return []
    heads = ["solved", "rotation: rms", "median", "translation: rms", "median"]
    return ["", "## Error over bound", "", BOUND_NOTE, "", *_table(results, heads, _bound_cells)]


def _bound_cells(group: Results) -> list[str]:
    ratios = [bound_ratios(group, name) for name in ("rotation_deg", "translation_m")]
    if len(ratios[0]) == 0:
        return ["0", *["-"] * 4]
    shown = [_number(value) for ratio in ratios for value in (np.sqrt(np.mean(ratio**2)), np.median(ratio))]
    return [str(len(ratios[0])), *shown]


def _table(results: Results, heads: Sequence[str], cells: Callable[[Results], list[str]]) -> list[str]:
    """A row of cells for each group of the columns that vary."""
    varying = results.varying()
    lines = [_line([*varying, *heads]), _line(["---"] * (len(varying) + len(heads)))]
    for values, group in results.groups(varying):
        shown = [value_text(column, value) for column, value in values.items()]
        lines.append(_line([*shown, *cells(group)]))
    return lines


def _silent(results: Results) -> list[str]:
    """What is wrong without a warning, and how to see it again."""
    rows = silent_rows(results)
    if not rows:
        return []
    study = results.settings.get("study", "NAME")
    lines = []
    for row in rows[:SHOWN_SILENT]:
        chosen = " ".join(f"--only '{name}={row[name]}'" for name in results.varying())
        command = f"python -m benchmarks {study} --seed {row['seed']} --scenes 1 {chosen}".rstrip()
        lines.append(f"- {row['rotation_deg']:.1f} deg, {row['templates_drawn']}: `{command}`")
    left = len(rows) - len(lines)
    more = [f"- and {left} others; the rows hold them all"] if left > 0 else []
    return [
        "",
        "## Silently wrong",
        "",
        f"{len(rows)} of {len(results.rows)} problems; with the options of this run:",
        "",
        *lines,
        *more,
    ]


def _failures(results: Results) -> list[str]:
    errors = Counter(str(row["error"]) for row in results.rows if row["error"])
    if not errors:
        return []
    shown = [f"- {count} x {text}" for text, count in errors.most_common(SHOWN_ERRORS)]
    left = len(errors) - len(shown)
    more = [f"- and {left} other texts; the rows hold them all"] if left > 0 else []
    return ["", "## Without an answer", "", f"{errors.total()} of {len(results.rows)} problems.", "", *shown, *more]


def _remarks(results: Results) -> list[str]:
    seeds, versions = results.settings.get("seeds"), results.settings.get("versions", {})
    if not seeds:
        return []
    made = ", ".join(f"{name} {number}" for name, number in versions.items())
    return ["", f"Seeds {seeds[0]} to {seeds[1] - 1} of each condition; {made}."]
