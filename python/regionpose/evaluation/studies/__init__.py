"""Studies: grids of conditions run over many scenes, on one machine or many, to rows, tables and plots.

`run_study(study_named("perspective"), 100)` gives the rows; docs/evaluation.md says what they hold and how to declare a
study of one's own.
"""

from __future__ import annotations

from regionpose.evaluation.studies.catalog import STUDIES, study_named
from regionpose.evaluation.studies.conditions import Condition
from regionpose.evaluation.studies.config import StudyConfig
from regionpose.evaluation.studies.dispatch import dask_executor
from regionpose.evaluation.studies.problems import StudyProblem, draw_problem
from regionpose.evaluation.studies.rows import Results
from regionpose.evaluation.studies.runner import run_study
from regionpose.evaluation.studies.storage import read_rows, write_rows
from regionpose.evaluation.studies.study import Chart, Study
from regionpose.evaluation.studies.tables import results_table

__all__ = [
    "STUDIES",
    "Chart",
    "Condition",
    "Results",
    "Study",
    "StudyConfig",
    "StudyProblem",
    "dask_executor",
    "draw_problem",
    "read_rows",
    "results_table",
    "run_study",
    "study_named",
    "write_rows",
]
