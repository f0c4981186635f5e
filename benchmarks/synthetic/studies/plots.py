"""Rows as pictures in the paper's manner: sorted errors, and shares of solved problems.

Lines differ in lightness, dash and marker, so that they can be told apart in print without color.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from benchmarks.synthetic.measures import solved_share, summarize
from benchmarks.synthetic.studies.conditions import Value, solver_options, solver_text
from benchmarks.synthetic.studies.confidence import reliability
from benchmarks.synthetic.studies.coverage import coverage_curve
from benchmarks.synthetic.studies.rows import NEAREST, Results
from benchmarks.synthetic.studies.study import Chart, ChartKind
from benchmarks.synthetic.studies.tables import value_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

PANEL_INCHES = (3.2, 2.5)
"""Width and height of one panel: three stand beside one another on a page."""

DASHES = ("-", "--", "-.", ":", (0, (6, 1, 1, 1, 1, 1)), (0, (1, 1)))
HATCHES = ("", "//", "..", "xx", "--", "oo")
MARKERS = ("o", "s", "^", "D", "v", "x")
LIGHTEST = 0.82
"""Share of the color map that is used: what is lighter vanishes on paper."""

LEGEND_CHARACTERS, HANDLE_CHARACTERS = 13.0, 8
"""Characters of a legend on an inch, and those that the line before a name takes the room of."""

LABELED_DECADES = (1.5, 0.6)
"""Decades of an axis below which some of the values between powers of ten have labels, and below which all have."""

MARKS_ON_A_CURVE = 6
FEWEST_IN_BIN = 20
"""Poses of a confidence below which their share says nothing."""

COST_MARGIN = 0.12
"""Share of a panel beside its points, for their labels."""

MOST_BARS = 8
"""Values of a column up to which solved shares are bars; a line beyond."""

SORTED_COLUMNS = (
    ("rotation_deg", 1.0, "rotation error, deg"),
    ("translation_m", 1000.0, "translation error, mm"),
    ("estimate_s", 1000.0, "time, ms"),
)
"""Column, factor to the unit shown, and label of the sorted curves."""

NAMES = {
    "noise": "segmentation error",
    "planes": "planes",
    "regions_given": "regions",
    "solver": "",
    "templates": "",
    "camera": "",
    "side": "side",
    "grazing_deg": "angle between plane and line of sight, deg",
    "turn_deg": "turn of the plane in itself, deg",
    "lidar_beams": "beams",
    "range_noise_m": "range noise, m",
    "divergence_mrad": "beams' width, mrad",
    "mislabeled": "wrong labels",
    "focal_error": "focal length error",
    "center_error_px": "principal point error, px",
}
"""How columns are called in pictures; by their own name when not here, left out when empty."""


def drawn_charts(results: Results, charts: Sequence[Chart]) -> dict[str, Figure]:
    """The pictures of the charts by a name for each; ImportError without the extra `studies`."""
    figures: dict[str, Figure] = {}
    for chart in charts:
        for name, shown in _pictures(results, chart):
            figures[name] = FIGURES[chart.kind](shown, chart)
    return figures


def check_plots() -> None:
    """ImportError when matplotlib is not there: better known before hours of work."""
    _figure(1, 1)


def _pictures(results: Results, chart: Chart) -> Iterator[tuple[str, Results]]:
    """Name and rows of each picture of a chart: one for each value of the other columns that vary beside its own."""
    shown = results
    if chart.across is not None:
        shown = Results(results.settings, [row for row in results.rows if row[chart.across] is not None])
    if not shown.rows:
        return
    across = f"-by-{chart.across}" if chart.across else ""
    own = [name for name in (chart.lines, chart.panels, chart.across) if name is not None]
    alike = [group.varying() for _, group in shown.groups(own)]
    others = [name for name in shown.varying() if any(name in varying for varying in alike)]
    for values, group in shown.groups(others):
        told = "".join(f"-{name}-{_file_text(value_text(name, value))}" for name, value in values.items())
        yield f"{chart.kind}{across}{told}", group


def _file_text(text: str) -> str:
    """A value's text as a part of a file's name."""
    return "".join(c if c.isalnum() or c in "._" else "-" for c in text.replace(" %", "pc")).strip("-")


def _figure(rows: int, columns: int) -> tuple[Figure, Any]:
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise ImportError("matplotlib is not installed; needed: pip install 'regionpose[studies]'") from error
    size = (PANEL_INCHES[0] * columns + 0.8, PANEL_INCHES[1] * rows + 0.9)
    figure = Figure(figsize=size, dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    return figure, figure.subplots(rows, columns, squeeze=False)


def _panels(results: Results, chart: Chart) -> list[tuple[str, Results]]:
    """Title and rows of each panel."""
    if chart.panels is None:
        return [("", results)]
    return [(_titled(chart.panels, v), results.where(**{chart.panels: v})) for v in results.values(chart.panels)]


def _titled(name: str, value: Value) -> str:
    text, called = value_text(name, value), NAMES.get(name, name)
    if name == "planes":
        return f"{text} plane{'s' if value != 1 else ''}"
    what, _, unit = called.partition(", ")
    return f"{what} {text} {unit}".strip()


def _styles(count: int) -> list[dict[str, Any]]:
    """Line styles of increasing lightness."""
    from matplotlib import colormaps

    colors = colormaps["viridis"](np.linspace(0.0, LIGHTEST, count))
    cycles = zip(colors, itertools.cycle(DASHES), itertools.cycle(MARKERS), strict=False)
    return [{"color": color, "linestyle": dash, "marker": marker, "markersize": 4} for color, dash, marker in cycles]


def _sorted_figure(results: Results, chart: Chart) -> Figure:
    """Sorted errors of the nearest answers and run times, a row of panels each."""
    panels = _panels(results, chart)
    figure, axes = _figure(len(SORTED_COLUMNS), len(panels))
    values = results.values(chart.lines)
    for column, (title, shown) in enumerate(panels):
        axes[0, column].set_title(title)
        for row, (name, factor, label) in enumerate(SORTED_COLUMNS):
            _draw_sorted(axes[row, column], shown, chart.lines, values, name, factor)
            axes[row, 0].set_ylabel(label)
        axes[-1, column].set_xlabel("share of scenes, %")
    for row in axes:
        _share_limits(row)
    _legend(figure, axes[0, 0], chart.lines)
    return figure


def _draw_sorted(panel: Axes, shown: Results, lines: str, values: Sequence[Value], name: str, factor: float) -> None:
    column = name if name == "estimate_s" else f"{NEAREST}{name}"
    for value, style in zip(values, _styles(len(values)), strict=True):
        group = shown.where(**{lines: value})
        if not group.rows:
            continue
        errors = np.sort(factor * group.column(column))
        share = 100.0 * (np.arange(len(errors)) + 0.5) / len(errors)
        every = max(len(errors) // MARKS_ON_A_CURVE, 1)
        panel.plot(share, errors, label=value_text(lines, value), linewidth=1.2, markevery=every, **style)
    _make_logarithmic(panel, "y")
    panel.set_xlim(0.0, 100.0)
    panel.grid(alpha=0.3)


def _make_logarithmic(panel: Axes, *names: Literal["x", "y"]) -> None:
    from matplotlib.ticker import LogFormatter

    for name in names:
        panel.set(**{f"{name}scale": "log"})
        axis = panel.xaxis if name == "x" else panel.yaxis
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter(LogFormatter(minor_thresholds=LABELED_DECADES))


def _share_limits(row: Sequence[Axes]) -> None:
    """One range of errors for all panels of a row, so that they compare."""
    limits = np.array([panel.get_ylim() for panel in row])
    for panel in row:
        panel.set_ylim(limits[:, 0].min(), limits[:, 1].max())


def _legend(figure: Figure, panel: Axes, lines: str) -> None:
    handles, labels = panel.get_legend_handles_labels()
    title = NAMES.get(lines, lines)
    room = int(LEGEND_CHARACTERS * figure.get_figwidth() / (max(map(len, labels)) + HANDLE_CHARACTERS))
    columns = int(np.clip(len(labels), 1, max(room, 1)))
    figure.legend(handles, labels, loc="outside lower center", ncols=columns, title=title or None, fontsize=8)


def _solved_figure(results: Results, chart: Chart) -> Figure:
    """Share of problems whose answers hold the true pose."""
    panels = _panels(results, chart)
    figure, axes = _figure(1, len(panels))
    values = results.values(chart.lines)
    for panel, (title, shown) in zip(axes[0], panels, strict=True):
        panel.set_title(title)
        _draw_solved(panel, shown, chart, values)
        panel.set_ylim(0.0, 105.0)
        panel.set_xlabel(NAMES.get(str(chart.across), str(chart.across)))
        panel.grid(axis="y", alpha=0.3)
    axes[0, 0].set_ylabel("solved, %")
    _legend(figure, axes[0, 0], chart.lines)
    return figure


def _draw_solved(panel: Axes, shown: Results, chart: Chart, values: Sequence[Value]) -> None:
    name = str(chart.across)
    places = shown.values(name)
    bars = len(places) <= MOST_BARS
    for index, (value, style) in enumerate(zip(values, _styles(len(values)), strict=True)):
        group = shown.where(**{chart.lines: value})
        found = dict((row[name], rows) for row, rows in group.groups([name]))
        at = [place for place in places if place in found]
        shares = [100.0 * solved_share(found[place].column(f"{NEAREST}solved")) for place in at]
        label = _titled(chart.lines, value) if chart.lines == "planes" else value_text(chart.lines, value)
        if bars:
            width = 0.8 / len(values)
            offset = (index - 0.5 * (len(values) - 1)) * width
            where = [places.index(place) + offset for place in at]
            filling = {"color": style["color"], "hatch": HATCHES[index % len(HATCHES)]}
            panel.bar(where, shares, width, label=label, edgecolor="black", linewidth=0.5, **filling)
        else:
            panel.plot(at, shares, label=label, linewidth=1.2, **style)  # type: ignore[arg-type]
    if bars:
        panel.set_xticks(range(len(places)), [value_text(name, place) for place in places], fontsize=8)


def _coverage_figure(results: Results, chart: Chart) -> Figure:
    """Share of true poses inside the ellipsoid of each nominal share."""
    return _shares_figure(results, chart, coverage_curve, "nominal share, %", "true poses inside, %")


def _confidence_figure(results: Results, chart: Chart) -> Figure:
    """Share of poses that are not wrong over the confidence stated."""

    def curve(shown: Results) -> tuple[Array, Array]:
        bins = [found for found in reliability(shown) if found.count >= FEWEST_IN_BIN]
        return np.array([found.stated for found in bins]), np.array([found.held for found in bins])

    return _shares_figure(results, chart, curve, "confidence, %", "poses within 5 deg, %")


def _shares_figure(
    results: Results, chart: Chart, curve: Callable[[Results], tuple[Array, Array]], across: str, up: str
) -> Figure:
    """What was observed over what was stated, both shares; on the diagonal where the statement is right."""
    panels = _panels(results, chart)
    figure, axes = _figure(1, len(panels))
    values = results.values(chart.lines)
    for panel, (title, shown) in zip(axes[0], panels, strict=True):
        panel.set_title(title)
        panel.plot([0.0, 100.0], [0.0, 100.0], color="gray", linewidth=0.8)
        for value, style in zip(values, _styles(len(values)), strict=True):
            stated, observed = curve(shown.where(**{chart.lines: value}))
            every = max(len(stated) // MARKS_ON_A_CURVE, 1)
            named = value_text(chart.lines, value)
            panel.plot(100.0 * stated, 100.0 * observed, label=named, linewidth=1.2, markevery=every, **style)
        panel.set_xlim(0.0, 100.0)
        panel.set_ylim(0.0, 100.0)
        panel.set_xlabel(across)
        panel.grid(alpha=0.3)
    axes[0, 0].set_ylabel(up)
    _legend(figure, axes[0, 0], chart.lines)
    return figure


def _cost_figure(results: Results, chart: Chart) -> Figure:
    """Median rotation error of the nearest answers over median time, with quartiles."""
    panels = _panels(results, chart)
    figure, axes = _figure(1, len(panels))
    families = _families(results.values(chart.lines))
    for panel, (title, shown) in zip(axes[0], panels, strict=True):
        panel.set_title(title)
        for (name, members), style in zip(families.items(), _styles(len(families)), strict=True):
            _draw_costs(panel, [(label, shown.where(**{chart.lines: value})) for label, value in members], name, style)
        _make_logarithmic(panel, "x", "y")
        panel.margins(COST_MARGIN)
        panel.set_xlabel("time, ms")
        panel.grid(alpha=0.3)
    axes[0, 0].set_ylabel("rotation error, deg")
    _share_limits(axes[0])
    _legend(figure, axes[0, 0], chart.lines)
    return figure


def _families(values: Sequence[Value]) -> dict[str, list[tuple[str, Value]]]:
    """Solver options without their mesh's size, each with the sizes that are there and the whole options, in order."""
    families: dict[str, list[tuple[str, Value]]] = {}
    for value in values:
        options = solver_options(str(value))
        size = options.pop("mesh_size", None)
        name = value_text("solver", solver_text(options))
        name = name if size is None else f"{name}, by mesh_size"
        families.setdefault(name, []).append(("" if size is None else f"{size:g}", value))
    return families


