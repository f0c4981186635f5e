"""Runs of a study: several processes, lost workers, stopping and going on."""

from __future__ import annotations

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest
from small_study import FISHEYE, QUICK, comparable

from benchmarks.synthetic import setups
from benchmarks.synthetic.studies import (
    Condition,
    Results,
    Study,
    StudyProblem,
    dask_executor,
    draw_problem,
    run_study,
)
from benchmarks.synthetic.studies.dispatch import Dispatcher
from benchmarks.synthetic.studies.storage import Journal, OtherSettingsError

pytestmark = pytest.mark.slow

CALLS = "REGIONPOSE_TEST_CALLS"
"""Environment variable with the folder in which problems of the tests leave a file each time they are made."""


def counted_problem(setup: setups.Setup, condition: Condition, seed: int) -> StudyProblem:
    """The problem; its call is recorded."""
    folder = Path(os.environ[CALLS])
    (folder / f"{condition.noise}-{seed}-{len(list(folder.glob(f'{condition.noise}-{seed}-*')))}").touch()
    return draw_problem(setup, condition, seed)


def killing_once(setup: setups.Setup, condition: Condition, seed: int) -> StudyProblem:
    """The problem; the first time that seed 3 of the noisy condition is asked for, the process ends."""
    mark = Path(os.environ[CALLS]) / "killed"
    if seed == 3 and condition.noise > 0.0 and not mark.exists():
        mark.touch()
        os._exit(1)
    return draw_problem(setup, condition, seed)


def killing_always(setup: setups.Setup, condition: Condition, seed: int) -> StudyProblem:
    """The problem; the process ends whenever seed 3 of the noisy condition is asked for."""
    if seed == 3 and condition.noise > 0.0:
        os._exit(1)
    return draw_problem(setup, condition, seed)


def interrupted(setup: setups.Setup, condition: Condition, seed: int) -> StudyProblem:
    """Ctrl-C at seed 9, once."""
    mark = Path(os.environ[CALLS]) / "interrupted"
    if seed == 9 and not mark.exists():
        mark.touch()
        raise KeyboardInterrupt
    return counted_problem(setup, condition, seed)


@pytest.fixture
def calls(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of recorded calls."""
    folder = tmp_path / "calls"
    folder.mkdir()
    monkeypatch.setenv(CALLS, str(folder))
    return folder


@pytest.fixture(scope="module")
def quick_rows() -> Results:
    """12 problems of each condition, by this process."""
    return run_study(QUICK, 12)


def test_rows_do_not_depend_on_the_number_of_workers(quick_rows: Results) -> None:
    assert comparable(run_study(QUICK, 12, workers=2).rows) == comparable(quick_rows.rows)


def test_rows_do_not_depend_on_the_executor(quick_rows: Results) -> None:
    with ThreadPoolExecutor(2) as executor:
        assert comparable(run_study(QUICK, 12, executor=executor).rows) == comparable(quick_rows.rows)


def test_rows_do_not_depend_on_a_dask_cluster(quick_rows: Results) -> None:
    distributed = pytest.importorskip("distributed", reason="the extra `studies` is not installed")
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        dask_executor(cluster.scheduler_address) as executor,
    ):
        assert comparable(run_study(QUICK, 12, executor=executor).rows) == comparable(quick_rows.rows)


def test_one_problem_can_be_run_alone(quick_rows: Results) -> None:
    alone = run_study(replace(QUICK, grids=[{"planes": (2,), "noise": (0.05,)}]), 1, seed=7)
    assert comparable(alone.rows) == comparable(quick_rows.where(noise=0.05, seed=7).rows)


def test_a_lost_worker_costs_nothing_but_time(quick_rows: Results, calls: Path) -> None:
    rows = run_study(replace(QUICK, problem=killing_once), 12, workers=2)
    assert (calls / "killed").exists()
    assert comparable(rows.rows) == comparable(quick_rows.rows)


def test_a_problem_that_ends_its_worker_each_time_is_given_up(quick_rows: Results) -> None:
    rows = run_study(replace(QUICK, problem=killing_always), 12, workers=2)
    lost = [(row["noise"], row["seed"]) for row in rows.rows if row["error"]]
    assert lost == [(0.05, seed) for seed in range(8)], "its chunk and no other"
    assert "the worker ended 3 times" in str(rows.where(noise=0.05, seed=3).rows[0]["error"])
    kept = [row for row in quick_rows.rows if (row["noise"], row["seed"]) not in lost]
    assert comparable(row for row in rows.rows if not row["error"]) == comparable(kept)


def test_a_stopped_study_goes_on_where_it_stopped(quick_rows: Results, calls: Path, tmp_path: Path) -> None:
    study, journal = replace(QUICK, problem=interrupted), tmp_path / "rows.partial"
    with pytest.raises(KeyboardInterrupt):
        run_study(study, 12, journal=journal)
    # A line that was cut off by a crash counts as not written.
    text = journal.read_text(encoding="utf-8")
    journal.write_text(text[:-20], encoding="utf-8")
    told: list[tuple[int, int]] = []
    rows = run_study(study, 12, journal=journal, progress=lambda done, total: told.append((done, total)))
    assert comparable(rows.rows) == comparable(quick_rows.rows)
    assert told[-1] == (24, 24)
    repeated = sorted(file.name for file in calls.glob("*-1"))
    assert repeated == ["0.0-8-1", "0.05-7-1"], "the interrupted chunk's and the cut line's"


@pytest.mark.parametrize(
    ("study", "scenes", "word"),
    [
        (QUICK.with_values({"noise": (0.1,)}), 2, "grids"),
        (QUICK, 3, "seeds [0, 2]; needed [0, 3]"),
        (replace(QUICK, setups={"perspective": FISHEYE}), 2, "setups"),
    ],
)
def test_going_on_with_other_settings_is_refused(study: Study, scenes: int, word: str, tmp_path: Path) -> None:
    journal = tmp_path / "rows.partial"
    run_study(QUICK, 2, journal=journal)
    before = journal.read_bytes()
    with pytest.raises(OtherSettingsError) as error:
        run_study(study, scenes, journal=journal)
    assert word in str(error.value) and "other settings" in str(error.value)
    assert journal.read_bytes() == before


def test_a_file_that_is_no_journal_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "rows.partial"
    path.write_text("rotation,translation\n", encoding="utf-8")
    with pytest.raises(ValueError, match="line 1 is not JSON"):
        Journal(path, {})


def test_a_script_that_its_workers_would_run_again_is_told_so(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(
        "from benchmarks.synthetic.studies import run_study, study_named\n"
        "run_study(study_named('regions'), 1, workers=2)\n",
        encoding="utf-8",
    )
    paths = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, str(script)]
    ended = subprocess.run(command, env=paths, capture_output=True, text=True, timeout=60, check=False)
    assert ended.returncode == 1
    assert 'needs `if __name__ == "__main__":`' in ended.stderr


def refused(task: int) -> int:
    """ValueError for task 2."""
    if task == 2:
        raise ValueError("task 2 is refused")
    return 10 * task


def test_an_error_of_the_work_itself_is_raised() -> None:
    with ThreadPoolExecutor(1) as executor, pytest.raises(ValueError, match="task 2 is refused"):
        list(Dispatcher(executor, refused).results([1, 2, 3]))
    with ThreadPoolExecutor(1) as executor:
        assert sorted(Dispatcher(executor, refused, most_running=1).results([1, 3, 4])) == [(1, 10), (3, 30), (4, 40)]
