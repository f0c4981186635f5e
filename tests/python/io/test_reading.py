"""Damaged and outsized files: each reader's own error, which names the file, before memory is taken."""

from __future__ import annotations

import io
import json
import os
import re
import resource
import struct
import subprocess
import sys
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from regionpose.cameras import PinholeCamera
from regionpose.cli.info import file_facts
from regionpose.io.calibrations import CalibrationError, load_camera, load_lidar_pose
from regionpose.io.calibrations.poses import read_pose
from regionpose.io.clouds import CloudError, cloud_from_depth, read_cloud
from regionpose.io.masks.readers import coverage_from_file, masks_from_file
from regionpose.io.reading import FileError, read_array, read_json
from regionpose.scene.document import SceneError
from regionpose.scene.exposure import scene_sides
from regionpose.scene.loading import load_scene
from regionpose.scene.sensors import read_picture
from scene_files import scene_values, write_scene

ROOT = Path(__file__).parents[3]
SAMPLES = Path(__file__).parents[1] / "samples"


def npy(array: object) -> bytes:
    """The array as a file."""
    buffer = io.BytesIO()
    np.save(buffer, np.asarray(array), allow_pickle=True)
    return buffer.getvalue()


def npy_header(text: str) -> bytes:
    """A .npy file of a header alone."""
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text.encode()


def archive(members: dict[str, bytes]) -> bytes:
    """A ZIP archive."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as held:
        for name, content in members.items():
            held.writestr(name, content)
    return buffer.getvalue()


def png_header(width: int, height: int, color: int) -> bytes:
    """A PNG of 8 bits that states a size and holds nothing. `color`: 0 gray, 6 RGBA."""
    held = b"IHDR" + struct.pack(">II5B", width, height, 8, color, 0, 0, 0)
    chunks = b"".join(
        struct.pack(">I", len(part) - 4) + part + struct.pack(">I", zlib.crc32(part)) for part in (held, b"IDAT")
    )
    return b"\x89PNG\r\n\x1a\n" + chunks


def png() -> bytes:
    """A whole PNG."""
    buffer = io.BytesIO()
    Image.fromarray(np.zeros((9, 9), dtype=np.uint8)).save(buffer, format="PNG")
    return buffer.getvalue()


def glb(held: object) -> bytes:
    """A GLB file of its description alone."""
    text = json.dumps(held).encode()
    text += b" " * (-len(text) % 4)
    return struct.pack("<4sIII4s", b"glTF", 2, 20 + len(text), len(text), b"JSON") + text


def coco(**annotation: object) -> bytes:
    """A COCO file of one annotation, over an image of 8 x 8 pixels unless it says otherwise."""
    side = annotation.pop("side", 8)
    entry = {"id": 1, "image_id": 1, "category_id": 1, "segmentation": [[1, 1, 5, 1, 5, 5]], **annotation}
    image = {"id": 1, "height": side, "width": side}
    return json.dumps({"images": [image], "categories": [{"id": [], "name": {}}], "annotations": [entry]}).encode()


PCD = b"VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA binary\n"
PLY = b"ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
DIGITS = b"7" * 5000
LABELME = b'{"imageHeight": 8, "imageWidth": 8, "shapes": [{"label": "a", "points": [[1, 1], [5, 1], [5, 5]]}]}'
HUGE = npy_header(f"{{'descr': '<f8', 'fortran_order': False, 'shape': ({1 << 45},)}}")


def depth(path: Path) -> object:
    """A depth image's cloud."""
    return cloud_from_depth(PinholeCamera(9.0, 9.0, 4.0, 4.0), path, unit_m=0.001)


KITTI = (SAMPLES / "kitti_object.txt").read_bytes()

