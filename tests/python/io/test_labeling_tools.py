"""Regions of labeling tools' files, against masks that are written in each tool's own way here."""

from __future__ import annotations

import io
import json
from base64 import b64encode
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray
from PIL import Image
from regionpose.io.masks.label_studio import label_studio_items
from regionpose.io.masks.readers import mask_from_file, masks_from_file, region_from_file, regions_from_file
from test_masks import HEIGHT, SQUARE, TRIANGLE, WIDTH, inside, run_length_text, run_lengths, written

Mask = NDArray[np.bool_]
Points = list[list[float]]

WINDOW: Points = [[14, 9], [20, 9], [20, 15], [14, 15]]
"""Within the square, corner-based: columns 14 to 19 and rows 9 to 14."""

PANE: Points = [[16, 11], [18, 11], [18, 13], [16, 13]]
"""Within the window."""


def blob() -> Mask:
    """A mask with a hole and two parts."""
    mask = np.zeros((HEIGHT, WIDTH), dtype=np.bool_)
    mask[6:20, 9:31], mask[10:14, 15:22], mask[25:31, 40:51] = True, False, True
    return mask


def area(points: Points) -> float:
    return float(shapely.Polygon(points).area)


# labelme


def labelme(*shapes: Mapping[str, Any]) -> dict[str, object]:
    defaults: dict[str, Any] = {"group_id": None, "shape_type": "polygon", "flags": {}}
    return {
        "version": "5.8.0",
        "imageHeight": HEIGHT,
        "imageWidth": WIDTH,
        "shapes": [defaults | dict(one) for one in shapes],
    }


def mask_shape(pixels: Mask, left: int, top: int, **changes: object) -> dict[str, object]:
    """A shape of labelme's AI tools: the corners of its box, both within it, and a PNG."""
    content = io.BytesIO()
    Image.fromarray(pixels).save(content, format="PNG")
    corners = [[left, top], [left + pixels.shape[1] - 1, top + pixels.shape[0] - 1]]
    text = b64encode(content.getvalue()).decode()
    return {"label": "door", "points": corners, "shape_type": "mask", "mask": text, **changes}


def test_a_mask_of_labelme_lies_where_its_corners_say(tmp_path: Path) -> None:
    path = written(tmp_path / "a.json", labelme(mask_shape(blob()[6:31, 9:51], 9, 6)))
    np.testing.assert_array_equal(mask_from_file(path, "door"), blob())
    assert region_from_file(path, "door").mask is not None


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"mask": "no PNG"}, "shape 0 has the mask 'no PNG'; needed a PNG in base64"),
        ({"mask": b64encode(b"no PNG").decode()}, "found no picture"),
        ({"mask": None}, "shape 0 .'door'. has the mask None; needed a PNG in base64"),
        ({"points": [[9, 6], [51, 31]]}, r"shape 0 has corners .* for a mask of 42 x 25 pixels"),
        ({"points": [[30, 6], [71, 30]]}, r"shape 0 has the point \(71, 30\); the image has 60 x 40 pixels"),
        ({"points": [[19, 6], [60, 30]]}, r"shape 0 has a mask of 42 x 25 pixels at \(19, 6\); the image has 60 x 40"),
    ],
)
def test_a_damaged_mask_of_labelme_is_named(changes: dict[str, object], said: str, tmp_path: Path) -> None:
    path = written(tmp_path / "a.json", labelme(mask_shape(blob()[6:31, 9:51], 9, 6, **changes)))
    with pytest.raises(ValueError, match=said):
        masks_from_file(path)
    with pytest.raises(ValueError, match=said):
        regions_from_file(path)


