"""Whole files of every kind that is read, small, and the reader of each."""

from __future__ import annotations

import io
import json
import struct
import sys
import tempfile
from base64 import b64encode
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import seals
from PIL import Image
from regionpose.io.yaml_text import to_yaml

# What writes bags is the tests'.
sys.path.append(str(Path(__file__).parents[1] / "tests" / "python" / "support"))
from bag_files import filled, livox_bag
from bare_rows import scanned_rows
from calibration_files import FILES as CAMERAS
from pose_files import FILES as POSES

Reader = Callable[[Path], object]


class Sample(NamedTuple):
    """A whole file: its name, whose ending counts, its content, what reads it, and what puts its checksums right."""

    name: str
    content: bytes
    read: Reader
    seal: Callable[[bytes], bytes] = seals.as_given


POINTS = np.random.default_rng(7).uniform(-5.0, 5.0, (24, 3))
LABELS = np.zeros((12, 16), dtype=np.uint8)
LABELS[2:6, 2:8], LABELS[7:11, 9:15] = 1, 2
REGIONS = [
    {"name": "a", "image": {"mask": "m.png", "label": 1}, "world": {"points": "p.npy", "label": 2}},
    {"name": "b", "image": {"seed": [3, 4], "tolerance": 2.0}, "world": {"seed": [1, 2, 3], "viewpoint": [0, 0, 0]}},
    {
        "name": "c",
        "image": {"polygon": [[0, 0], [9, 0], [9, 9]], "hidden_edges": [1]},
        "world": {"polygon": [[0, 0, 0], [1, 0, 0], [0, 1, 0]]},
    },
]
SCENE = {
    "camera": {"file": "calib.yaml", "name": "K", "model": "fisheye"},
    "image": "image.png",
    "cloud": "cloud.ply",
    "sensor_origin": [0, 0, 0],
    "regions": REGIONS,
    "prior": {"up": [0, 0, 1], "initial": {"camera_from_world": {"matrix": np.eye(4).tolist()}}},
    "solver": {"system": "plane", "start": "global"},
}
COCO = {
    "images": [{"id": 1, "file_name": "a.png", "height": 12, "width": 16}],
    "categories": [{"id": 3, "name": "door"}],
    "annotations": [
        {"id": 5, "image_id": 1, "category_id": 3, "segmentation": [[1, 1, 9, 1, 9, 9]]},
        {"id": 6, "image_id": 1, "category_id": 3, "segmentation": {"size": [12, 16], "counts": [20, 30, 142]}},
        {"id": 7, "image_id": 1, "category_id": 4, "segmentation": {"size": [12, 16], "counts": "d0n0^4"}},
    ],
}
LABELME = {
    "imageHeight": 12,
    "imageWidth": 16,
    "shapes": [
        {"label": "door", "points": [[1, 1], [9, 1], [9, 9]], "shape_type": "polygon"},
        {"label": "sign", "points": [[1, 1], [5, 4]], "shape_type": "rectangle"},
    ],
}
RUNS = {"size": [12, 16], "counts": [20, 30, 142]}
SAM = [{"segmentation": RUNS, "area": 30}, {"segmentation": {"size": [12, 16], "counts": "d0n0^4"}, "area": 30}]
SIZE = {"original_width": 16, "original_height": 12, "image_rotation": 0}
BRUSH = [0, 0, 3, 0, 57, 27, 255, 1, 19, 0, 195, 127, 248, 140, 3, 13, 255, 226, 48, 12, 55, 255, 192, 83, 192, 0]
"""As Label Studio packs 12 x 16 pixels of which three rows of seven are covered."""
LABEL_STUDIO = [
    {
        "id": 1,
        "data": {"image": "/data/upload/photo.png"},
        "annotations": [
            {
                "result": [
                    {**SIZE, "value": {"points": [[5, 5], [80, 10], [60, 90]], "polygonlabels": ["door"]}},
                    {**SIZE, "value": {"x": 10, "y": 10, "width": 50, "height": 40, "rectanglelabels": ["sign"]}},
                    {**SIZE, "value": {"format": "rle", "rle": BRUSH, "brushlabels": ["lamp"]}},
                ]
            }
        ],
    }
]
CVAT = """<?xml version="1.0" encoding="utf-8"?>
<annotations><version>1.1</version><image id="0" name="photo.png" width="16" height="12">
<polygon label="door" points="1.00,1.00;9.00,1.00;9.00,9.00"></polygon>
<box label="sign" xtl="1.0" ytl="2.0" xbr="8.5" ybr="9.0" rotation="10.00"></box>
<mask label="lamp" rle="1, 4, 1" left="2" top="3" width="3" height="2"></mask>
</image></annotations>
"""
POSE = {
    "format": "regionpose result 1",
    "camera_from_world": {"matrix": np.eye(4).tolist()},
    "regions": [{"name": "a"}],
}
CALIBRATION = {"K": [[300, 0, 8], [0, 300, 6], [0, 0, 1]], "D": [0.1, 0, 0, 0], "width": 16, "height": 12}