Case = tuple[str, bytes, Callable[[Path], object], type[ValueError], str]
CASES: list[Case] = [
    # What promises more than the file holds
    ("a.npy", HUGE, read_pose, FileError, "array: found 0 bytes; needed 281474976710656 for float64 of shape"),
    ("b.npz", archive({"a.npy": HUGE}), read_array, FileError, "a.npy: found 0 bytes; needed"),
    ("c.npz", archive({"points.npy": bytes(110_000_000)}), read_cloud, CloudError, "archive: found 110000000 bytes"),
    ("ca.npz", archive({"points.npy": npy(np.zeros((5_000_000, 3), dtype="u1"))}), read_cloud, CloudError,
     "archive: found 120000000 bytes"),
    ("d.png", png_header(10_000, 12_000, 6), read_picture, FileError, "10000 x 12000 pixels: found 480000000 bytes"),
    ("e.png", png_header(40_000, 40_000, 0), masks_from_file, FileError, "found no picture .DecompressionBombError"),
    ("f.png", png_header(10_000, 12_000, 0), depth, CloudError, "10000 x 12000 pixels: found 3000000000 bytes"),
    ("g.png", png_header(10_000, 12_000, 6), file_facts, FileError, "10000 x 12000 pixels: found"),
    ("h.json", coco(side=50_000, segmentation={"size": [50_000, 50_000], "counts": [2_500_000_000]}),
     masks_from_file, ValueError, "masks of 50000 x 50000 pixels: found 2500000000 bytes"),
    ("i.json", coco(segmentation={"size": [8, 8], "counts": "o" * 9000}), masks_from_file, ValueError, "64 bits"),
    ("j.glb", glb({"asset": {"version": "2.0"}, "accessors": [{"count": 10**9, "type": "VEC3"}]}),
     read_cloud, CloudError, "accessors: found 12000000000 bytes"),
    # Numbers of many digits
    ("k.pcd", PCD.replace(b"WIDTH 2", b"WIDTH " + DIGITS), read_cloud, CloudError, "WIDTH: found 777"),
    ("l.pcd", PCD.replace(b"COUNT 1", b"COUNT 99999999999"), read_cloud, CloudError, "field x: found TYPE F"),
    ("m.pcd", PCD.replace(b"COUNT 1 1", b"COUNT 65000 65000"), read_cloud, CloudError, "COUNT: found 130001 values"),
    ("n.xyz", DIGITS + b"\n1 2 3\n4 5 6\n", read_cloud, CloudError, "line 1: found '777"),
    ("n.ply", PLY.replace(b"vertex 2", b"vertex " + DIGITS), read_cloud, CloudError, "header: found 'element vertex 7"),
    ("o.json", b'{"a": ' + DIGITS + b"}", read_json, FileError, "found a number of thousands of digits"),
    ("p.json", b'{"camera": ' + DIGITS + b"}", load_scene, SceneError, "found a number of thousands of digits"),
    # Values of another kind
    ("q.npy", npy(np.zeros((), dtype="f8")), read_pose, ValueError, "found 1 values of type float64"),
    ("r.npy", npy(np.array([{}], dtype=object)), read_pose, FileError, "found object values; needed numbers"),
    ("s.npy", npy(np.eye(4))[:60], read_pose, FileError, "array: found damage"),
    ("t.npz", archive({}), read_array, FileError, "found 0 arrays; needed one"),
    ("u.npz", archive({"a.npy": b"x"})[:-30], read_array, FileError, "archive: found damage .BadZipFile"),
    ("v.json", b'{"camera_from_world": {"matrix": {"a": 1}}}', read_pose, ValueError, "something else than numbers"),
    ("w.json", b'{"camera_from_world": {"matrix": [[1], [2, 3]]}}', read_pose, ValueError, "something else than"),
    ("x.json", b'{"T_lidar_camera": [{}, 0, 0, 0, 0, 0, 1]}', read_pose, ValueError, "something else than numbers"),
    ("y.json", b'{"T_lidar_camera": [0, 0, 0, 0, 0, 0, 1e-320]}', read_pose, ValueError, r"needed \[tx, ty, tz"),
    ("z.json", b'{"a": "\\ud800"}', read_json, FileError, "found half of a surrogate pair"),
    ("aa.yaml", b'camera: "\\ud800"', load_scene, SceneError, ":1:12: found .d800.; needed a character, not half"),
    ("al.yaml", b"[" * 90_000, load_scene, SceneError, "found more than 100 levels; needed fewer"),
    ("ab.yaml", b"camera: {model: [pinhole]}\nimage: a\nregions: []", load_scene, SceneError, r"found model \["),
    ("ac.yaml", b"prior: {up: [0, 0, " + b"9" * 400 + b"]}", load_scene, SceneError, "and 1 more"),
    ("ad.json", coco(category_id=[1]), masks_from_file, ValueError, ""),
    ("ae.json", LABELME.replace(b"8,", b"true,", 1), masks_from_file, ValueError, "imageHeight True"),
    ("af.json", LABELME.replace(b"8,", b"9" * 40 + b",", 1), masks_from_file, ValueError, "imageHeight 9999"),
    ("ag.json", LABELME.replace(b"[1, 1]", b"[1, " + b"9" * 400 + b"]"), masks_from_file, ValueError, "pairs"),
    ("ah.json", b'{"format": "regionpose result 2", "warnings": 3}', file_facts, ValueError, "warnings: found"),
    ("ai.png", png()[:20], read_picture, FileError, "found no picture"),
    ("aj.png", png()[:-40], masks_from_file, FileError, "found no picture"),
    ("ak.txt", KITTI.replace(b"7.1e+02 0", b"0 0"), load_lidar_pose, CalibrationError, "found one that is singular"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "content", "read", "kind", "said"), CASES, ids=[case[0] for case in CASES])
