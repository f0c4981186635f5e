"""Masks and outlines that others made, against files written by hand and by Pillow."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray
from PIL import Image
from regionpose.io.masks.readers import (
    mask_from_file,
    masks_from_file,
    masks_from_segmenter,
    region_from_file,
    regions_from_file,
)
from regionpose.regions.image import ImageRegion
from shapely.geometry.base import BaseGeometry

Mask = NDArray[np.bool_]

HEIGHT, WIDTH = 40, 60

# Corner-based: the square covers columns 10 to 29 and rows 5 to 24 exactly.
SQUARE: list[list[float]] = [[10, 5], [30, 5], [30, 25], [10, 25]]
TRIANGLE: list[list[float]] = [[35.5, 8.25], [55.25, 12.5], [41.0, 33.75]]


def labels() -> NDArray[np.uint8]:
    """A label picture with a rectangle of 3 with a hole, and one of 7."""
    values = np.zeros((HEIGHT, WIDTH), dtype=np.uint8)
    values[5:20, 8:30] = 3
    values[10:15, 12:20] = 0
    values[22:35, 33:50] = 7
    return values


def inside(points: list[list[float]]) -> Mask:
    """Pixels whose center is inside a corner-based polygon, one point at a time by shapely."""
    columns, rows = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    return np.asarray(shapely.contains_xy(shapely.Polygon(points), columns, rows))


def run_lengths(mask: Mask) -> list[int]:
    """COCO's run lengths, counted pixel by pixel down the columns."""
    runs, current = [0], 0
    for value in mask.T.ravel().astype(int):
        if value != current:
            runs.append(0)
            current = value
        runs[-1] += 1
    return runs


def run_length_text(runs: list[int]) -> str:
    """The runs as COCO's text: differences from the last but one, in groups of five bits from the lowest."""
    text = ""
    for index, run in enumerate(runs):
        left = run - runs[index - 2] if index > 2 else run
        while True:
            bits, left = left & 31, left >> 5
            last = left == (-1 if bits & 16 else 0)
            text += chr(48 + bits + (0 if last else 32))
            if last:
                break
    return text


def written(path: Path, content: object) -> Path:
    path.write_text(json.dumps(content), encoding="utf-8")
    return path


def labelme(*shapes: tuple[str, list[list[float]], str]) -> dict[str, object]:
    listed = [{"label": label, "points": points, "shape_type": kind} for label, points, kind in shapes]
    return {"version": "5.4.1", "imageHeight": HEIGHT, "imageWidth": WIDTH, "imagePath": "a.jpg", "shapes": listed}


def coco(*annotations: dict[str, object]) -> dict[str, object]:
    defaults = {"image_id": 1, "category_id": 4, "iscrowd": 0}
    return {
        "images": [{"id": 1, "file_name": "a.jpg", "height": HEIGHT, "width": WIDTH}],
        "categories": [{"id": 4, "name": "door"}, {"id": 9, "name": "sign"}],
        "annotations": [{"id": 100 + k, **defaults, **entry} for k, entry in enumerate(annotations)],
    }


def flat(points: list[list[float]]) -> list[float]:
    return [value for point in points for value in point]


def outer_and_holes(region: ImageRegion) -> BaseGeometry:
    """The region's rings as one shape: symmetric difference of all of them."""
    shape: BaseGeometry = shapely.Polygon()
    for ring in region.rings:
        shape = shape.symmetric_difference(shapely.Polygon(ring))
    return shape


def as_gray(values: NDArray[np.uint8]) -> Image.Image:
    return Image.fromarray(values)


def as_palette(values: NDArray[np.uint8]) -> Image.Image:
    picture = Image.fromarray(values, mode="P")
    picture.putpalette([37 * k % 256 for k in range(768)])
    return picture


def as_wide(values: NDArray[np.uint8]) -> Image.Image:
    return Image.fromarray(values.astype(np.uint16))


def as_grey_rgb(values: NDArray[np.uint8]) -> Image.Image:
    return Image.fromarray(values).convert("RGB")


