"""Rows of bare numbers: how many they have is found in the values, or asked for; never a wrong count without a word."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from bare_rows import scanned_rows
from numpy.typing import NDArray
from regionpose.cli import main
from regionpose.io.clouds import CloudError, read_cloud
from regionpose.io.clouds.row_width import FEWEST_VALUES, LEAST_GAIN, row_width
from regionpose.scene.inputs import named_files
from regionpose.scene.loading import load_scene
from regionpose.scene.sensors import scene_cloud
from scene_files import scene_values, write_scene

KINDS: dict[str, tuple[str, ...]] = {
    "coordinates alone": (),
    "KITTI": ("intensity",),
    "no intensity": ("zero",),
    "one intensity": ("one",),
    "nuScenes": ("reflectivity", "ring"),
    "Livox": ("reflectivity", "time"),
    "two unset": ("zero", "zero"),
    "Waymo": ("intensity", "elongation", "stamp"),
    "ring and time": ("intensity", "ring", "time"),
    "colors": ("red", "green", "blue"),
    "normals": ("nx", "ny", "nz"),
    "seven": ("intensity", "red", "green", "blue"),
}


@pytest.mark.parametrize("interleaved", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_the_columns_of_a_scan_are_counted(kind: str, interleaved: bool, tmp_path: Path) -> None:
    rows = scanned_rows(12_000, *KINDS[kind], interleaved=interleaved)
    path = tmp_path / "0000000.bin"
    path.write_bytes(rows.tobytes())
    cloud = read_cloud(path)
    np.testing.assert_array_equal(cloud.points, rows[:, :3].astype(np.float64))
    assert cloud.sensor_origin is not None and cloud.sensor_origin.tolist() == [0.0, 0.0, 0.0]
    if KINDS[kind] and kind not in ("colors", "normals"):
        assert cloud.intensity is not None
        np.testing.assert_array_equal(cloud.intensity, rows[:, 3])
    expected = {"nuScenes": ["ring"], "Livox": ["column_5"], "Waymo": ["column_5", "column_6"]}
    expected |= {"normals": ["normal_x", "normal_y", "normal_z"], "colors": [], "seven": [], "KITTI": []}
    if kind in expected:
        assert list(cloud.fields) == expected[kind]
    assert (cloud.colors is not None) == (kind in ("colors", "seven"))


@pytest.mark.parametrize("kind", KINDS)
def test_the_order_of_the_rows_does_not_matter(kind: str) -> None:
    rows = np.random.default_rng(1).permutation(scanned_rows(12_000, *KINDS[kind]))
    assert row_width(rows.reshape(-1)).width == rows.shape[1]


@pytest.mark.parametrize("kind", KINDS)
def test_no_cut_of_a_scan_gets_a_wrong_count(kind: str) -> None:
    random, rows = np.random.default_rng(2), scanned_rows(12_000, *KINDS[kind], interleaved=True)
    for count in (*range(1, 60), *range(60, 700, 40), 1000, 3000):
        start = random.integers(0, len(rows) - count)
        for cut in (rows[start : start + count], rows[random.permutation(len(rows))[:count]]):
            assert row_width(np.ascontiguousarray(cut).reshape(-1)).width in (None, rows.shape[1]), count


@pytest.mark.parametrize("width", [3, 4, 5, 6, 8])
def test_numbers_that_look_alike_are_not_counted(width: int) -> None:
    numbers = np.random.default_rng(3).uniform(-5.0, 5.0, 1200 * width).astype("<f4")
    found = row_width(numbers)
    assert found.width is None and width in found.fitting


def test_wide_rows_are_asked_for(tmp_path: Path) -> None:
    rows = scanned_rows(12_000, "one", "intensity", "zero", "zero", "zero")
    path = tmp_path / "packed.bin"
    path.write_bytes(rows.tobytes())
    with pytest.raises(CloudError, match=r"columns: found 96000 numbers, .* rows of 3, 4, 5, 6, 8, .* would fit"):
        read_cloud(path)
    cloud = read_cloud(path, columns=("x", "y", "z", "_", "intensity", "_", "_", "_"))
    np.testing.assert_array_equal(cloud.points, rows[:, :3].astype(np.float64))


def test_a_file_cut_short_is_refused(tmp_path: Path) -> None:
    rows: NDArray[np.float32] = scanned_rows(12_001, "reflectivity", "ring").reshape(-1)[:-1]
    assert len(rows) % 4 == 0 and len(rows) % 5
    path = tmp_path / "cut.bin"
    path.write_bytes(rows.tobytes())
    with pytest.raises(CloudError, match="size: found 240016 bytes; needed a multiple of 20: rows of 5 float32"):
        read_cloud(path)


def test_a_name_that_the_values_contradict_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "sweep.pcd.bin"
    path.write_bytes(scanned_rows(12_000, "intensity").tobytes())
    with pytest.raises(CloudError, match=r"columns: found values in rows of 4, and the ending \.pcd\.bin of rows of 5"):
        read_cloud(path)
    assert len(read_cloud(path, columns=("x", "y", "z", "intensity"))) == 12_000


def test_no_returns_do_not_hide_the_count() -> None:
    rows = scanned_rows(12_000, "intensity")
    rows[np.random.default_rng(4).random(12_000) < 0.5] = 0.0
    assert row_width(rows.reshape(-1)).width == 4
    assert row_width(np.zeros(12_000, np.float32)).width is None
    assert row_width(np.full(12_000, np.nan, np.float32)).width is None
    assert row_width(rows[: FEWEST_VALUES // 4 - 1].reshape(-1)).width is None


def test_mutual_information_is_that_of_its_definition() -> None:
    from regionpose.io.clouds.row_width import _information

    # Rows of weights 1/4 and 3/4, of which the first is always 0 and the second 0 or 1 alike: H(row) + H(column) - H.
    found = _information(np.array([[1000, 0], [1500, 1500]]))
    shares = np.array([2, 6]) / 8, np.array([5, 3]) / 8, np.array([2, 3, 3]) / 8
    entropy = [-(share * np.log(share)).sum() for share in shares]
    assert found.nats + 1.0 / 8000.0 == pytest.approx(entropy[0] + entropy[1] - entropy[2], abs=1e-12)
    assert found.spread == pytest.approx(np.sqrt(2.0) / 8000.0)
    assert abs(_information(np.array([[400, 600], [800, 1200]])).nats) < LEAST_GAIN / 100.0


def test_a_scene_and_commands_say_the_columns(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = scanned_rows(40, "reflectivity", "time")
    (tmp_path / "few.bin").write_bytes(rows.tobytes())
    names = ["x", "y", "z", "intensity", "_"]
    scene = write_scene(tmp_path, scene_values() | {"cloud": {"file": "few.bin", "columns": names}})
    cloud = scene_cloud(load_scene(scene))
    assert cloud is not None and len(cloud) == 40 and not cloud.fields
    assert named_files(load_scene(scene))["cloud"] == "few.bin"
    refused = write_scene(tmp_path, scene_values() | {"cloud": "few.bin"}, "other.yaml")
    with pytest.raises(ValueError, match=r"other\.yaml:\d+: cloud: .*cloud: \{file, columns: \[\.\.\.\]\} in a scene"):
        scene_cloud(load_scene(refused))
    words = ["info", str(tmp_path / "few.bin"), "--json", "--quiet"]
    assert main(words) == 2 and "names of the columns" in capsys.readouterr().err
    assert main([*words, "--columns", ",".join(names)]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert (facts["points"], facts["intensity"], facts["fields"]) == (40, True, [])