def test_a_file_that_cannot_be_used_is_named(
    name: str, content: bytes, read: Callable[[Path], object], kind: type[ValueError], said: str, tmp_path: Path
) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    if not said:
        assert read(path)
        return
    with pytest.raises(kind, match=said) as caught:
        read(path)
    assert name in str(caught.value)
    assert type(caught.value) is kind


@pytest.mark.parametrize("values", [np.zeros(()), np.zeros((3, 3), dtype=[("x", "f4")]), np.array(["a", "b"])])
def test_arrays_of_another_kind_are_no_points(values: object, tmp_path: Path) -> None:
    held = scene_values()
    held["regions"][0]["world"] = {"points": "points.npy"}
    (tmp_path / "points.npy").write_bytes(npy(values))
    with pytest.raises(SceneError, match=r"points\.npy: found .* needed points \(n, 3\), or indices"):
        scene_sides(load_scene(write_scene(tmp_path, held)))


def test_a_file_name_too_long_for_the_system_is_a_missing_file(tmp_path: Path) -> None:
    path = write_scene(tmp_path, scene_values() | {"image": "9" * 5000})
    assert [len(Path(name).name) for name in file_facts(path)["missing_files"]] == [5000]


def laz(count: int = 20) -> bytearray:
    """A LAZ file of some points in one chunk, of a point format in layers."""
    laspy = pytest.importorskip("laspy")
    pytest.importorskip("lazrs")
    stored = laspy.LasData(laspy.LasHeader(version="1.4", point_format=6))
    stored.x, stored.y, stored.z = np.random.default_rng(1).uniform(0.0, 9.0, (3, 1)) * np.ones(count)
    buffer = io.BytesIO()
    stored.write(buffer, do_compress=True, laz_backend=laspy.LazBackend.Lazrs)
    return bytearray(buffer.getvalue())


def test_a_laz_file_whose_layers_are_longer_than_it_is_refused_before_memory_is_taken(tmp_path: Path) -> None:
    """A layer's size of 4 GB made lazrs take that much, or abort the process."""
    content = laz()
    points_at = struct.unpack_from("<I", content, 96)[0]
    sizes_at = points_at + 8 + 30 + 4
    struct.pack_into("<I", content, sizes_at + 4, 0xFFFFFF00)
    path = tmp_path / "cloud.laz"
    path.write_bytes(content)
    assert len(content) < 2000
    held = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(CloudError, match=r"cloud\.laz: compressed chunk: found layers up to byte 429496"):
        read_cloud(path)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - held < 50_000


def test_a_laz_file_of_more_points_than_likely_is_refused(tmp_path: Path) -> None:
    content = laz()
    struct.pack_into("<Q", content, 247, 30_000_000)
    path = tmp_path / "cloud.laz"
    path.write_bytes(content)
    with pytest.raises(CloudError, match=r"cloud\.laz: "):
        read_cloud(path)


