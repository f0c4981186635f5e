"""What users hold already: arrays, tensors, masks, polygons, clouds and meshes of other libraries."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
import regionpose as rp
import shapely
import trimesh

MASKS = np.zeros((3, 40, 60), dtype=bool)
for index in range(3):
    MASKS[index, 5 + index : 30, 10:50] = True
SCORES = np.array([0.2, 0.9, 0.5])


class CudaTensor:
    """A tensor as torch has it on a GPU: numpy gets torch's advice."""

    def __array__(self, *_: Any, **__: Any) -> Any:
        raise TypeError("can't convert cuda:0 device type tensor to numpy. Use Tensor.cpu() to copy the tensor first.")


@pytest.mark.parametrize(
    "call",
    [
        rp.ImageRegion.from_mask,
        rp.ImageRegion.from_polygon,
        rp.WorldRegion.from_points,
        rp.Cloud.from_points,
        rp.io.masks_from_segmenter,
        rp.Pose.from_matrix,
        rp.Pose.identity().transform,
        rp.PinholeCamera(300, 300, 30, 20).project,
    ],
)
def test_a_tensor_on_a_gpu_is_refused_with_its_own_advice(call: Any) -> None:
    with pytest.raises(ValueError, match=r"Tensor\.cpu\(\)"):
        call(CudaTensor())


def test_masks_of_a_predictor_come_by_falling_score() -> None:
    found = rp.io.masks_from_segmenter((MASKS, SCORES, np.zeros((3, 10, 15))))
    assert [mask.sum() for mask in found] == [MASKS[index].sum() for index in (1, 2, 0)]


def test_the_best_mask_of_each_prompt_is_taken() -> None:
    scores = np.stack([SCORES, SCORES[::-1]])
    found = rp.io.masks_from_segmenter((np.stack([MASKS, MASKS]), scores, None))
    assert len(found) == 2 and all((mask == MASKS[1]).all() for mask in found)


def ultralytics_result(data: Any) -> SimpleNamespace:
    """A result as ultralytics has it, of a photo of 40 x 60 pixels."""
    rings = [np.array([[10, 5 + index], [49, 5 + index], [49, 29], [10, 29]], dtype=np.float32) for index in range(3)]
    return SimpleNamespace(masks=SimpleNamespace(data=data, orig_shape=(40, 60), xy=rings))


@pytest.mark.parametrize(
    "output",
    [
        [{"segmentation": mask, "area": int(mask.sum())} for mask in MASKS],
        MASKS,
        MASKS[:, None],
        tuple(MASKS),
        ultralytics_result(MASKS.astype(np.float32)),
        [ultralytics_result(MASKS.astype(np.float32))],
        SimpleNamespace(mask=MASKS, xyxy=np.zeros((3, 4)), confidence=SCORES),
        {"masks": list(MASKS), "scores": SCORES},
        [{"label": "wall", "score": 0.9, "mask": (255 * mask).astype(np.uint8)} for mask in MASKS],
    ],
    ids=[
        "sam",
        "stack",
        "channel",
        "tuple",
        "ultralytics",
        "ultralytics-list",
        "supervision",
        "transformers",
        "pipeline",
    ],
)
def test_masks_are_found_in_what_segmenters_return(output: Any) -> None:
    assert all(
        (mask == expected).all() for mask, expected in zip(rp.io.masks_from_segmenter(output), MASKS, strict=True)
    )


def test_masks_of_the_networks_size_are_drawn_anew_at_the_photos() -> None:
    found = rp.io.masks_from_segmenter(ultralytics_result(np.zeros((3, 32, 32))))
    assert [mask.shape for mask in found] == [(40, 60)] * 3
    assert all(abs(int(mask.sum()) - int(expected.sum())) < 130 for mask, expected in zip(found, MASKS, strict=True))


def test_a_map_of_instances_gives_a_mask_for_each() -> None:
    places = np.zeros((40, 60), dtype=np.int32)
    places[5:20], places[25:35] = 7, 9
    found = rp.io.masks_from_segmenter({"segmentation": places, "segments_info": [{"id": 7}, {"id": 9}]})
    assert [int(mask.sum()) for mask in found] == [900, 600]


@pytest.mark.parametrize(
    "output",
    [
        {"boxes": np.zeros((2, 4))},
        SimpleNamespace(masks=None),
        {"masks": []},
        {"segmentation": np.zeros((4, 4)), "segments_info": []},
        (MASKS, SCORES[:2], None),
    ],
)
def test_an_output_without_masks_is_refused(output: Any) -> None:
    with pytest.raises(ValueError, match="needed"):
        rp.io.masks_from_segmenter(output)


def test_contours_of_opencv_are_polygons() -> None:
    contours, _ = cv2.findContours(MASKS[0].astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    assert contours[0].shape == (4, 1, 2)
    region = rp.ImageRegion.from_polygon(contours[0])
    assert region.area == 39 * 24
    assert rp.ImageRegion.from_polygon(list(contours)).area == region.area


def test_polygons_of_shapely_keep_their_holes_and_parts() -> None:
    first = shapely.box(0, 0, 20, 10).difference(shapely.box(5, 2, 10, 6))
    both = shapely.union(first, shapely.box(30, 0, 40, 10))
    assert rp.ImageRegion.from_polygon(first).area == 180
    assert rp.ImageRegion.from_polygon(both).area == 280
    assert len(rp.ImageRegion.from_polygon(both).rings) == 3
    with pytest.raises(ValueError, match="LineString"):
        rp.ImageRegion.from_polygon(shapely.LineString([(0, 0), (1, 1)]))


class Open3DCloud:
    """A cloud as Open3D has it: vectors that numpy reads, colors up to 1."""

    points: Any = ((0.0, 0.0, 1.0), (1.0, 0.0, 1.0))
    colors: Any = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))


