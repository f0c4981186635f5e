"""Whether warnings tell right poses from wrong ones."""

from __future__ import annotations

from dataclasses import dataclass

from benchmarks.synthetic.studies.rows import Results, Row
from benchmarks.synthetic.templates import is_symmetric

RIGHT_DEG, WRONG_DEG = 1.0, 5.0
"""Rotation error of the pose below which it is right, and from which on it is wrong."""

MOST_SIGMAS = 3.0
"""Errors over their standard deviations up to which these can be used: of a trusted pose 99 of 100 are to be."""

AMBIGUOUS_CODES = {"ambiguous-pose", "ambiguous-region"}
REGION_CODES = {"outlier-region", "poor-overlap"}
"""Codes of warnings that may have a cause in the problem itself: symmetric shapes, and regions that are wrong."""

PRECISION_CODES = {"weak-geometry"}
"""Codes that say no more than that the standard deviations exceed a limit."""


@dataclass(frozen=True)
class Verdicts:
    """How many poses are right, between and wrong, and warned of; all of the pose itself, not of the nearest answer.

    `false_alarms`: right ones with a warning that there was no cause for. `between_silent`, `wrong_silent`: those
    without any warning. `unanswered`: an error in place of a pose. `named_right`, `named_wrong`:
    where the wrong region alone was named, and where another one was. `trusted`: those without any warning;
    `trusted_beyond`: of these, those whose errors exceed `MOST_SIGMAS` of their standard deviations.
    """

    scenes: int
    right: int
    right_warned: int
    false_alarms: int
    between: int
    between_silent: int
    wrong: int
    wrong_silent: int
    unanswered: int
    named_right: int
    named_wrong: int
    trusted: int
    trusted_beyond: int

    @classmethod
    def of(cls, results: Results) -> Verdicts:
        """The counts of the rows."""
        answered = [row for row in results.rows if not row["error"]]
        right = [row for row in answered if _rotation(row) < RIGHT_DEG]
        between = [row for row in answered if RIGHT_DEG <= _rotation(row) < WRONG_DEG]
        return cls(
            scenes=len(results.rows),
            right=len(right),
            right_warned=sum(bool(row["warnings"]) for row in right),
            false_alarms=sum(is_false_alarm(row) for row in right),
            between=len(between),
            between_silent=sum(not row["warnings"] for row in between),
            wrong=len(answered) - len(right) - len(between),
            wrong_silent=len(silent_rows(results)),
            unanswered=len(results.rows) - len(answered),
            named_right=sum(row["outlier_named"] == "right" for row in answered),
            named_wrong=sum(row["outlier_named"] == "wrong" for row in answered),
            trusted=sum(not row["warnings"] for row in answered),
            trusted_beyond=sum(
                not (row["warnings"] or float(row["error_sigmas"] or 0.0) <= MOST_SIGMAS) for row in answered
            ),
        )


def silent_rows(results: Results) -> list[Row]:
    """The rows of wrong poses without a warning."""
    return [r for r in results.rows if not r["error"] and not r["warnings"] and not _rotation(r) < WRONG_DEG]


def untold_rows(results: Results) -> list[Row]:
    """The rows of poses that are not wrong, with a wrong region that no warning names."""
    return [r for r in results.rows if not r["error"] and r["regions_untold"] and _rotation(r) < WRONG_DEG]


def is_false_alarm(row: Row) -> bool:
    """Whether a right pose has a warning without cause.

    Right regions that are all symmetric fit from several poses, and so may regions of which one is wrong. Wrong
    regions are to be named, but no other.
    """
    codes, names = (set(str(row[column]).split(";")) - {""} for column in ("warnings", "templates_right"))
    codes -= PRECISION_CODES
    if row["regions_wrong"] or all(is_symmetric(name) for name in names):
        codes -= AMBIGUOUS_CODES
    if row["regions_wrong"] and not row["regions_accused"]:
        codes -= REGION_CODES
    return bool(codes)


def _rotation(row: Row) -> float:
    return float(row["rotation_deg"] or 0.0)