def as_float(values: NDArray[np.uint8]) -> Image.Image:
    return Image.fromarray(values.astype(np.float32))


@pytest.mark.parametrize(
    ("picture", "name"),
    [
        (as_gray, "a.png"),
        (as_palette, "a.png"),
        (as_wide, "a.png"),
        (as_grey_rgb, "a.png"),
        (as_wide, "a.tif"),
        (as_float, "a.tiff"),
        (as_gray, "a.bmp"),
    ],
)
def test_values_of_a_label_picture(
    picture: Callable[[NDArray[np.uint8]], Image.Image], name: str, tmp_path: Path
) -> None:
    picture(labels()).save(tmp_path / name)
    masks = masks_from_file(tmp_path / name)
    assert list(masks) == ["3", "7"]
    for value in (3, 7):
        assert masks[str(value)].dtype == np.bool_
        assert np.array_equal(masks[str(value)], labels() == value)
        assert np.array_equal(mask_from_file(tmp_path / name, value), labels() == value)
        assert np.array_equal(mask_from_file(tmp_path / name, str(value)), labels() == value)


def test_large_values_of_16_bits(tmp_path: Path) -> None:
    Image.fromarray(labels().astype(np.uint16) * 257).save(tmp_path / "a.png")
    assert list(masks_from_file(tmp_path / "a.png")) == ["771", "1799"]


@pytest.mark.parametrize("mode", ["1", "L", "LA", "RGB", "RGBA"])
def test_only_mask_of_a_picture_is_named_after_the_file(mode: str, tmp_path: Path) -> None:
    path = tmp_path / "door.png"
    Image.fromarray((labels() == 3).astype(np.uint8) * 255).convert(mode).save(path)
    (name,) = masks_from_file(path)
    assert name == "door"
    for label in (None, "door", 1 if mode == "1" else 255):
        assert np.array_equal(mask_from_file(path, label), labels() == 3)


def test_colors_name_regions(tmp_path: Path) -> None:
    pixels = np.zeros((HEIGHT, WIDTH, 3), dtype=np.uint8)
    pixels[labels() == 3] = (255, 128, 0)
    pixels[labels() == 7] = (0, 0, 200)
    Image.fromarray(pixels).save(tmp_path / "a.png")
    masks = masks_from_file(tmp_path / "a.png")
    assert set(masks) == {"#ff8000", "#0000c8"}
    assert np.array_equal(masks["#ff8000"], labels() == 3)
    assert np.array_equal(mask_from_file(tmp_path / "a.png", "#0000c8"), labels() == 7)


def test_transparent_pixels_are_in_no_region(tmp_path: Path) -> None:
    pixels = np.full((HEIGHT, WIDTH, 4), (200, 10, 10, 0), dtype=np.uint8)
    pixels[labels() == 3, 3] = 255
    Image.fromarray(pixels).save(tmp_path / "a.png")
    assert np.array_equal(mask_from_file(tmp_path / "a.png"), labels() == 3)


def test_labelme_polygons_have_exact_vertices_half_a_pixel_off(tmp_path: Path) -> None:
    path = written(tmp_path / "a.json", labelme(("door", SQUARE, "polygon"), ("flag", TRIANGLE, "polygon")))
    regions = regions_from_file(path)
    assert regions["door"].area == pytest.approx(400.0, abs=1e-12)
    expected = shapely.Polygon(np.array(TRIANGLE) - 0.5)
    assert outer_and_holes(regions["flag"]).symmetric_difference(expected).area == pytest.approx(0.0, abs=1e-9)
    masks = masks_from_file(path)
    assert np.array_equal(masks["door"], inside(SQUARE))
    assert masks["door"].sum() == 400
    assert np.array_equal(masks["flag"], inside(TRIANGLE))