@pytest.mark.parametrize("order", [1, -1])
def test_a_polygon_within_another_of_its_group_is_a_hole(order: int, tmp_path: Path) -> None:
    shapes = [{"label": "door", "points": points, "group_id": 1} for points in (SQUARE, WINDOW, PANE)]
    path = written(tmp_path / "a.json", labelme(*shapes[::order]))
    expected = inside(SQUARE) & ~inside(WINDOW) | inside(PANE)
    np.testing.assert_array_equal(mask_from_file(path, "door"), expected)
    region = region_from_file(path, "door")
    assert region.area == pytest.approx(area(SQUARE) - area(WINDOW) + area(PANE)) and len(region.rings) == 3
    assert region.rings[0].min() == pytest.approx(4.5)


def test_polygons_of_a_group_beside_one_another_are_parts(tmp_path: Path) -> None:
    shapes = [{"label": "door", "points": points, "group_id": 7} for points in (SQUARE, TRIANGLE)]
    path = written(tmp_path / "a.json", labelme(*shapes, {"label": "sign", "points": WINDOW, "group_id": 7}))
    assert list(regions_from_file(path)) == ["door", "sign"]
    np.testing.assert_array_equal(mask_from_file(path, "door"), inside(SQUARE) | inside(TRIANGLE))
    assert region_from_file(path, "door").area == pytest.approx(area(SQUARE) + area(TRIANGLE))


def test_polygons_without_a_group_stay_apart(tmp_path: Path) -> None:
    path = written(tmp_path / "a.json", labelme(*({"label": "door", "points": each} for each in (SQUARE, WINDOW))))
    assert list(regions_from_file(path)) == ["door 1", "door 2"]
    with pytest.raises(ValueError, match=r"found 0 regions of the label 'door'; needed .* door 1, door 2"):
        mask_from_file(path, "door")


@pytest.mark.parametrize("group", [None, 3])
def test_a_shape_labeled_as_a_hole_is_cut_out(group: int | None, tmp_path: Path) -> None:
    shapes: list[dict[str, Any]] = [
        {"label": "__hole__", "points": WINDOW, "group_id": group},
        {"label": "door", "points": SQUARE, "group_id": group},
        {"label": "sign", "points": TRIANGLE},
    ]
    path = written(tmp_path / "a.json", labelme(*shapes))
    assert {name: region.area for name, region in regions_from_file(path).items()} == pytest.approx(
        {"door": area(SQUARE) - area(WINDOW), "sign": area(TRIANGLE)}
    )
    np.testing.assert_array_equal(mask_from_file(path, "door"), inside(SQUARE) & ~inside(WINDOW))


def test_a_hole_is_cut_out_of_a_mask(tmp_path: Path) -> None:
    door = mask_shape(inside(SQUARE)[5:25, 10:30], 10, 5)
    path = written(tmp_path / "a.json", labelme(door, {"label": "__hole__", "points": WINDOW}))
    np.testing.assert_array_equal(mask_from_file(path, "door"), inside(SQUARE) & ~inside(WINDOW))


@pytest.mark.parametrize(("group", "said"), [(None, "a shape that it lies in"), (2, "a shape of its group_id")])
def test_a_hole_in_nothing_is_named(group: int | None, said: str, tmp_path: Path) -> None:
    hole = {"label": "__hole__", "points": TRIANGLE, "group_id": group}
    path = written(tmp_path / "a.json", labelme({"label": "door", "points": SQUARE}, hole))
    with pytest.raises(ValueError, match=rf"shape 1 .__hole__. is in no region; needed {said}"):
        masks_from_file(path)


# Segment Anything


def sam_mask(mask: Mask, as_text: bool = True, **more: object) -> dict[str, object]:
    runs = run_lengths(mask)
    code = {"size": [HEIGHT, WIDTH], "counts": run_length_text(runs) if as_text else runs}
    return {"segmentation": code, "area": int(mask.sum()), "bbox": [0, 0, 1, 1], "predicted_iou": 0.9, **more}


