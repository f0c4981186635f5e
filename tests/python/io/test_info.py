"""`regionpose info` says of any file what kind it is, or what is read."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bag_files import SCANS, filled
from bare_rows import scanned_rows
from cloud_samples import POINTS, written
from PIL import Image
from regionpose.cli import main
from regionpose.cli.info import file_facts
from scene_files import write_scene

SAMPLES = Path(__file__).parents[1] / "samples"
LABELS = np.repeat(np.arange(4, dtype=np.uint8), 30).reshape(10, 12)
PHOTO = np.random.default_rng(0).integers(0, 256, (10, 12, 3), dtype=np.uint8)
XYZ = "".join(f"{x} {y} {z}\n" for x, y, z in POINTS)
LABELME = {
    "imageHeight": 12,
    "imageWidth": 16,
    "shapes": [{"label": "door", "points": [[1, 1], [9, 1], [9, 9]], "shape_type": "polygon"}],
}


def _image(pixels: Any) -> Any:
    return lambda path: Image.fromarray(pixels).save(path, format="PNG")


KINDS: list[tuple[str, Any, dict[str, Any]]] = [
    ("photo.png", _image(PHOTO), {"kind": "image", "width_px": 12}),
    ("photo", _image(PHOTO), {"kind": "image", "format": "PNG"}),
    ("labels.png", _image(LABELS), {"kind": "image of labels", "labels": [0, 1, 2, 3]}),
    ("labelme.json", json.dumps(LABELME), {"kind": "masks", "regions": ["door"]}),
    ("cloud.xyz", XYZ, {"kind": "cloud", "points": 4, "dropped_points": 0}),
    ("zeros.txt", XYZ + "0 0 0\n", {"kind": "cloud", "points": 4, "dropped_points": 1}),
    ("rows.bin", scanned_rows(3000, "intensity", "time").tobytes(), {"kind": "cloud", "points": 3000}),
    ("picked.npy", lambda path: np.save(path, np.arange(7)), {"kind": "indices or labels of points", "highest": 6}),
    ("mask.npy", lambda path: np.save(path, np.arange(7) > 2), {"kind": "mask of points", "values": 7}),
    ("points.npy", lambda path: np.save(path, POINTS), {"kind": "cloud", "points": 4}),
    ("calib.yaml", (SAMPLES / "ros_camera_info.yaml").read_text(), {"kind": "calibration"}),
    ("calib.cfg", (SAMPLES / "ros_camera_info.yaml").read_text(), {"kind": "calibration"}),
    (
        "result.json",
        json.dumps({"format": "regionpose result 2", "diagnostics": {"regions": [{"name": "a"}]}}),
        {"kind": "result"},
    ),
]


@pytest.mark.parametrize(("name", "content", "expected"), KINDS, ids=lambda value: str(value)[:20])
def test_each_kind_is_told(name: str, content: Any, expected: dict[str, Any], tmp_path: Path) -> None:
    path = tmp_path / name
    if callable(content):
        content(path)
    else:
        written(path, content)
    facts = file_facts(path)
    assert {key: facts[key] for key in expected} == expected


def test_a_scene_file_is_told(tmp_path: Path) -> None:
    assert file_facts(write_scene(tmp_path))["kind"] == "scene file"


@pytest.mark.parametrize("kind", ["ros1", "sqlite", "mcap", "mcap file"])
def test_the_topics_of_a_bag_are_listed(kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = filled(kind).write(tmp_path)
    facts = file_facts(path)
    assert facts["kind"] == "bag" and facts["duration_s"] == pytest.approx(0.4, abs=1e-6)
    assert facts["begins_s"] == 1.7e9
    assert [(each["topic"], each["messages"], each["read_as"]) for each in facts["topics"]] == [
        ("/camera", 1, "image"),
        ("/compressed", 1, "image"),
        ("/points", SCANS, "cloud"),
    ]
    assert main(["info", str(path), "--quiet"]) == 0
    assert f"sensor_msgs/msg/PointCloud2, {SCANS} messages, read as cloud" in capsys.readouterr().out


def test_a_damaged_region_spares_the_others_of_its_file(tmp_path: Path) -> None:
    task = {"original_width": 16, "original_height": 12}
    corners = {"points": [[10, 10], [60, 10], [60, 60]], "polygonlabels": ["door"]}
    brush = {"format": "rle", "rle": [0, 75, 0, 0, 11, 0, 0, 128], "brushlabels": ["wall"]}
    results = [{**task, "type": "polygonlabels", "value": corners}, {**task, "type": "brushlabels", "value": brush}]
    path = tmp_path / "tasks.json"
    path.write_text(json.dumps([{"id": 1, "data": {"image": "a.png"}, "annotations": [{"result": results}]}]))
    facts = file_facts(path)
    assert facts["kind"] == "masks" and facts["regions"] == ["door"]
    (damaged,) = facts["damaged"]
    assert damaged.startswith("wall: result 1")


def test_each_reader_says_why_it_refuses_a_file(tmp_path: Path) -> None:
    # A quaternion without a word of its order, as evaluation scripts write it.
    path = tmp_path / "truth.json"
    path.write_text(json.dumps({"extrinsics": {"translation": [0, 0, 1], "rotation": [0.5, 0.5, 0.5, 0.5]}}))
    with pytest.raises(ValueError, match=r"As a calibration: .*As a pose: extrinsics.rotation: .*As masks: "):
        file_facts(path)


@pytest.mark.parametrize(
    ("name", "content"),
    [("notes.txt", "Dear all: hello\n"), ("notes.md", "# x\n"), ("a.exe", bytes(range(256))), ("a.pdf", b"%PDF-1.4")],
)
def test_what_is_not_read_is_said_with_what_is(name: str, content: Any, tmp_path: Path) -> None:
    path = written(tmp_path / name, content)
    with pytest.raises(
        ValueError, match=rf"{name}: found no kind of file that is known; needed a cloud or mesh .* a result"
    ):
        file_facts(path)