def test_pixels_and_polygon_of_one_square_are_the_same_region(tmp_path: Path) -> None:
    # Whole corner-based numbers run along the pixels' edges, as the contour of a mask does but for its corners.
    path = written(tmp_path / "a.json", labelme(("door", SQUARE, "polygon")))
    Image.fromarray(mask_from_file(path).astype(np.uint8)).save(tmp_path / "a.png")
    of_polygon, of_pixels = (outer_and_holes(region_from_file(tmp_path / name)) for name in ("a.json", "a.png"))
    assert of_polygon.symmetric_difference(of_pixels).area == pytest.approx(4 * 0.125, abs=1e-9)


@pytest.mark.parametrize("points", [[SQUARE[0], SQUARE[2]], [SQUARE[2], SQUARE[0]], [SQUARE[3], SQUARE[1]], SQUARE])
def test_labelme_rectangle_from_any_two_corners_or_all(points: list[list[float]], tmp_path: Path) -> None:
    path = written(tmp_path / "a.json", labelme(("door", points, "rectangle")))
    assert np.array_equal(mask_from_file(path, "door"), inside(SQUARE))


def test_repeated_names_are_numbered_and_none_is_chosen_silently(tmp_path: Path) -> None:
    shapes = [("door", SQUARE, "polygon"), ("door 2", SQUARE, "polygon"), ("door", TRIANGLE, "polygon")]
    path = written(tmp_path / "a.json", labelme(*shapes))
    assert list(masks_from_file(path)) == ["door 1", "door 2", "door 3"]
    assert np.array_equal(mask_from_file(path, "door 3"), inside(TRIANGLE))
    with pytest.raises(ValueError, match=r"0 regions of the label 'door'; needed .*: door 1, door 2, door 3$"):
        mask_from_file(path, "door")


def test_closed_ring_drops_its_repeated_end(tmp_path: Path) -> None:
    path = written(tmp_path / "a.json", labelme(("door", [*SQUARE, SQUARE[0]], "polygon")))
    assert region_from_file(path).area == pytest.approx(400.0, abs=1e-12)


def test_coco_polygons_of_one_annotation_are_one_region(tmp_path: Path) -> None:
    # The third overlaps the first: their union counts the common part once.
    overlapping: list[list[float]] = [[20, 15], [32, 15], [32, 30], [20, 30]]
    path = written(
        tmp_path / "a.json", coco({"segmentation": [flat(part) for part in (SQUARE, TRIANGLE, overlapping)]})
    )
    union = shapely.union_all([shapely.Polygon(np.array(part) - 0.5) for part in (SQUARE, TRIANGLE, overlapping)])
    region = region_from_file(path)
    assert region.area == pytest.approx(union.area, abs=1e-9)
    assert outer_and_holes(region).symmetric_difference(union).area == pytest.approx(0.0, abs=1e-9)
    assert np.array_equal(mask_from_file(path), inside(SQUARE) | inside(TRIANGLE) | inside(overlapping))


def test_coco_parts_around_a_gap_leave_a_hole(tmp_path: Path) -> None:
    bars = [[5, 5, 35, 5, 35, 10, 5, 10], [5, 25, 35, 25, 35, 30, 5, 30], [5, 5, 10, 5, 10, 30, 5, 30]]
    path = written(tmp_path / "a.json", coco({"segmentation": [*bars, [30, 5, 35, 5, 35, 30, 30, 30]]}))
    region = region_from_file(path)
    assert len(region.rings) == 2
    assert region.area == pytest.approx(30 * 25 - 20 * 15, abs=1e-9)
    assert mask_from_file(path).sum() == 30 * 25 - 20 * 15


@pytest.mark.parametrize("as_text", [False, True])
def test_coco_run_lengths_keep_holes(as_text: bool, tmp_path: Path) -> None:
    runs = run_lengths(labels() == 3)
    code = {"size": [HEIGHT, WIDTH], "counts": run_length_text(runs) if as_text else runs}
    path = written(tmp_path / "a.json", coco({"segmentation": code, "iscrowd": 1}))
    assert np.array_equal(mask_from_file(path, "door"), labels() == 3)
    assert len(region_from_file(path).rings) == 2


