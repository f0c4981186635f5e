"""Segmenters that others made, by stubs of their interfaces."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import run
from numpy.typing import NDArray
from PIL import Image
from regionpose.cli import main
from regionpose.scene.exposure import scene_sides
from regionpose.scene.loading import load_scene
from regionpose.segment.segmenters import PredictorSegmenter, load_segmenter, segmented
from scene_files import scene_values, write_scene

IMAGE = np.zeros((40, 60, 3), dtype=np.uint8)


def square(side: int) -> NDArray[np.bool_]:
    mask = np.zeros(IMAGE.shape[:2], dtype=np.bool_)
    mask[10 : 10 + side, 20 : 20 + side] = True
    return mask


class Stub:
    """A predictor that finds squares."""

    def __init__(self) -> None:
        self.images: list[Any] = []
        self.asked: list[tuple[Any, Any]] = []

    def set_image(self, image: Any) -> None:
        self.images.append(image)

    def predict(self, *, point_coords: Any, point_labels: Any, multimask_output: bool) -> Any:
        self.asked.append((point_coords, point_labels))
        return np.stack([square(5), square(10), square(20)]), np.array([0.2, 0.9, 0.5]), None


def test_a_predictor_is_set_an_image_once_and_its_best_mask_is_first() -> None:
    stub = Stub()
    segmenter = PredictorSegmenter(stub)
    for _ in range(2):
        masks = segmented(segmenter, IMAGE, [(25.0, 15.0)], [1])
    assert [int(mask.sum()) for mask in masks] == [100, 400, 25]
    assert len(stub.images) == 1
    np.testing.assert_array_equal(stub.asked[0][0], [[25.0, 15.0]])
    np.testing.assert_array_equal(stub.asked[0][1], [1])


def test_one_mask_of_logits_is_a_stack_of_one() -> None:
    (mask,) = segmented(lambda *_: np.where(square(10), 4.0, -4.0), IMAGE, [(25.0, 15.0)], [1])
    assert int((mask > 0.5).sum()) == 100


@pytest.mark.parametrize(
    ("found", "message"), [(np.zeros((40, 60), dtype=bool), "nothing there"), (np.ones((5, 5), dtype=bool), "shape")]
)
def test_what_is_no_mask_of_the_image_is_an_error(found: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        segmented(lambda *_: found, IMAGE, [(25.0, 15.0)], [1])


@pytest.mark.parametrize(
    "name", ["numpy", "numpy:", "..numpy:pi", "no_such_module:x", "numpy:no_such_name", "numpy:pi"]
)
def test_a_name_that_leads_to_no_segmenter_is_an_error(name: str) -> None:
    with pytest.raises(ValueError, match="needed"):
        load_segmenter(name)


@pytest.mark.parametrize("attribute", ["Stub", "stub", "plain"])
def test_the_command_asks_the_segmenter_that_it_is_told(
    attribute: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path, str(Path(__file__).parent)])
    (tmp_path / "my_segmenter.py").write_text(
        "from test_segmenters import Stub, square\nstub = Stub()\nplain = lambda *_: square(10)\n",
        encoding="utf-8",
    )
    sys.modules.pop("my_segmenter", None)
    Image.fromarray(IMAGE).save("photo.png")
    arguments = ["segment", "photo.png", "--seed", "25,15", "--segmenter", f"my_segmenter:{attribute}"]
    assert main([*arguments, "--out", "mask.png"]) == 0
    assert int((np.asarray(Image.open("mask.png")) > 0).sum()) == 100
    assert main([*arguments, "--tolerance", "3", "--out", "other.png"]) == 2


def left_half(image: Any, pixels: Any, labels: Any) -> Any:
    """A segmenter that knows one thing."""
    mask = np.zeros(image.shape[:2], dtype=np.bool_)
    mask[40:200, 20:150] = True
    return mask


def test_seeds_of_scenes_ask_the_segmenter(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    values = scene_values()
    values["regions"][0]["image"] = {"seed": [60, 60]}
    path = write_scene(tmp_path, values)
    words = ("--segmenter", "test_segmenters:left_half", "--out", tmp_path / "out", "--json", "--quiet")
    code, said, _ = run(capsys, "segment", path, *words)
    assert code == 0
    assert json.loads(said)["regions"][0]["image_area_px"] == pytest.approx(160 * 130, rel=0.01)
    code, said, _ = run(capsys, "estimate", path, *words[:2], "--out", tmp_path / "pose", "--json", "--quiet")
    assert json.loads(said)["diagnostics"]["regions"][0]["image_area_px"] == pytest.approx(160 * 130, rel=0.01)


def test_a_seed_with_a_tolerance_is_grown_all_the_same(tmp_path: Path) -> None:
    values = scene_values()
    values["regions"][0]["image"] = {"seed": [60, 60], "tolerance": 5.0}
    scene = replace(load_scene(write_scene(tmp_path, values)), segmenter=left_half)
    assert scene_sides(scene).image_regions[0].area > 0.9 * 320 * 240