def samples(calibrations: Path) -> list[Sample]:
    """One file of each kind; `calibrations`: the folder of the tests' own."""
    return [*_clouds(), *_pictures(), *_texts(), *_arrays(), *_bags(), *_calibrations(calibrations)]


def _clouds() -> list[Sample]:
    from regionpose.io.clouds import Cloud, read_cloud

    cloud = Cloud(POINTS, colors=np.full((24, 3), 9, np.uint8), intensity=np.arange(24.0), triangles=_triangles())
    files = {
        "binary.ply": _stored(cloud, "ply"),
        "ascii.ply": _ascii_ply(),
        "ascii.pcd": _pcd("ascii", "\n".join(" ".join(map(str, row)) for row in POINTS).encode()),
        "binary.pcd": _pcd("binary", POINTS.astype("<f4").tobytes()),
        "packed.pcd": _pcd("binary_compressed", _packed(POINTS.T.astype("<f4").tobytes())),
        "cloud.npy": _npy(POINTS),
        "named.npy": _npy(np.zeros(3, dtype=[("x", "f4"), ("y", "f4"), ("z", "f4")])),
        "cloud.npz": _npz(points=POINTS, intensity=np.arange(24.0)),
        "turn.bin": scanned_rows(200, "intensity").tobytes(),
        "waymo.bin": scanned_rows(1500, "intensity", "elongation", "stamp").tobytes(),
        "sweep.pcd.bin": scanned_rows(30, "reflectivity", "ring").tobytes(),
        "grid.pcd": _organized_pcd(),
        "marked.xyz": b"\xef\xbb\xbfx,y,z\n" + "\n".join(",".join(map(str, row)) for row in POINTS).encode(),
        "marked.ply": b"\xef\xbb\xbf" + _ascii_ply(),
        "cloud.xyz": b"x y z\n" + "\n".join(" ".join(map(str, row)) for row in POINTS).encode(),
        "cloud.las": _las("las"),
        "cloud.laz": _las("laz"),
        "cloud.e57": _e57(),
        **{f"mesh.{kind}": _mesh(kind) for kind in ("obj", "stl", "glb")},
    }
    sealed = [
        Sample("sealed.e57", files["cloud.e57"], read_cloud, seals.e57),
        Sample("sealed.npz", files["cloud.npy"], read_cloud, seals.zipped),
    ]
    return [*(Sample(name, content, read_cloud) for name, content in files.items()), *sealed]


def _every_mask(path: Path) -> int:
    """How many pixels the masks of a file cover, each made and dropped."""
    from regionpose.io.masks.readers import masks_from_file

    return sum(int(mask.sum()) for mask in masks_from_file(path).values())


def _pictures() -> list[Sample]:
    from regionpose.cameras import PinholeCamera
    from regionpose.io.clouds import cloud_from_depth
    from regionpose.scene.sensors import read_picture

    camera = PinholeCamera(20.0, 20.0, 8.0, 6.0)
    depth = partial(cloud_from_depth, camera, unit_m=0.001)
    kinds = {"png": {}, "gif": {}, "tiff": {"compression": "tiff_deflate"}, "jpeg": {}, "webp": {}, "bmp": {}}
    photos = [
        Sample(f"photo.{kind}", _image(LABELS * 90, kind, **given), read_picture) for kind, given in kinds.items()
    ]
    colors = np.stack([LABELS * 50, LABELS * 20, LABELS], axis=2)
    return [
        *photos,
        Sample("labels.png", _image(LABELS, "png"), _every_mask),
        Sample("sealed.png", _image(LABELS, "png"), _every_mask, seals.png),
        Sample("sealed_photo.png", _image(colors, "png"), read_picture, seals.png),
        Sample("sealed_depth.png", _image(LABELS.astype(np.uint16) * 1000, "png"), depth, seals.png),
        Sample("colors.png", _image(colors, "png"), _every_mask),
        Sample("labels.tiff", _image(LABELS, "tiff"), _every_mask),
        Sample("depth.png", _image(LABELS.astype(np.uint16) * 1000, "png"), depth),
        Sample("depth.tiff", _image(LABELS.astype(np.float32), "tiff"), depth),
    ]


