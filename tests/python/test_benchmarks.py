"""The benchmarks load: what they take from the package and from one another is there."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks"
OPTIONAL = ("cv2", "poselib")


@pytest.mark.parametrize("path", sorted(BENCHMARKS.glob("*.py")), ids=lambda path: path.stem)
def test_a_benchmark_says_how_it_is_run(path: Path) -> None:
    paths = os.pathsep.join([str(BENCHMARKS), str(BENCHMARKS.parent)])
    ended = subprocess.run(
        [sys.executable, str(path), "--help"],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": paths},
    )
    for name in OPTIONAL:
        if f"No module named '{name}'" in ended.stderr:
            pytest.skip(f"{path.stem} needs {name}: install the extra benchmarks")
    assert ended.returncode == 0, ended.stderr