def test_coco_text_known_from_its_definition(tmp_path: Path) -> None:
    # 40 = 8 + 32 * 1 is "X" (8, more follow) and "1"; 4 is 1 + 3; 9 is 40 - 31, -31 = 1 - 32 is "Q" and "O" (-1).
    code = {"size": [6, 10], "counts": "61X13QO"}
    content = coco({"segmentation": code})
    content["images"] = [{"id": 1, "file_name": "a.jpg", "height": 6, "width": 10}]
    mask = mask_from_file(written(tmp_path / "a.json", content))
    assert run_lengths(mask) == [6, 1, 40, 4, 9]


@settings(max_examples=60, deadline=None)
@given(arrays(np.bool_, st.tuples(st.integers(1, 40), st.integers(1, 40))))
def test_run_lengths_of_any_mask_come_back(mask: Mask) -> None:
    runs = run_lengths(mask)
    codes = [runs, run_length_text(runs), run_length_text(runs).encode()]
    entries = [{"segmentation": {"size": list(mask.shape), "counts": counts}} for counts in codes]
    for found in masks_from_segmenter(entries):
        assert np.array_equal(found, mask)


def test_coco_names_and_ids(tmp_path: Path) -> None:
    content = coco(
        {"segmentation": [flat(SQUARE)]},
        {"segmentation": [flat(TRIANGLE)], "category_id": 9},
        {"segmentation": [flat(TRIANGLE)], "category_id": 77},
    )
    path = written(tmp_path / "a.json", content)
    assert list(regions_from_file(path)) == ["door", "sign", "category 77"]
    assert np.array_equal(mask_from_file(path, "sign"), inside(TRIANGLE))
    assert np.array_equal(mask_from_file(path, 100), inside(SQUARE))
    with pytest.raises(ValueError, match=r"3 regions; needed the label of one of: 100 \('door'\), 101 \('sign'\)"):
        mask_from_file(path)


def test_coco_file_of_several_images(tmp_path: Path) -> None:
    content = coco({"segmentation": [flat(SQUARE)]}, {"segmentation": [flat(TRIANGLE)], "image_id": 2})
    content["images"] = [
        {"id": 1, "file_name": "a.jpg", "height": HEIGHT, "width": WIDTH},
        {"id": 2, "file_name": "b.jpg", "height": HEIGHT, "width": WIDTH},
    ]
    path = written(tmp_path / "a.json", content)
    assert np.array_equal(mask_from_file(path, image="b.jpg"), inside(TRIANGLE))
    assert np.array_equal(mask_from_file(path, image=1), inside(SQUARE))
    with pytest.raises(ValueError, match=r"2 images None.*1 \(a.jpg\), 2 \(b.jpg\)|0 images None.*1 \(a.jpg\)"):
        masks_from_file(path)


def test_region_of_a_file_knows_the_size_of_its_image(tmp_path: Path) -> None:
    path = written(tmp_path / "a.json", labelme(("door", SQUARE, "polygon")))
    assert region_from_file(path, size=(HEIGHT, WIDTH)).area == pytest.approx(400.0)
    with pytest.raises(ValueError, match=r"found masks of 60 x 40 pixels; needed 40 x 60, as the image"):
        region_from_file(path, size=(WIDTH, HEIGHT))


def test_label_lists_what_is_there(tmp_path: Path) -> None:
    Image.fromarray(labels()).save(tmp_path / "a.png")
    with pytest.raises(ValueError, match=r"a.png: found 2 regions; needed the label of one of: 3 \('3'\), 7 \('7'\)$"):
        mask_from_file(tmp_path / "a.png")
    with pytest.raises(ValueError, match=r"found 0 regions of the label 5; needed"):
        mask_from_file(tmp_path / "a.png", 5)