def _labeled() -> dict[str, object]:
    """Files of labeling tools in JSON, by name."""
    pixels = b64encode(_image(LABELS[:4, :5] > 1, "png")).decode()
    shapes = [
        {"label": "lamp", "points": [[3, 2], [7, 5]], "shape_type": "mask", "mask": pixels},
        {"label": "wall", "points": [[1, 1], [15, 1], [15, 11], [1, 11]], "group_id": 1},
        {"label": "wall", "points": [[4, 4], [9, 4], [9, 8]], "group_id": 1},
        {"label": "__hole__", "points": [[10, 4], [12, 4], [12, 8]]},
    ]
    return {
        "labelme.json": LABELME,
        "labelme_masks.json": {**LABELME, "shapes": [*LABELME["shapes"], *shapes]},
        "sam.json": SAM,
        "sa_1b.json": {"image": {"width": 16, "height": 12}, "annotations": [{**SAM[0], "id": 4}]},
        "label_studio.json": LABEL_STUDIO,
    }


def _texts() -> list[Sample]:
    from regionpose.cli.info import file_facts
    from regionpose.io.calibrations.poses import read_pose
    from regionpose.io.masks.readers import regions_from_file
    from regionpose.scene.loading import load_scene

    lidar = {"results": {"T_lidar_camera": [1, 2, 3, 0, 0, 0, 1]}}
    matrix = "\n".join(" ".join(map(str, row)) for row in np.eye(4))
    return [
        Sample("scene.yaml", to_yaml(SCENE).encode(), load_scene),
        Sample("scene.json", _json(SCENE), load_scene),
        Sample("facts.yaml", to_yaml(SCENE).encode(), file_facts),
        Sample("coco.json", _json(COCO), _every_mask),
        Sample("coco_regions.json", _json(COCO), regions_from_file),
        *(Sample(name, _json(content), _every_mask) for name, content in _labeled().items()),
        Sample("cvat.xml", CVAT.encode(), _every_mask),
        Sample("cvat_regions.xml", CVAT.encode(), regions_from_file),
        Sample("pose.json", _json(POSE), read_pose),
        Sample("lidar.json", _json(lidar), read_pose),
        Sample("result.json", _json(POSE), file_facts),
        Sample("pose.txt", matrix.encode(), read_pose),
        *(Sample(f"pose_{name}", text.encode(), read_pose) for name, (text, _) in POSES.items()),
    ]


def _arrays() -> list[Sample]:
    from regionpose.io.calibrations.poses import read_pose
    from regionpose.io.reading import read_array

    return [
        Sample("pose.npy", _npy(np.eye(4)), read_pose),
        Sample("indices.npy", _npy(np.arange(9)), read_array),
        Sample("mask.npz", _npz(mask=np.arange(9) > 3), read_array),
    ]


def _topic(path: Path, topic: str) -> object:
    from regionpose.io.clouds import read_cloud

    return read_cloud(f"{path}#{topic}")


def _calibration(path: Path, topic: str) -> object:
    from regionpose.io.calibrations import load_camera

    return load_camera(f"{path}#{topic}")


def _livox(kind: str) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        return livox_bag(Path(folder), kind=kind).read_bytes()


def _bags() -> list[Sample]:
    from regionpose.cli.info import file_facts
    from regionpose.io.clouds import read_cloud
    from regionpose.scene.sensors import read_picture

    def scan(path: Path) -> object:
        return read_cloud(f"{path}#/points@0x2")

    def picture(path: Path) -> object:
        return read_picture(Path(f"{path}#/camera@0.2"))

    files = {"plain.bag": _bag("ros1"), "bz2.bag": _bag("ros1", "BZ2"), "lz4.bag": _bag("ros1", "LZ4")}
    files |= {
        "sqlite.db3": _bag("sqlite file"),
        "plain.mcap": _bag("mcap file"),
        "zstd.mcap": _bag("mcap file", "STORAGE"),
    }
    livox = [
        Sample(f"livox_{kind}.{ending}", _livox(kind), partial(_topic, topic="/livox/lidar"))
        for kind, ending in (("ros1", "bag"), ("mcap file", "mcap"))
    ]
    cameras = [
        Sample(f"camera_{kind}.{ending}", _livox(kind), partial(_calibration, topic="/camera/camera_info"))
        for kind, ending in (("ros1", "bag"), ("mcap file", "mcap"))
    ]
    facts = [Sample(f"facts_{name}", content, file_facts) for name, content in files.items()]
    # What one reader is shown, the other is shown too, under another name.
    pictures = [Sample(f"picture_{name}", content, picture) for name, content in files.items()]
    return [*(Sample(name, content, scan) for name, content in files.items()), *pictures, *livox, *cameras, *facts]