@pytest.mark.parametrize("as_text", [True, False])
def test_masks_of_segment_anything_by_their_places(as_text: bool, tmp_path: Path) -> None:
    path = written(tmp_path / "a.json", [sam_mask(blob(), as_text), sam_mask(inside(TRIANGLE), as_text)])
    assert list(masks_from_file(path)) == ["mask 0", "mask 1"]
    np.testing.assert_array_equal(mask_from_file(path, 0), blob())
    np.testing.assert_array_equal(mask_from_file(path, "mask 1"), inside(TRIANGLE))


def test_masks_of_sa_1b_by_their_ids_or_places(tmp_path: Path) -> None:
    image = {"image_id": 4, "width": WIDTH, "height": HEIGHT, "file_name": "a.jpg"}
    content = {"image": image, "annotations": [sam_mask(blob(), id=90), sam_mask(inside(TRIANGLE), id=41)]}
    path = written(tmp_path / "a.json", content)
    np.testing.assert_array_equal(mask_from_file(path, 41), inside(TRIANGLE))
    np.testing.assert_array_equal(mask_from_file(path, "mask 0"), blob())
    with pytest.raises(ValueError, match=r"found 0 regions of the label 1; needed .*: 90 .'mask 0'., 41 .'mask 1'.$"):
        mask_from_file(path, 1)


def test_coco_results_of_several_images(tmp_path: Path) -> None:
    results = [sam_mask(mask, image_id=k, category_id=3) for k, mask in ((1, blob()), (2, inside(TRIANGLE)))]
    path = written(tmp_path / "a.json", results)
    np.testing.assert_array_equal(mask_from_file(path, "category 3", image=2), inside(TRIANGLE))
    with pytest.raises(ValueError, match=r"has 2 images None|has 0 images None; needed the id .* 1 .1., 2 .2."):
        masks_from_file(path)


def test_a_list_of_masks_without_a_size_is_named(tmp_path: Path) -> None:
    path = written(tmp_path / "a.json", [{"segmentation": [[1, 1, 5, 1, 5, 5]]}])
    with pytest.raises(ValueError, match=r"mask 0 has the segmentation .*; needed run lengths with their size"):
        masks_from_file(path)


# Label Studio


