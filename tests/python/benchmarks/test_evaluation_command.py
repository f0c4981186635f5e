"""Studies as a command: its files, what it refuses, stopping and going on."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from benchmarks.synthetic.command import main
from benchmarks.synthetic.studies import config, read_rows, run_study

CAMERA = """%YAML:1.0
image_width: 360
image_height: 240
camera_matrix: {rows: 3, cols: 3, data: [288., 0., 179.5, 0., 288., 119.5, 0., 0., 1.]}
distortion_coefficients: {rows: 1, cols: 4, data: [0., 0., 0., 0.]}
"""


def run(capsys: pytest.CaptureFixture[str], *words: str | Path) -> tuple[int, str, str]:
    """Exit code, standard output and standard error of a command line."""
    code = main([str(word) for word in words])
    said = capsys.readouterr()
    return code, said.out, said.err


@pytest.fixture
def quick(tmp_path: Path) -> list[str | Path]:
    """The words of a quick study: small images, two conditions, two scenes each."""
    camera = tmp_path / "small.yaml"
    camera.write_text(CAMERA, encoding="utf-8")
    values: list[str | Path] = ["--planes", "2", "--noise", "0,5", "--side", "2d", "--scenes", "2", "--camera", camera]
    values += ["--only", "squares=None"]
    return ["perspective", *values, "--out", tmp_path / "out" / "rows.csv"]


def test_a_study_writes_rows_table_settings_and_plots(
    quick: list[str | Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out, err = run(capsys, *quick)
    assert code == 0
    names = sorted(path.name for path in (tmp_path / "out").iterdir())
    pictures = ["rows-coverage.png", "rows-solved-by-noise.png", "rows-sorted.png"]
    assert names == [*pictures, "rows.csv", "rows.json", "rows.md"]
    assert out.startswith((tmp_path / "out" / "rows.md").read_text("utf-8")) and "4 of 4 (100 %)" in err
    rows = read_rows(tmp_path / "out" / "rows.csv")
    assert [(row["camera"], row["noise"], row["seed"]) for row in rows.rows] == [
        ("small", noise, seed) for noise in (0.0, 0.05) for seed in (0, 1)
    ]
    settings = json.loads((tmp_path / "out" / "rows.json").read_text("utf-8"))
    assert settings["seeds"] == [0, 2] and "fx=288.0" in settings["setups"]["small"]


def test_finished_files_are_replaced_by_force_alone(
    quick: list[str | Path], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(capsys, *quick, "--no-plots", "--quiet")[0] == 0
    code, _, err = run(capsys, *quick, "--no-plots")
    assert code == 2 and "rows.csv: the file exists" in err
    assert run(capsys, *quick, "--no-plots", "--force", "--quiet")[0] == 0


def test_a_stopped_study_says_so_and_goes_on(
    quick: list[str | Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = run_study

    def stopped(study: Any, scenes: int, **options: Any) -> Any:
        whole(study, scenes, **options)
        raise KeyboardInterrupt

    monkeypatch.setattr(config, "run_study", stopped)
    code, _, err = run(capsys, *quick, "--no-plots")
    partial = tmp_path / "out" / "rows.csv.partial"
    assert code == 130 and str(partial) in err and partial.exists()
    assert not (tmp_path / "out" / "rows.csv").exists()
    monkeypatch.setattr(config, "run_study", whole)
    code, _, err = run(capsys, *quick, "--no-plots", "--scenes", "1")
    assert code == 2 and "other settings" in err
    assert run(capsys, *quick, "--no-plots")[0] == 0
    assert not partial.exists()


def test_force_starts_anew_where_other_settings_stopped(
    quick: list[str | Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    partial = tmp_path / "out" / "rows.csv.partial"
    partial.parent.mkdir()
    partial.write_text('{"settings":{"study":"another"}}\n', encoding="utf-8")
    assert run(capsys, *quick, "--no-plots")[0] == 2
    assert run(capsys, *quick, "--no-plots", "--force", "--quiet")[0] == 0
    assert len(read_rows(tmp_path / "out" / "rows.csv").rows) == 4


def test_solver_options_and_systems_are_columns(
    quick: list[str | Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["--noise", "0", "--scenes", "1", "--solver", "driver=native", "--system", "plane,sphere"]
    assert run(capsys, *quick, *words, "--no-plots", "--quiet")[0] == 0
    rows = read_rows(tmp_path / "out" / "rows.csv").rows
    assert [row["solver"] for row in rows] == ["driver=native system=plane", "driver=native system=sphere"]
    assert not any(row["error"] for row in rows)


def test_one_condition_alone_is_run_and_its_errors_are_bounded(
    quick: list[str | Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["--only", "noise=0.05", "--scenes", "1", "--seed", "1", "--bounds"]
    code, out, _ = run(capsys, *quick, *words, "--no-plots", "--quiet")
    (row,) = read_rows(tmp_path / "out" / "rows.csv").rows
    assert code == 0 and (row["noise"], row["seed"]) == (0.05, 1)
    assert "## Error over bound" in out and float(row["bound_rotation_deg"] or 0.0) > 0.0


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["peers"], ["peers", "perspective, omnidirectional"]),
        (["regions", "--planes", "two"], ["--planes", "'two'", "numbers"]),
        (["regions", "--noise", "much"], ["--noise", "'much'"]),
        (["regions", "--masks", "soft"], ["masks", "'soft'", "binary, coverage"]),
        (["regions", "--solver", "fast"], ["'fast'", "name=value"]),
        (["regions", "--scenes", "0"], ["scenes", "0"]),
        (["trust", "--planes", "2"], ["trust", "planes", "seed"]),
        (["trust", "--only", "lidar"], ["--only", "'lidar'", "NAME=VALUE"]),
        (["trust", "--only", "kind=lidar"], ["'kind'", "model"]),
        (["trust", "--only", "model=radar"], ["trust", "model=radar"]),
        (["regions", "--workers", "0"], ["workers", "0"]),
    ],
)
def test_bad_options_are_one_line(
    words: list[str], said: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, _, err = run(capsys, *words, "--no-plots", "--out", tmp_path / "rows.csv")
    assert code == 2 and err.count("\n") == 1
    assert all(text in err for text in said)


def test_a_range_of_one_number_is_named(quick: list[str | Path], capsys: pytest.CaptureFixture[str]) -> None:
    code, _, err = run(capsys, *quick, "--depth-m", "4")
    assert code == 2 and "--depth-m" in err and "as 4,6" in err
