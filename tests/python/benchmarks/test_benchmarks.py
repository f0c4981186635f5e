"""The benchmarks load: what they take from the package and from one another is there."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path

import numpy as np
import pytest
import regionpose as rp
from small_study import SMALL

from benchmarks.stages import drawn, stages
from benchmarks.synthetic.studies import Study
from benchmarks.workers import comparable, timed, ways

BENCHMARKS = Path(__file__).resolve().parents[3] / "benchmarks"
OPTIONAL = ("cv2", "poselib")


@pytest.mark.parametrize("path", sorted(BENCHMARKS.glob("[!_]*.py")), ids=lambda path: path.stem)
def test_a_benchmark_says_how_it_is_run(
    path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.syspath_prepend(str(BENCHMARKS.parent))
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    monkeypatch.setattr(sys, "argv", [str(path), "--help"])
    with pytest.raises(SystemExit) as ended:
        try:
            runpy.run_path(str(path), run_name="__main__")
        except ModuleNotFoundError as error:
            if error.name not in OPTIONAL:
                raise
            pytest.skip(f"{path.stem} needs {error.name}: install the extra benchmarks")
    assert ended.value.code == 0 and "usage" in capsys.readouterr().out.lower()


@pytest.mark.parametrize("noise", [0.0, 0.2])
def test_the_stages_end_where_the_estimate_does(noise: float) -> None:
    given = drawn(2, 3, noise)
    seconds, staged = stages(given, "plane")
    images = [rp.ImageRegion.from_mask(mask) for mask in given.masks]
    whole = rp.estimate_pose(given.camera, images, given.worlds, solver=rp.Solver(driver="scipy"))
    assert staged is not None
    np.testing.assert_array_equal(staged.best.translation, whole.pose.translation)
    assert all(second >= 0.0 for second in seconds) and sum(seconds) > 0.0


@pytest.mark.slow
def test_a_study_on_two_processes_has_the_rows_of_one() -> None:
    study = Study("two", "", [{"planes": (2,), "noise": (0.0, 0.05)}], setups=SMALL)
    one, two = (timed(study, 3, way)[0] for way in list(ways(2).values())[:2])
    assert comparable(one) == comparable(two)
    assert one.column("nearest_solved").all()
