"""Texts that somebody typed and got wrong: each message says file, place, what was found and what is needed."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from regionpose.io.calibrations import load_camera
from regionpose.io.calibrations.poses import read_pose
from regionpose.io.clouds import read_cloud
from regionpose.io.json_text import joined_pairs, json_value
from regionpose.io.masks.readers import masks_from_file
from regionpose.io.text_error import TextError
from regionpose.scene.loading import load_scene
from scene_files import scene_values

SAMPLES = Path(__file__).parents[1] / "samples"
OPENCV = (SAMPLES / "opencv.yml").read_text(encoding="utf-8")
KALIBR = (SAMPLES / "kalibr_camchain.yaml").read_text(encoding="utf-8")

CAMERA = """{
  "camera_matrix": [[610, 0, 320], [0, 610, 240], [0, 0, 1]],
  "dist_coeffs": [0.1, 0, 0, 0, 0]
}
"""
LABELME = """{
  "imageHeight": 8, "imageWidth": 8,
  "shapes": [{"label": "a", "points": [[1, 1], [5, 1], [5, 5]]}]
}
"""
SCENE = """camera: camera.yaml
image: image.png
regions:
  - name: door
    image: {seed: [1, 2]}
"""
JSON_VALUE = "needed a value: a number, a text in double quotes"
JSON_COMMA = "needed a comma, or the bracket that closes"

Reader = Callable[[Path], object]


def cut(text: str, mark: str) -> str:
    """A text up to a mark."""
    return text[: text.index(mark)]


CASES: list[tuple[str, str, Reader, str]] = [
    # Calibrations in JSON
    ("a.json", cut(CAMERA, "0.1"), load_camera, f"a.json: line 3, column 19: found the end of the text; {JSON_VALUE}"),
    ("b.txt", cut(CAMERA, '"dist'), load_camera, "b.txt: line 3, column 3: found the end of the text; needed a name"),
    ("c.json", CAMERA.replace("610, 0", "610, , 0"), load_camera, "c.json: line 2, column 27: found ','; needed a val"),
    ("d.json", CAMERA.replace('s":', 's"'), load_camera, "d.json: line 3, column 17: found '['; needed a colon"),
    ("e.json", CAMERA.replace('"camera', "camera"), load_camera, "e.json: line 2, column 3: found 'camera_matrix'"),
    ("f.json", CAMERA.replace("610, 0", "610 0"), load_camera, "f.json: line 2: camera_matrix[0][0]: found '610 0'"),
    ("g.json", CAMERA.replace("1]],", "1]]"), load_camera, f"g.json: line 3, column 3: found '\"'; {JSON_COMMA}"),
    ("h.json", CAMERA + "}", load_camera, "h.json: line 5, column 1: found '}'; needed nothing after the end"),
    ("i.json", "[1, 2]", load_camera, "i.json: found text that starts with '[1, 2]'; needed one of these: COLMAP"),
    # In YAML
    ("j.yml", cut(OPENCV, "4.795e+02"), load_camera, "j.yml: line 13, column 1: found the end of the text; need"),
    ("k.yml", OPENCV.replace("camera_matrix", "matrix"), load_camera, "k.yml: found the items calibration_time, im"),
    ("l.yaml", KALIBR.replace("resolution:", "resolution"), lambda path: load_camera(path, "cam0"),
     "l.yaml: line 7, column 3: found 'resolution'; needed a colon and a space after the key"),
    ("m.yaml", KALIBR.replace("  intrinsics", "\tintrinsics"), lambda path: load_camera(path, "cam0"),
     "m.yaml: line 6, column 1: found '\\t'; needed spaces in place of tabs"),
    ("n.yaml", KALIBR.replace("  intrinsics", "   intrinsics"), lambda path: load_camera(path, "cam0"),
     "found ':'; needed one key a line, at the indentation of those beside it"),
    ("o.yml", "a: 1\nb: \x01\n", load_camera, "o.yml: line 2, column 4: found the control character U+0001; needed"),
    ("o.yml", "é: ü\nö: \x01\n", load_camera, "o.yml: line 2, column 4: found the control character U+0001; needed"),
    ("p.yml", "a: 'x\nb: 1\n", load_camera, "p.yml: line 1, column 4: found \"'\"; needed a quote where the text ends"),
    ("q.yml", 'a: "C:\\data"\n', load_camera, "q.yml: line 1, column 7: found '\\\\'; needed a backslash written"),
    # Poses
    ("r.json", '{"T_lidar_camera": [1, 2', read_pose, "r.json: line 1, column 25: found the end of the text; needed"),
    ("s.txt", "1 0 0 0\n0 1 0 x\n0 0 1 0\n", read_pose, "s.txt: line 2: matrix: found 'x'; needed a number"),
    ("t.txt", "1 0 0 0\n0 1 0 0\n", read_pose, "t.txt: found 8 values of type float64; needed result.json, a 3 x 4"),
    ("u.txt", "", read_pose, "u.txt: found an empty file; needed a pose"),
    # Masks
    ("v.json", cut(LABELME, '"points"'), masks_from_file, "v.json: line 3, column 29: found the end of the text; n"),
    ("w.json", LABELME.replace("8,\n", "8\n"), masks_from_file, f"w.json: line 3, column 3: found '\"'; {JSON_COMMA}"),
    ("x.json", LABELME.replace('"a"', "'a'"), masks_from_file, f'x.json: line 3, column 24: found "\'"; {JSON_VALUE}'),
    ("y.json", "\n", masks_from_file, "y.json: found an empty file; needed JSON"),
    # Scenes
    ("z.yaml", SCENE.replace("[1, 2]}", "[1, 2"), load_scene, "z.yaml:6:1: found the end of the text; needed a comma"),
    ("aa.yaml", SCENE.replace("  - name", " name"), load_scene, "aa.yaml:5:10: found ':'; needed one key a line"),
    ("ag.yaml", SCENE.replace("door", "2020-13-45"), load_scene, "ag.yaml:4:11: found '2020-13-45', which is no time"),
    ("ab.json", '{"camera": "a",\n "image" "b"}', load_scene, "ab.json:2:10: found '\"'; needed a colon after the"),
    ("ac.json", '{"camera": "a\n"}', load_scene, "ac.json:1:14: found the end of the line; needed a double quote"),
    ("ad.json", '{"camera": "C:\\data"}', load_scene, "ad.json:1:15: found '\\\\'; needed an escape of JSON's"),
    # Clouds
    ("ae.xyz", "x y z\n1 2 3\n\n# a\n4 5\n", read_cloud, "ae.xyz: line 5: found 2 numbers after rows of 3; needed"),
    ("af.csv", "1,2,3\n4,five,6\n", read_cloud, "af.csv: line 2: found 'five'; needed the same count of numbers"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "text", "read", "said"), CASES, ids=[case[0] for case in CASES])
def test_a_broken_text_is_told_by_file_place_found_and_needed(
    name: str, text: str, read: Reader, said: str, tmp_path: Path
) -> None:
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=name) as caught:
        read(path)
    assert said in str(caught.value)
    assert "found " in str(caught.value) and "; needed " in str(caught.value)


def test_a_number_without_decimals_as_opencv_writes_it_is_no_error(tmp_path: Path) -> None:
    path = tmp_path / "camera.json"
    path.write_text(CAMERA.replace("610, 0", "610., 0."), encoding="utf-8")
    assert load_camera(path).width is None


def test_a_scene_may_name_a_region_by_two_escapes(tmp_path: Path) -> None:
    values = scene_values()
    values["regions"][0]["name"] = "door \U0001f6aa"
    path = tmp_path / "scene.json"
    path.write_text(json.dumps(values), encoding="utf-8")
    assert "\\ud83d" in path.read_text(encoding="utf-8")
    assert load_scene(path).model.regions[0].name == "door \U0001f6aa"


def test_escaped_backslashes_are_no_pairs() -> None:
    assert joined_pairs('"\\\\ud83d\\\\udeaa \\ud83d\\udeaa"') == '"\\\\ud83d\\\\udeaa \U0001f6aa"'


@pytest.mark.parametrize(
    "text", ["", " \n", "[" * 100_000, "1" * 9999, '"\\udfff"', "[1,]", '{"a": 1,}', "nul", "{'a': 1}"]
)
def test_no_json_is_said_in_words(text: str) -> None:
    with pytest.raises(TextError, match=r"found .*; needed "):
        json_value(text)
