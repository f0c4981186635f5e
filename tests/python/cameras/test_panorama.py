"""Equirectangular panoramas: rays and pixels, the seam, and poses across it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from diagnostics import rig_of
from numpy.typing import NDArray
from PIL import Image, ImageDraw
from regionpose import (
    Frame,
    ImageRegion,
    Pose,
    WorldRegion,
    estimate_pose,
    estimate_rig,
)
from regionpose.cameras import EquirectangularCamera
from regionpose.io import region_from_file
from regionpose.io.yaml_text import to_yaml
from regionpose.scene.document import SceneError
from regionpose.scene.estimate import estimate_scene
from regionpose.scene.loading import load_scene
from regionpose.viz.overlays import overlay_regions, projected_lines
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]
CAMERA = EquirectangularCamera(2000, 1000)
POSE = Pose(Rotation.from_euler("xyz", [5.0, 175.0, -4.0], degrees=True), np.array([0.2, -0.1, 0.3]))
SHAPE = np.array([[0.0, 0.0], [1.4, 0.0], [1.4, 0.5], [0.6, 0.5], [0.6, 1.2], [0.0, 1.2]]) - [0.7, 0.6]


def seam_ring() -> Array:
    """A face of the world that the camera sees behind itself, across the seam."""
    behind = np.column_stack([SHAPE, 0.1 * SHAPE[:, 0] - 3.0])
    return POSE.inverse().transform(behind)


def side_ring() -> Array:
    beside = np.column_stack([np.full(6, 2.5), SHAPE[:, 1], 1.3 * SHAPE[:, 0]])
    return POSE.inverse().transform(beside)


def pixels_of(ring: Array) -> Array:
    """The outline (n, 2) with its edges split finely, columns going on across the seam."""
    shares = np.linspace(0.0, 1.0, 60, endpoint=False)[:, None]
    dense = np.concatenate([a + shares * (b - a) for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True)])
    pixels = CAMERA.project(POSE.transform(dense))
    pixels[:, 0] = np.unwrap(pixels[:, 0], period=CAMERA.width)
    return pixels


def turn_deg(pose: Pose) -> float:
    return float(np.degrees((pose.rotation * POSE.rotation.inv()).magnitude()))


def test_rays_and_pixels_are_inverse_all_around() -> None:
    directions = Rotation.random(2000, random_state=1).apply([0.0, 0.0, 1.0])
    pixels = CAMERA.project(directions)
    assert (pixels >= -0.5).all() and (pixels <= [1999.5, 999.5]).all()
    np.testing.assert_allclose(CAMERA.bearings(pixels), directions, atol=1e-12)


def test_axes_are_where_they_belong() -> None:
    axes = [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]
    seen = CAMERA.project(axes)
    np.testing.assert_allclose(seen[:, 0], [999.5, 1499.5, 999.5, 499.5], atol=1e-9)
    np.testing.assert_allclose(seen[:, 1], [499.5, 499.5, 999.5, 499.5], atol=1e-9)
    assert np.isnan(CAMERA.project([[0.0, 0.0, 0.0]])).all()


def test_columns_repeat_and_rows_end() -> None:
    here, there = CAMERA.bearings([[3.0, 200.0]]), CAMERA.bearings([[2003.0, 200.0]])
    np.testing.assert_allclose(here, there, atol=1e-12)
    assert np.isnan(CAMERA.bearings([[3.0, 1010.0]])).all()
    np.testing.assert_allclose(CAMERA.project_near(here, 1990.0), [[2003.0, 200.0]], atol=1e-9)


@pytest.mark.parametrize(
    ("size", "message"),
    [((100, 80), "height: found 80 for a width of 100; needed half the width"), ((0, 1), "width: found 0")],
)
def test_a_size_that_is_no_panorama_is_named(size: tuple[int, int], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        EquirectangularCamera(*size)


def test_an_image_half_a_pixel_higher_than_the_poles_is_seen_to_its_border() -> None:
    for width in range(3, 2000, 2):
        camera = EquirectangularCamera(width, (width + 1) // 2)
        assert np.isfinite(camera.bearings([[0.0, -0.5], [0.0, camera.height - 0.5]])).all(), width


def test_a_smaller_copy_is_resized() -> None:
    assert CAMERA.resized(1000, 500) == EquirectangularCamera(1000, 500)


def test_polygons_across_the_seam_give_the_pose() -> None:
    images = [ImageRegion.from_polygon(pixels_of(ring)) for ring in (seam_ring(), side_ring())]
    assert images[0].rings[0][:, 0].min() < 0.0 or images[0].rings[0][:, 0].max() > 2000.0
    worlds = [WorldRegion.from_polygon(ring) for ring in (seam_ring(), side_ring())]
    found = estimate_pose(CAMERA, images, worlds)
    assert turn_deg(found.pose) < 0.02
    assert np.linalg.norm(found.pose.camera_center - POSE.camera_center) < 1e-3


def seam_mask() -> NDArray[np.bool_]:
    picture = Image.new("L", (4000, 1000))
    ring = pixels_of(seam_ring())
    ring[:, 0] += 0.0 if ring[:, 0].min() >= 0.0 else 2000.0
    ImageDraw.Draw(picture).polygon([tuple(vertex) for vertex in ring], fill=1)
    whole = np.asarray(picture) > 0
    return whole[:, :2000] | whole[:, 2000:]


def test_a_mask_across_the_seam_is_one_region() -> None:
    mask = seam_mask()
    assert mask[:, 0].any() and mask[:, -1].any()
    region = ImageRegion.from_mask(mask, panorama=True)
    assert len(region.rings) == 1 and not np.concatenate(region.on_border(CAMERA)).any()
    assert region.area == pytest.approx(mask.sum(), rel=0.01)
    cut = ImageRegion.from_mask(mask)
    assert len(cut.rings) == 2
    worlds = [WorldRegion.from_polygon(ring) for ring in (seam_ring(), side_ring())]
    found = estimate_pose(CAMERA, [region, ImageRegion.from_polygon(pixels_of(side_ring()))], worlds)
    assert turn_deg(found.pose) < 0.2


def test_a_mask_of_every_column_is_refused() -> None:
    with pytest.raises(ValueError, match="mask covers every column of the panorama"):
        ImageRegion.from_mask(np.ones((10, 20), dtype=np.bool_), panorama=True)


def test_contours_across_the_seam_are_measured_in_pixels() -> None:
    frames = [
        Frame([ImageRegion.from_polygon(pixels_of(ring))], [WorldRegion.from_polygon(ring)], name)
        for name, ring in (("seam", seam_ring()), ("side", side_ring()))
    ]
    rig = estimate_rig(CAMERA, frames)
    assert max(fit.residual_px for fit in rig_of(rig).frames) < 0.2


def test_outlines_are_drawn_on_both_sides_of_the_seam() -> None:
    lines = projected_lines(CAMERA, WorldRegion.from_polygon(seam_ring()), POSE)
    assert all(np.abs(np.diff(line[:, 0])).max() < 100.0 for line in lines)
    inside = [((line[:, 0] >= 0.0) & (line[:, 0] < 2000.0)) for line in lines]
    seen = np.concatenate([line[within] for line, within in zip(lines, inside, strict=True)])
    assert seen[:, 0].min() < 20.0 and seen[:, 0].max() > 1980.0
    picture = np.full((1000, 2000, 3), 128, dtype=np.uint8)
    drawn = overlay_regions(CAMERA, picture, [], [WorldRegion.from_polygon(seam_ring())], POSE, ["face"])
    assert (drawn[:, :20] != 128).any() and (drawn[:, -20:] != 128).any()


def panorama_scene(folder: Path, mask: str = "mask.png", beside: Array | None = None) -> Path:
    """A scene file of a face across the seam, by its mask, and one beside it, by a polygon."""
    Image.fromarray(np.full((1000, 2000, 3), 128, dtype=np.uint8)).save(folder / "image.png")
    Image.fromarray(np.where(seam_mask(), 255, 0).astype(np.uint8)).save(folder / "mask.png")
    polygon = pixels_of(side_ring()) if beside is None else beside
    regions: list[dict[str, Any]] = [
        {"name": "behind", "image": {"mask": mask}, "world": {"polygon": seam_ring().tolist()}},
        {"name": "beside", "image": {"polygon": polygon.tolist()}, "world": {"polygon": side_ring().tolist()}},
    ]
    camera = {"model": "equirectangular", "width": 2000, "height": 1000}
    path = folder / "scene.yaml"
    path.write_text(to_yaml({"camera": camera, "image": "image.png", "regions": regions}), encoding="utf-8")
    return path


def test_a_scene_of_a_panorama(tmp_path: Path) -> None:
    assert turn_deg(estimate_scene(load_scene(panorama_scene(tmp_path))).estimate.pose) < 0.2


def test_a_mask_of_another_size_is_refused(tmp_path: Path) -> None:
    path = panorama_scene(tmp_path, "small.png")
    Image.fromarray(np.where(seam_mask(), 255, 0).astype(np.uint8)).resize((1000, 500), Image.Resampling.NEAREST).save(
        tmp_path / "small.png"
    )
    with pytest.raises(SceneError, match=r"image.mask: .*found masks of 1000 x 500 pixels; needed 2000 x 1000"):
        estimate_scene(load_scene(path))


def test_polygons_of_a_file_keep_their_vertices_and_join_at_the_seam(tmp_path: Path) -> None:
    halves = [
        [0.0, 400.0, 90.0, 400.0, 90.0, 500.0, 0.0, 500.0],
        [1900.0, 400.0, 2000.0, 400.0, 2000.0, 500.0, 1900.0, 500.0],
    ]
    whole = [500.0, 400.0, 600.0, 400.0, 550.0, 490.0]
    entries = [{"id": k, "image_id": 1, "segmentation": part} for k, part in enumerate((halves, [whole]), start=1)]
    image = {"id": 1, "width": 2000, "height": 1000}
    path = tmp_path / "coco.json"
    path.write_text(json.dumps({"images": [image], "annotations": entries}), encoding="utf-8")
    joined, single = (region_from_file(path, label, panorama=True) for label in (1, 2))
    assert len(joined.rings) == 1 and joined.area == pytest.approx(19_000.0, rel=0.01)
    np.testing.assert_allclose(single.area, 4500.0)
    assert len(single.rings[0]) == 3


def test_a_vertex_below_a_panorama_is_named_not_one_beyond_its_sides(tmp_path: Path) -> None:
    ring = np.array([[-300.0, 400.0], [100.0, 400.0], [100.0, 1010.0]])
    with pytest.raises(SceneError, match=r"found \[100, 1010\] outside the photo of 2000 x 1000"):
        estimate_scene(load_scene(panorama_scene(tmp_path, beside=ring)))