# Each damaged file: its name, its content, and what the message must say.
SHAPE = {"label": "door", "points": SQUARE, "shape_type": "polygon"}
DAMAGED_LABELME: list[tuple[dict[str, object], str]] = [
    ({"shapes": []}, "holds no regions"),
    ({"shapes": None}, "'shapes' of type NoneType; needed a list of objects"),
    ({"shapes": [3]}, "needed a list of objects"),
    ({"imageHeight": None}, "imageHeight None"),
    ({"imageWidth": 0}, "imageWidth 0"),
    ({"imageWidth": 60.5}, "imageWidth 60.5"),
    ({"imageHeight": WIDTH, "imageWidth": 20}, r"shape 0 has the point \(30, 5\); the image has 20 x 60"),
    ({"shapes": [{**SHAPE, "label": ""}]}, "shape 0 has the label ''"),
    ({"shapes": [SHAPE, {**SHAPE, "shape_type": "circle"}]}, "shape 1 .'door'. is a 'circle'; needed a polygon"),
    ({"shapes": [{**SHAPE, "shape_type": ["polygon"]}]}, r"shape 0 .'door'. is a \['polygon'\]; needed a polygon"),
    ({"shapes": [{**SHAPE, "points": [[1, 2], [3, 4]]}]}, r"points of shape \(2, 2\); needed at least 3"),
    ({"shapes": [{**SHAPE, "points": [[1, 2], [3], [4, 5]]}]}, "aren't pairs of numbers"),
    ({"shapes": [{**SHAPE, "points": [[1, 2], [3, "x"], [4, 5]]}]}, "aren't pairs of numbers"),
    ({"shapes": [{**SHAPE, "points": [[1, 2], [3, float("nan")], [4, 5]]}]}, "needed at least 3 finite"),
    ({"shapes": [{**SHAPE, "points": None}]}, "needed at least 3 finite"),
]


@pytest.mark.parametrize(("change", "message"), DAMAGED_LABELME)
def test_damaged_labelme_file(change: dict[str, object], message: str, tmp_path: Path) -> None:
    path = written(tmp_path / "a.json", {**labelme(("door", SQUARE, "polygon")), **change})
    with pytest.raises(ValueError, match=message):
        masks_from_file(path)


def code(**changes: object) -> dict[str, object]:
    return {"segmentation": {"size": [HEIGHT, WIDTH], "counts": run_lengths(labels() == 3), **changes}}


DAMAGED_ANNOTATIONS: list[tuple[dict[str, object], str]] = [
    ({"segmentation": []}, r"annotation 100 has the segmentation \[\]"),
    ({"segmentation": None}, "segmentation None; needed polygons or run lengths"),
    ({}, "segmentation None"),
    ({"segmentation": [[1, 2, 3]]}, "polygon 0 has points that aren't pairs"),
    ({"segmentation": [[1, 2, 3, 4]]}, "needed at least 3"),
    ({"segmentation": [flat(SQUARE), [500, 1, 2, 3, 4, 5]]}, r"polygon 1 has the point \(500, 1\)"),
    (code(counts=[5, 5]), "run lengths for 10 pixels; needed 2400"),
    (code(counts=[-5, 2405]), "whole numbers of at least 0"),
    (code(counts=[5.5, 2394.5]), "whole numbers of at least 0"),
    (code(counts=[5, float("nan")]), "whole numbers of at least 0"),
    (code(counts=[]), "run lengths"),
    (code(counts=None), "run lengths"),
    (code(counts="6\u20ac"), "is no part of a run-length text"),
    (code(counts="X"), "ends within a number"),
    (code(size=[WIDTH, HEIGHT]), r"has size \[60, 40\]; the image's is \[40, 60\]"),
    (code(size=None), "has size None"),
]


@pytest.mark.parametrize(("annotation", "message"), DAMAGED_ANNOTATIONS)
def test_damaged_coco_annotation(annotation: dict[str, object], message: str, tmp_path: Path) -> None:
    path = written(tmp_path / "a.json", coco(annotation))
    with pytest.raises(ValueError, match=message):
        masks_from_file(path)