@pytest.mark.parametrize("kind", ["laz", "e57"])
def test_scans_are_compared_with_the_budget(kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A budget below what 2,000 equal points take, which compress to little."""
    monkeypatch.setattr("regionpose.io.reading.FREE_BYTES", 1000)
    monkeypatch.setattr("regionpose.io.reading.MOST_RATIO", 1)
    path = tmp_path / f"cloud.{kind}"
    if kind == "laz":
        path.write_bytes(laz(2000))
    else:
        pye57 = pytest.importorskip("pye57")
        file = pye57.E57(str(path), mode="w")
        file.write_scan_raw({f"cartesian{axis}": np.ones(2000) for axis in "XYZ"})
        file.close()
    with pytest.raises(
        CloudError, match=rf"cloud\.{kind}: (points|scans): found \d+ bytes in a file of \d+; needed at most"
    ):
        read_cloud(path)


def test_a_large_mask_of_few_bytes_is_read(tmp_path: Path) -> None:
    """60 megapixels in 60 kB: within the budget of any file."""
    mask = np.zeros((7000, 9000), dtype=np.uint8)
    mask[100:200, 100:200] = 255
    Image.fromarray(mask).save(tmp_path / "mask.png")
    (found,) = masks_from_file(tmp_path / "mask.png").values()
    assert np.array_equal(found, mask > 0)


def test_a_mask_of_shares_counts_as_what_its_region_keeps(tmp_path: Path) -> None:
    """Shares take eight times the bytes of their levels: 60 megapixels in 60 kB are too many."""
    levels = np.zeros((7000, 9000), dtype=np.uint8)
    levels[100:200, 100:200] = 128
    path = tmp_path / "shares.png"
    Image.fromarray(levels).save(path)
    with pytest.raises(FileError, match=r"shares\.png: 9000 x 7000 pixels: found 126000000 bytes in a file of"):
        coverage_from_file(path, levels.shape)


OF_ALL_LABELS = """
import resource, sys
import regionpose as rp
rp.io.masks_from_file, rp.io.regions_from_file
held = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
io = rp.io
for read, size in ((io.masks_from_file, lambda mask: mask.sum()), (io.regions_from_file, lambda region: region.area)):
    print(*(round(size(each)) for each in read(sys.argv[1]).values()))
print((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - held) // 1000)
"""


def test_the_masks_of_a_large_label_image_are_not_all_in_memory(tmp_path: Path) -> None:
    """Twenty labels of 24 megapixels, each as wide as the image: 480 MB of masks in a file of 40 kB."""
    labels = np.zeros((4000, 6000), dtype=np.uint8)
    for row in range(20):
        labels[200 * row + 20 : 200 * row + 180, 20:-20] = row + 1
        labels[20 * row + 1 : 20 * row + 10, 1], labels[-20 * row - 10, -2] = row + 1, row + 1
    Image.fromarray(labels).save(tmp_path / "labels.png")
    command = [sys.executable, "-c", OF_ALL_LABELS, str(tmp_path / "labels.png")]
    said = subprocess.run(command, capture_output=True, text=True, timeout=100, check=True).stdout.splitlines()
    pixels, areas = (np.array(line.split(), dtype=int) for line in said[:2])
    assert pixels.tolist() == [160 * 5960 + 10] * 20 and np.abs(areas - pixels).max() < 20
    assert int(said[2]) < 150, "MB more than before: the file takes 24, PIL as much"


@pytest.mark.slow
def test_mutated_files_are_read_or_refused() -> None:
    """Some of every kind; `make fuzz` takes more."""
    command = [sys.executable, str(ROOT / "fuzz" / "readers.py"), "--files", "400", "--seed", "11"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stdout
    assert re.match(r"400 files of \d+ kinds .* 0 finds", done.stdout)


def readers() -> dict[str, Callable[[Path], object]]:
    """What reads each kind of file, by a name of one."""
    camera = PinholeCamera(10.0, 10.0, 1.0, 1.0)
    return {
        **{
            f"a{ending}": read_cloud
            for ending in (".ply", ".pcd", ".las", ".e57", ".npy", ".npz", ".bin", ".xyz", ".stl")
        },
        "a.png": read_picture,
        "depth.png": lambda path: cloud_from_depth(camera, path, unit_m=1e-3),
        "calib.yaml": load_camera,
        "scene.yaml": load_scene,
        "a.mcap": lambda path: read_cloud(f"{path}#/points"),
        "b.bag": lambda path: read_picture(Path(f"{path}#/camera")),
        "indices.npy": read_array,
        "pose.json": read_json,
        "masks.json": masks_from_file,
    }


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes are POSIX's")
@pytest.mark.parametrize("name", readers())
def test_pipes_and_devices_are_refused_before_they_are_read(name: str, tmp_path: Path) -> None:
    read = readers()[name]
    for folder, what in (("pipe", "a pipe"), ("device", "a device")):
        (tmp_path / folder).mkdir()
        path = tmp_path / folder / name
        if what == "a pipe":
            os.mkfifo(path)
        else:
            path.symlink_to("/dev/zero")
        with pytest.raises(ValueError, match=rf"{name}.*: found {what}; needed a file"):
            read(path)
