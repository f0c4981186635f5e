"""Rows as a table in Markdown: medians, quartiles, 95 % and solved shares of each condition."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from regionpose.evaluation.measures import Summary, solved_share, summarize
from regionpose.evaluation.studies.conditions import Value
from regionpose.evaluation.studies.rows import NEAREST, Results

SHOWN_ERRORS = 5
"""Different error texts that are listed, the most frequent first."""

QUANTILES = "median (quartiles; 95 %)"

BEST_NOTE = "The pose that the estimate reports."
NEAREST_NOTE = "The nearest of the pose and its alternatives: a symmetric shape fits from several."


def results_table(results: Results, title: str = "") -> str:
    """The rows as Markdown: the pose itself, the nearest answer, and what failed."""
    heading = [f"# {title}", ""] if title else []
    parts = [*heading, *_answer_table(results, "Pose", BEST_NOTE, "")]
    parts += ["", *_answer_table(results, "Nearest answer", NEAREST_NOTE, NEAREST)]
    return "\n".join([*parts, *_failures(results), *_remarks(results)]) + "\n"


def _answer_table(results: Results, name: str, note: str, prefix: str) -> list[str]:
    varying = results.varying()
    heads = [*varying, "scenes", "solved", f"rotation, deg: {QUANTILES}", f"translation, mm: {QUANTILES}"]
    heads += ["overlap error", "ambiguous", f"time, ms: {QUANTILES}"]
    lines = [_line(heads), _line(["---"] * len(heads))]
    for values, group in results.groups(varying):
        shown = [value_text(column, value) for column, value in values.items()]
        lines.append(_line([*shown, *_cells(group, prefix)]))
    return [f"## {name}", "", note, "", *lines]


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
    if name in ("noise", "focal_error") and isinstance(value, float):
        return f"{100.0 * value:g} %"
    if name == "solver" and value == "":
        return "default"
    return f"{value:g}" if isinstance(value, float) else ("-" if value is None else str(value))


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


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