def test_damage_elsewhere_in_the_run_lengths_spares_the_chosen_region(tmp_path: Path) -> None:
    path = written(tmp_path / "a.json", coco(code(counts=[5, 5]), {"segmentation": [flat(SQUARE)], "category_id": 9}))
    assert np.array_equal(mask_from_file(path, "sign"), inside(SQUARE))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"images": []}, "has 0 images None"),
        ({"images": 5}, "'images' of type int"),
        ({"categories": [5]}, "'categories' of type list; needed a list of objects"),
        ({"annotations": {}}, "'annotations' of type dict"),
        ({"annotations": []}, "holds no regions"),
        ({"images": [{"id": 1}]}, "image 1 has height None"),
        ({"images": [{"id": 2, "height": 4, "width": 4}]}, "holds no regions"),
    ],
)
def test_damaged_coco_file(change: dict[str, object], message: str, tmp_path: Path) -> None:
    path = written(tmp_path / "a.json", {**coco({"segmentation": [flat(SQUARE)]}), **change})
    with pytest.raises(ValueError, match=message):
        masks_from_file(path)


def test_crossing_polygon_is_named(tmp_path: Path) -> None:
    path = written(tmp_path / "a.json", labelme(("bow", [[5, 5], [25, 25], [25, 5], [5, 25]], "polygon")))
    with pytest.raises(ValueError, match=r"a\.json, region 'bow': "):
        region_from_file(path)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.json", b"", "found an empty file; needed JSON"),
        ("a.json", b'{"shapes": [{"label"', "line 1, column 21: found the end of the text"),
        ("a.json", b"\xff\xfe\x00", "found a binary file; needed JSON"),
        ("a.json", b"[" * 100_000, "found brackets nested too deep"),
        ("a.json", b"[1, 2]", "holds list; needed 'shapes'"),
        ("a.json", b'{"images": []}', r"holds \['images'\]; needed 'shapes' .labelme. or 'images' and 'annotations'"),
        ("a.png", b"", "found no picture"),
        ("a.png", b'{"shapes": []}', "found no picture"),
        ("a.npy", b"\x93NUMPY", "found no picture"),
    ],
)
def test_file_of_another_kind(name: str, content: bytes, message: str, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ValueError, match=message):
        masks_from_file(tmp_path / name)


def test_truncated_picture(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    Image.fromarray(np.random.default_rng(0).integers(0, 255, (HEIGHT, WIDTH), dtype=np.uint8)).save(path)
    whole = path.read_bytes()
    for length in (20, 60, len(whole) // 2):
        path.write_bytes(whole[:length])
        with pytest.raises(ValueError, match=r"a\.png: found no picture"):
            masks_from_file(path)


def test_missing_file(tmp_path: Path) -> None:
    for read in (masks_from_file, regions_from_file, mask_from_file, region_from_file):
        with pytest.raises(FileNotFoundError, match=r"nowhere\.png isn't there"):
            read(tmp_path / "nowhere.png")


def test_pictures_that_hold_no_labels(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    Image.fromarray(rng.integers(0, 255, (HEIGHT, WIDTH, 3), dtype=np.uint8)).save(tmp_path / "photo.png")
    Image.fromarray(np.zeros((HEIGHT, WIDTH), dtype=np.uint8)).save(tmp_path / "black.png")
    Image.fromarray(labels()).save(tmp_path / "lossy.jpg")
    Image.fromarray(rng.random((HEIGHT, WIDTH), dtype=np.float32)).save(tmp_path / "shares.tif")
    holding_nan = np.where(labels() == 3, np.nan, labels()).astype(np.float32)
    Image.fromarray(holding_nan).save(tmp_path / "nan.tif")
    for name, message in {
        "photo.png": "a label image has at most 1000",
        "black.png": "holds no regions",
        "lossy.jpg": "is a JPEG, which changes the labels",
        "shares.tif": "numbers that aren't whole",
        "nan.tif": "numbers that aren't whole",
    }.items():
        with pytest.raises(ValueError, match=message):
            masks_from_file(tmp_path / name)