class Open3DMesh:
    """A mesh as Open3D has it."""

    vertices: Any = ((0.0, 0.0, 1.0), (1.0, 0.0, 1.0), (0.0, 1.0, 1.0))
    triangles: Any = ((0, 1, 2),)
    vertex_colors: Any = ()


def test_clouds_and_meshes_of_other_libraries_keep_colors_and_triangles() -> None:
    cloud = rp.Cloud.from_points(Open3DCloud())
    assert cloud.colors is not None and cloud.colors.tolist() == [[255, 0, 0], [0, 255, 0]]
    mesh = rp.Cloud.from_points(Open3DMesh())
    assert mesh.triangles is not None and mesh.triangles.tolist() == [[0, 1, 2]] and mesh.colors is None
    box = trimesh.creation.box()
    assert rp.Cloud.from_points(box).colors is None
    box.visual.vertex_colors = np.tile([10, 20, 30, 255], (8, 1))
    made = rp.Cloud.from_points(box)
    assert made.colors is not None and (made.colors == [10, 20, 30]).all()
    assert made.triangles is not None and len(made.triangles) == 12
    points = rp.Cloud.from_points(trimesh.PointCloud(np.ones((5, 3))))  # type: ignore[no-untyped-call]
    assert len(points) == 5 and points.triangles is None


def test_the_facets_of_a_box_are_its_six_sides_seen_from_outside() -> None:
    box = trimesh.creation.box((3.0, 2.0, 1.0))
    for mesh in (box, rp.Cloud.from_points(box.triangles.reshape(-1, 3), triangles=np.arange(36).reshape(-1, 3))):
        regions = rp.segment.regions_from_mesh(mesh)  # type: ignore[arg-type]
        assert [round(region.area, 9) for region in regions] == [6, 6, 3, 3, 2, 2]
        for region in regions:
            (ring,) = region.rings
            assert len(ring) == 4 and region.viewpoint is not None
            assert region.viewpoint @ ring.mean(axis=0) > 0.0


def test_a_plate_with_a_hole_keeps_it_and_an_open_sheet_has_no_side() -> None:
    x, y = np.meshgrid(np.arange(5.0), np.arange(4.0))
    cells = [5 * row + column for row in range(3) for column in range(4) if (row, column) != (1, 1)]
    faces = [face for one in cells for face in ((one, one + 1, one + 6), (one, one + 6, one + 5))]
    plate = SimpleNamespace(vertices=np.stack([x.ravel(), y.ravel(), 0.0 * x.ravel()], axis=1), faces=np.array(faces))
    (region,) = rp.segment.regions_from_mesh(plate)
    assert sorted(map(len, region.rings)) == [4, 4] and region.area == pytest.approx(11.0) and region.viewpoint is None
    sheet = rp.segment.regions_from_mesh(Open3DMesh())  # type: ignore[arg-type]
    assert len(sheet) == 1 and sheet[0].viewpoint is None


def test_a_sphere_has_no_facet_of_some_size() -> None:
    sphere = trimesh.creation.icosphere(subdivisions=4)
    with pytest.raises(ValueError, match="facets"):
        rp.segment.regions_from_mesh(sphere)


@pytest.mark.parametrize("given", [{"angle_deg": 0.0}, {"angle_deg": float("nan")}, {"min_area_fraction": 1.5}])
def test_limits_of_facets_out_of_range_are_named(given: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=next(iter(given))):
        rp.segment.regions_from_mesh(trimesh.creation.box(), **given)


def test_triangles_of_vertices_that_are_not_there_are_refused() -> None:
    mesh = SimpleNamespace(vertices=np.eye(3), faces=np.array([[0, 1, 5]]))
    with pytest.raises(ValueError, match="vertices"):
        rp.segment.regions_from_mesh(mesh)


def test_an_array_in_place_of_a_world_region_is_refused_with_the_constructors() -> None:
    with pytest.raises(ValueError, match="from_polygon"):
        rp.WorldRegion(np.zeros((4, 3)))  # type: ignore[arg-type]


def test_one_point_is_projected_like_many() -> None:
    camera = rp.PinholeCamera(300, 300, 30, 20)
    assert camera.project([0.1, 0.2, 1.0]).tolist() == camera.project([[0.1, 0.2, 1.0]])[0].tolist()
    assert camera.bearings([12.0, 7.0]).shape == (3,)


def test_a_cloud_is_taken_where_points_are() -> None:
    cloud = rp.Cloud.from_points([[5e5, 5.0, 1.0], [5e5 + 1.0, 5.0, 1.0]])
    assert cloud.origin.any() and np.asarray(cloud).tolist() == cloud.points.tolist()
    assert rp.Pose.identity().transform(cloud).tolist() == cloud.points.tolist()
