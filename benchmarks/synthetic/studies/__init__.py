"""Studies: grids of conditions run over many scenes, on one machine or many, to rows, tables and plots.

`run_study(study_named("perspective"), 100)` gives the rows; docs/evaluation.md says what they hold and how to declare a
study of one's own.
"""

from __future__ import annotations

from benchmarks.synthetic.studies.catalog import STUDIES, study_named
from benchmarks.synthetic.studies.conditions import Condition
from benchmarks.synthetic.studies.config import StudyConfig
from benchmarks.synthetic.studies.dispatch import dask_executor
from benchmarks.synthetic.studies.problems import StudyProblem, draw_problem
from benchmarks.synthetic.studies.rows import Results
from benchmarks.synthetic.studies.runner import run_study
from benchmarks.synthetic.studies.storage import read_rows, write_rows
from benchmarks.synthetic.studies.study import Chart, Study
from benchmarks.synthetic.studies.tables import results_table

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
