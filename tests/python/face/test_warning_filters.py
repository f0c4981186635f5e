"""Filters of warnings are the process's: the package changes none, so that threads leave them as they are."""

from __future__ import annotations

import re
import threading
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import regionpose as rp
from PIL import Image
from regionpose.io.clouds import CloudError
from regionpose.io.reading import read_array, read_pixels
from regionpose.regions.outline import sparse_sampling_handler

PACKAGE = Path(rp.__file__).parent

SPARSE = np.column_stack([np.random.default_rng(1).uniform(-1.0, 1.0, (60, 2)), np.zeros(60)])


def sparse(number: int) -> object:
    """A region of samples that are too sparse for an outline."""
    inside = SPARSE + np.array([number, 0.0, 0.0])
    return rp.WorldRegion.from_samples(inside, inside + np.array([3.0, 0.0, 0.0]))


def test_no_module_changes_filters() -> None:
    changes = re.compile(r"catch_warnings|simplefilter|filterwarnings|resetwarnings")
    files = [path for path in PACKAGE.glob("**/*.py") if changes.search(path.read_text(encoding="utf-8"))]
    # The command's process is its own.
    assert [path.relative_to(PACKAGE).as_posix() for path in files] == ["cli/app.py"]


def in_threads(work: Callable[[int], object]) -> None:
    """Do something in four threads, twenty times in each."""
    errors: list[BaseException] = []

    def run() -> None:
        try:
            for number in range(20):
                work(number)
        except BaseException as error:
            errors.append(error)

    threads = [threading.Thread(target=run) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not errors


def test_threads_leave_filters_as_they_were(tmp_path: Path) -> None:
    Image.new("L", (4, 4)).save(tmp_path / "a.png")
    np.save(tmp_path / "a.npy", np.zeros(3))
    (tmp_path / "a.xyz").write_text("0 0 1\n1 0 1\n0 1 1\n", encoding="utf-8")
    before = list(warnings.filters)

    def work(number: int) -> None:
        sparse(number)
        read_pixels(tmp_path / "a.png")
        read_array(tmp_path / "a.npy")
        rp.read_cloud(tmp_path / "a.xyz")

    in_threads(work)
    assert list(warnings.filters) == before


def test_a_sparse_outline_is_still_warned_of_after_threads_made_samples() -> None:
    in_threads(sparse)
    with pytest.warns(rp.regions.SparseSamplingWarning):
        rp.WorldRegion.from_points(SPARSE)


def test_who_asks_is_told_in_the_own_thread_alone() -> None:
    told: dict[str, list[str]] = {"first": [], "second": []}
    ready = threading.Barrier(2)

    def work(name: str) -> None:
        with sparse_sampling_handler(told[name].append):
            ready.wait()
            if name == "first":
                rp.WorldRegion.from_points(SPARSE)
            ready.wait()

    threads = [threading.Thread(target=work, args=(name,)) for name in told]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(told["first"]) >= 1 and not told["second"]
    with pytest.warns(rp.regions.SparseSamplingWarning):
        rp.WorldRegion.from_points(SPARSE)


@pytest.mark.filterwarnings("error")
def test_tables_without_rows_are_errors_without_a_warning(tmp_path: Path) -> None:
    header = (
        "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
    )
    pcd = "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA ascii\n"
    for name, text in {
        "empty.ply": header,
        "comment.pcd": f"{pcd}# nothing\n\n",
        "word.ply": f"{header}0 0 1\n1 x 2\n",
        "glued.ply": f"{header}0 0 1\n1 1.5.2 2\n",
        "short.ply": f"{header}0 0 1\n1 2\n",
    }.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
        with pytest.raises(CloudError, match=name):
            rp.read_cloud(tmp_path / name)