def brush(levels: NDArray[np.uint8], lengths_bits: tuple[int, int, int, int] = (3, 4, 8, 16)) -> list[int]:
    """The run lengths of a brush's pixels: red, green, blue and cover, all of them the same here.

    Written from the description of thi.ng's rle-pack: runs of three and more numbers are packed, others stand alone.
    """
    numbers = np.repeat(levels.ravel(), 4)
    bits = f"{len(numbers):032b}{7:05b}" + "".join(f"{width - 1:04b}" for width in lengths_bits)
    starts = np.flatnonzero(np.diff(numbers.astype(int), prepend=-1))
    for start, end in zip(starts, [*starts[1:], len(numbers)], strict=True):
        while start < end:
            # Alternate packed runs and single numbers, so that both are read.
            packed = (start // 4) % 3 > 0
            index = start % 4
            length = min(end - start, 1 << lengths_bits[index])
            held = f"{numbers[start]:08b}" * (1 if packed else length)
            bits += f"{int(packed)}{index:02b}{length - 1:0{lengths_bits[index]}b}{held}"
            start += length
    bits += "0" * (-len(bits) % 8)
    return [int(bits[k : k + 8], 2) for k in range(0, len(bits), 8)]


def result(kind: str, label: str | None, **value: object) -> dict[str, Any]:
    named = {} if label is None else {kind: [label]}
    sides = {"original_width": WIDTH, "original_height": HEIGHT, "image_rotation": 0}
    return {**sides, "id": f"{kind} {label}", "type": kind, "value": {**value, **named}}


def task(*results: dict[str, Any], number: int = 1, name: str = "photo.png") -> dict[str, Any]:
    data = {"image": f"/data/upload/3/1a2b3c4d-{name}"}
    return {"id": number, "data": data, "annotations": [{"id": 5, "result": list(results)}]}


def percent(points: Points) -> Points:
    shares: Points = (np.array(points) / [WIDTH, HEIGHT] * 100.0).tolist()
    return shares


def test_a_polygon_of_label_studio_is_in_percent(tmp_path: Path) -> None:
    path = written(tmp_path / "a.json", [task(result("polygonlabels", "door", points=percent(TRIANGLE), closed=True))])
    region = region_from_file(path, "door", size=(HEIGHT, WIDTH))
    np.testing.assert_allclose(sorted(map(tuple, region.rings[0] + 0.5)), sorted(map(tuple, TRIANGLE)), atol=1e-9)
    np.testing.assert_array_equal(mask_from_file(path, "door"), inside(TRIANGLE))


def test_a_rectangle_of_label_studio_turns_about_its_corner(tmp_path: Path) -> None:
    corner, sides = percent([[20, 10]])[0], percent([[16, 8]])[0]
    value = {"x": corner[0], "y": corner[1], "width": sides[0], "height": sides[1], "rotation": 90}
    path = written(tmp_path / "a.json", [task(result("rectanglelabels", "door", **value))])
    # A quarter clockwise as it is seen: what lay to the right lies below.
    np.testing.assert_array_equal(mask_from_file(path, "door"), inside([[20, 10], [20, 26], [12, 26], [12, 10]]))


def test_a_brush_of_label_studio(tmp_path: Path) -> None:
    levels = np.where(blob(), 255, 0).astype(np.uint8)
    levels[0, :4] = (1, 127, 128, 254)
    expected = blob()
    expected[0, 2:4] = True
    path = written(tmp_path / "a.json", [task(result("brushlabels", "door", format="rle", rle=brush(levels)))])
    np.testing.assert_array_equal(mask_from_file(path, "door"), expected)
    assert region_from_file(path).area == pytest.approx(region_from_file(path, "door").area)


@settings(max_examples=30, deadline=None)
@given(arrays(np.bool_, (7, 9)), st.tuples(*[st.integers(1, 16)] * 4))
def test_brushes_of_any_mask_come_back(mask: Mask, lengths_bits: tuple[int, int, int, int]) -> None:
    levels = np.where(mask, 255, 0).astype(np.uint8)
    held = result("brushlabels", "door", format="rle", rle=brush(levels, lengths_bits))
    held |= {"original_width": 9, "original_height": 7}
    (item,) = label_studio_items(Path(__file__), [task(held)], None)
    np.testing.assert_array_equal(item.mask(), mask)


@pytest.mark.parametrize(
    ("code", "said"),
    [
        ([0, 75, 0, 0, 11, 0, 0, 128], "holds 4915200 numbers of 2 bits, not 9600 of 8"),
        (brush(np.zeros((HEIGHT, WIDTH), np.uint8))[:-2], "ends too early"),
        ([], r"has the rle \[\]; needed whole numbers from 0 to 255"),
        ([256], r"has the rle \[256\]; needed"),
        ("0", "has the rle '0'; needed"),
    ],
)
def test_a_damaged_brush_spares_the_other_regions(code: object, said: str, tmp_path: Path) -> None:
    results = [
        result("polygonlabels", "door", points=percent(SQUARE)),
        result("brushlabels", "sign", format="rle", rle=code),
        result("ellipselabels", "lamp", x=20, y=20, radiusX=5, radiusY=5),
        result("choices", None, choices=["indoors"]),
    ]
    path = written(tmp_path / "a.json", [task(*results)])
    np.testing.assert_array_equal(mask_from_file(path, "door"), inside(SQUARE))
    with pytest.raises(ValueError, match=rf"result 1 has an? (the )?.*{said}|result 1 {said}"):
        mask_from_file(path, "sign")
    with pytest.raises(ValueError, match=r"result 2 .'lamp'. is a 'ellipselabels'; needed a polygon, .* COCO or PNG"):
        mask_from_file(path, "lamp")
    with pytest.raises(ValueError, match="result 1"):
        masks_from_file(path)


def test_a_turned_image_of_label_studio_is_refused(tmp_path: Path) -> None:
    held = result("polygonlabels", "door", points=percent(SQUARE)) | {"image_rotation": 90}
    path = written(tmp_path / "a.json", [task(held)])
    with pytest.raises(ValueError, match="is of a turned image; needed image_rotation 0"):
        mask_from_file(path, "door")


def test_tasks_and_results_of_label_studio_that_are_chosen(tmp_path: Path) -> None:
    square, window = (result("polygonlabels", "door", points=percent(points)) for points in (SQUARE, WINDOW))
    withdrawn = {"id": 6, "was_cancelled": True, "result": [window]}
    first, second = task(square), task(window, number=2, name="other.png")
    first["annotations"].append(withdrawn)
    path = written(tmp_path / "a.json", [first, second])
    for image in (1, "photo.png", "1a2b3c4d-photo.png"):
        np.testing.assert_array_equal(mask_from_file(path, "door", image=image), inside(SQUARE))
    np.testing.assert_array_equal(mask_from_file(path, "door", image="other.png"), inside(WINDOW))
    with pytest.raises(ValueError, match=r"has 0 tasks None; needed the id or file name of one of: 1 .1a2b3c4d-photo"):
        masks_from_file(path)


def test_a_shape_and_its_label_in_two_results(tmp_path: Path) -> None:
    drawn = result("polygon", None, points=percent(SQUARE)) | {"id": "x"}
    named = result("labels", "door", points=percent(SQUARE)) | {"id": "x"}
    assert list(masks_from_file(written(tmp_path / "a.json", [task(drawn, named)]))) == ["door"]


def test_label_studios_short_form(tmp_path: Path) -> None:
    shape = {"points": percent(SQUARE), "polygonlabels": ["door"], "original_width": WIDTH, "original_height": HEIGHT}
    path = written(tmp_path / "a.json", [{"image": "/data/upload/photo.png", "id": 1, "label": [shape]}])
    np.testing.assert_array_equal(mask_from_file(path, "door"), inside(SQUARE))


# CVAT


def cvat(*shapes: str, more: str = "") -> str:
    image = f'<image id="0" name="set/photo.png" width="{WIDTH}" height="{HEIGHT}">{"".join(shapes)}</image>'
    return f'<?xml version="1.0" encoding="utf-8"?>\n<annotations><version>1.1</version>{image}{more}</annotations>'


def saved(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def cvat_points(points: Points) -> str:
    return ";".join(f"{x:.2f},{y:.2f}" for x, y in points)


def cvat_mask(mask: Mask, left: int, top: int, label: str = "door") -> str:
    """A mask by runs along the rows of its box, the first of them outside."""
    ends = np.flatnonzero(np.diff(mask.ravel().astype(int), prepend=0, append=2))
    runs = ", ".join(map(str, np.diff(ends, prepend=0)))
    height, width = mask.shape
    return f'<mask label="{label}" rle="{runs}" left="{left}" top="{top}" width="{width}" height="{height}"></mask>'


def test_shapes_of_cvat(tmp_path: Path) -> None:
    polygon = f'<polygon label="sign" points="{cvat_points(TRIANGLE)}" z_order="0"></polygon>'
    box = '<box label="lamp" xtl="10.0" ytl="5.0" xbr="30.0" ybr="25.0"><attribute name="a">b</attribute></box>'
    path = saved(tmp_path / "a.xml", cvat(cvat_mask(blob()[6:31, 9:51], 9, 6), polygon, box, '<tag label="day"/>'))
    expected = {"door": blob(), "sign": inside(TRIANGLE), "lamp": inside(SQUARE)}
    masks = masks_from_file(path)
    assert list(masks) == list(expected)
    for name, mask in expected.items():
        np.testing.assert_array_equal(masks[name], mask)
    assert region_from_file(path, "sign").area == pytest.approx(area(TRIANGLE))
    assert region_from_file(path, "door", size=(HEIGHT, WIDTH)).mask is not None


def test_runs_of_cvat_known_from_their_definition(tmp_path: Path) -> None:
    """Two rows of three: one outside, four inside, one outside."""
    text = cvat('<mask label="door" rle="1, 4, 1" left="2" top="3" width="3" height="2"/>')
    mask = mask_from_file(saved(tmp_path / "a.xml", text))
    assert np.argwhere(mask).tolist() == [[3, 3], [3, 4], [4, 2], [4, 3]]


def test_a_turned_box_of_cvat(tmp_path: Path) -> None:
    text = cvat('<box label="door" xtl="20" ytl="10" xbr="36" ybr="18" rotation="90.00"/>')
    np.testing.assert_array_equal(
        mask_from_file(saved(tmp_path / "a.xml", text)), inside([[24, 6], [32, 6], [32, 22], [24, 22]])
    )


def test_images_of_cvat_by_number_or_name(tmp_path: Path) -> None:
    polygon = f'<polygon label="door" points="{cvat_points(TRIANGLE)}"/>'
    other = f'<image id="7" name="b.png" width="{WIDTH}" height="{HEIGHT}">{polygon}</image>'
    path = saved(tmp_path / "a.xml", cvat(cvat_mask(blob(), 0, 0), more=other))
    for image in (7, "b.png"):
        np.testing.assert_array_equal(mask_from_file(path, "door", image=image), inside(TRIANGLE))
    np.testing.assert_array_equal(mask_from_file(path, "door", image="photo.png"), blob())
    with pytest.raises(ValueError, match=r"has 0 images None; needed .* 0 .photo.png., 7 .b.png."):
        masks_from_file(path)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("<annotations><track id='0'/></annotations>", "holds tracks of a video; needed CVAT's annotations for images"),
        ("<kml/>", "holds <kml> without images; needed CVAT's .* COCO or PNG masks"),
        ("<annotations>", "found no XML"),
        ('<!DOCTYPE a [<!ENTITY b "c">]><annotations/>', "found a document type; needed XML without one"),
        (
            cvat('<mask label="a" rle="1,2" left="2" top="3" width="3" height="2"/>'),
            "run lengths for 3 pixels; needed 6",
        ),
        (
            cvat('<mask label="a" rle="6" left="58" top="3" width="3" height="2"/>'),
            "mask of 3 x 2 pixels at .58, 3.; the",
        ),
        (
            cvat('<mask label="a" rle="x" left="2" top="3" width="3" height="2"/>'),
            "has the rle 'x'; needed whole numbers",
        ),
        (
            cvat('<mask label="a" rle="6" left="-2" top="3" width="3" height="2"/>'),
            "has left '-2'; needed a whole number",
        ),
        (cvat('<polygon label="a" points="1,2;3"/>'), "has the points '1,2;3'; needed"),
        (cvat('<box label="a" xtl="1"/>'), "has ytl ''; needed a number"),
        (cvat('<ellipse label="a" cx="1" cy="1" rx="2" ry="3"/>'), "shape 0 .'a'. is a ellipse; needed a polygon"),
        (cvat(), "holds no regions"),
    ],
)
def test_what_cvat_cannot_mean_is_named(text: str, said: str, tmp_path: Path) -> None:
    path = saved(tmp_path / "a.xml", text)
    with pytest.raises(ValueError, match=said):
        masks_from_file(path)


def test_what_is_no_file_of_a_known_tool_says_which_are(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text(json.dumps([{"a": 1}]))
    with pytest.raises(
        ValueError, match=r"holds list; needed 'shapes' .labelme. .*COCO.*Segment Anything.*Label Studio"
    ):
        masks_from_file(tmp_path / "a.json")