def _calibrations(folder: Path) -> list[Sample]:
    from regionpose.io.calibrations import load_camera, load_lidar_pose

    held = [Sample(path.name, path.read_bytes(), load_camera) for path in sorted(folder.iterdir())]
    lidar = [
        each._replace(name=f"lidar_{each.name}", read=load_lidar_pose) for each in held if each.name.startswith("kitti")
    ]
    others = [
        Sample(f"camera_{file}", text.encode(), partial(load_camera, name=name))
        for file, (text, name, _, _) in CAMERAS.items()
    ]
    return [*held, *others, *lidar, Sample("opencv.json", _json(CALIBRATION | {"model": "pinhole"}), load_camera)]


def _bag(kind: str, packed: str | None = None) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        return filled(kind, packed).write(Path(folder)).read_bytes()


def _triangles() -> Any:
    return np.arange(24).reshape(8, 3)


def _stored(cloud: Any, kind: str) -> bytes:
    from regionpose.io.clouds import write_ply

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"cloud.{kind}"
        write_ply(path, cloud)
        return path.read_bytes()


def _ascii_ply() -> bytes:
    head = "ply\nformat ascii 1.0\nelement vertex 24\nproperty float x\nproperty float y\nproperty float z\n"
    head += "element face 8\nproperty list uchar int vertex_indices\nend_header\n"
    rows = [" ".join(map(str, row)) for row in POINTS] + [f"3 {a} {b} {c}" for a, b, c in _triangles()]
    return (head + "\n".join(rows) + "\n").encode()


def _pcd(form: str, body: bytes) -> bytes:
    head = "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 24\nHEIGHT 1\n"
    return (head + f"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 24\nDATA {form}\n").encode() + body


def _organized_pcd() -> bytes:
    head = "VERSION 0.7\nFIELDS x y z _ intensity _\nSIZE 4 4 4 1 4 1\nTYPE F F F U F U\nCOUNT 1 1 1 4 1 0\n"
    head += "WIDTH 6\nHEIGHT 4\nVIEWPOINT 1 0 0 1 0 0 0\nPOINTS 24\nDATA binary\n"
    rows = np.zeros((24, 5), "<f4")
    rows[2:, :3] = POINTS[2:]
    return head.encode() + rows.tobytes()


def _packed(plain: bytes) -> bytes:
    runs = [plain[start : start + 32] for start in range(0, len(plain), 32)]
    packed = b"".join(bytes([len(run) - 1]) + run for run in runs)
    return struct.pack("<II", len(packed), len(plain)) + packed


def _npy(array: Any) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, array)
    return buffer.getvalue()


def _npz(**arrays: Any) -> bytes:
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()


def _json(value: object) -> bytes:
    return json.dumps(value, indent=1).encode()


def _image(pixels: Any, kind: str, **options: Any) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, format=kind, **options)
    return buffer.getvalue()


def _las(kind: str) -> bytes:
    import laspy

    stored = laspy.LasData(laspy.LasHeader(version="1.4", point_format=7))
    stored.x, stored.y, stored.z = POINTS.T
    buffer = io.BytesIO()
    stored.write(buffer, do_compress=kind == "laz", laz_backend=laspy.LazBackend.Lazrs)
    return buffer.getvalue()


def _e57() -> bytes:
    import pye57

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "cloud.e57"
        file = pye57.E57(str(path), mode="w")
        file.write_scan_raw({f"cartesian{axis}": POINTS[:, k].copy() for k, axis in enumerate("XYZ")})
        file.close()
        return path.read_bytes()


def _mesh(kind: str) -> bytes:
    import trimesh

    content = trimesh.Trimesh(POINTS, _triangles(), process=False).export(file_type=kind)
    return content.encode() if isinstance(content, str) else bytes(content)