def _draw_costs(panel: Axes, members: Sequence[tuple[str, Results]], name: str, style: dict[str, Any]) -> None:
    """One line through the points of a family, each with its label."""
    found = [(label, group) for label, group in members if group.rows]
    if not found:
        return
    times = [_quartiles(1000.0 * group.column("estimate_s")) for _, group in found]
    errors = [_quartiles(group.column(f"{NEAREST}rotation_deg")) for _, group in found]
    (left, x, right), (low, y, high) = np.transpose(times), np.transpose(errors)
    spreads = [x - left, right - x], [y - low, high - y]
    panel.errorbar(x, y, spreads[1], spreads[0], label=name, linewidth=1.2, elinewidth=0.6, ecolor="0.6", **style)
    for (label, _), place in zip(found, zip(x, y, strict=True), strict=True):
        panel.annotate(label, place, xytext=(4, 3), textcoords="offset points", fontsize=7)


def _quartiles(values: Array) -> tuple[float, float, float]:
    """Lower quartile, median and upper quartile."""
    summary = summarize(values)
    return summary.lower_quartile, summary.median, summary.upper_quartile


FIGURES: dict[ChartKind, Callable[[Results, Chart], Figure]] = {
    "sorted": _sorted_figure,
    "solved": _solved_figure,
    "coverage": _coverage_figure,
    "confidence": _confidence_figure,
    "cost": _cost_figure,
}
"""What draws each kind of chart."""
