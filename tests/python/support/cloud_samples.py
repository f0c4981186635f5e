"""A small cloud, and files of it written by hand."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
from regionpose.io.clouds import Cloud

POINTS = np.array([[1.0, 2.0, 3.0], [-4.5, 0.25, 8.0], [0.0, 0.125, -7.5], [100.5, 200.25, -3.75]])
COLORS = np.array([[255, 0, 7], [1, 2, 3], [0, 0, 0], [10, 128, 254]], dtype=np.uint8)
INTENSITY = np.array([0.0, 0.5, 1.0, 0.25])
TRIANGLES = np.array([[0, 1, 2], [2, 1, 3]])

UTM = np.array([449_123.456, 5_411_987.123456, 117.25])
"""A place on the map: easting, northing and height in meters."""


def full_cloud() -> Cloud:
    """A cloud at map coordinates with everything a cloud can hold."""
    fields = {"gps time": np.array([1e9 + 0.125, 2.0, 3.0, 4.0]), "ring": np.array([1, 2, 3, 65535], dtype=np.uint16)}
    return Cloud.from_points(POINTS + UTM, colors=COLORS, intensity=INTENSITY, fields=fields, triangles=TRIANGLES)


def assert_same(cloud: Cloud, points: Any = POINTS, colors: Any = None, intensity: Any = None) -> None:
    """The cloud holds exactly these points, colors and intensities."""
    np.testing.assert_array_equal(cloud.points, points)
    for found, needed in ((cloud.colors, colors), (cloud.intensity, intensity)):
        if needed is None:
            assert found is None
        else:
            np.testing.assert_array_equal(found, needed)


def written(path: Path, content: bytes | str) -> Path:
    """`path`, with `content` in it."""
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


PLY_HEAD = """ply
format {form} 1.0
comment made by hand
obj_info nothing
element camera 1
property float view
property list uchar short sizes
element vertex 4
property double x
property float y
property float z
property uchar red
property uchar green
property uchar blue
property float scalar_Intensity
element face 3
property list uchar int vertex_index
property uchar flag
end_header
"""

POLYGONS = [[0, 1, 2], [0, 1, 3, 2], [1, 2, 3]]
CUT = [[0, 1, 2], [0, 1, 3], [0, 3, 2], [1, 2, 3]]


def binary_ply(order: str, form: str) -> bytes:
    """A PLY with an element before the vertices and polygons after them."""
    body = struct.pack(f"{order}fB2h", 1.5, 2, 640, 480)
    for point, color, strength in zip(POINTS, COLORS, INTENSITY, strict=True):
        body += struct.pack(f"{order}dff3Bf", *point, *(int(c) for c in color), strength)
    for polygon in POLYGONS:
        body += struct.pack(f"{order}B{len(polygon)}iB", len(polygon), *polygon, 9)
    return PLY_HEAD.format(form=form).encode() + body


def ascii_ply() -> bytes:
    """The same in ASCII."""
    lines = ["1.5 2 640 480"]
    for point, color, strength in zip(POINTS, COLORS, INTENSITY, strict=True):
        lines.append(" ".join(str(value) for value in (*point, *color, strength)))
    lines += [f"{len(polygon)} {' '.join(map(str, polygon))} 9" for polygon in POLYGONS]
    return (PLY_HEAD.format(form="ascii") + "\n".join(lines) + "\n").encode()


def pcd_head(form: str, extra: str = "", width: int = 4, height: int = 1) -> str:
    """The header of a PCD with x, y, z, rgb, padding and intensity."""
    return (
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z rgb _ intensity\n"
        f"SIZE 4 4 4 4 1 8\nTYPE F F F F U F\nCOUNT 1 1 1 1 3 1\nWIDTH {width}\nHEIGHT {height}\n"
        f"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {width * height}\n{extra}DATA {form}\n"
    )


PCD_ROW = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("rgb", "<u4"), ("_", "u1", 3), ("intensity", "<f8")])


def pcd_rows() -> Any:
    """The rows of the PCD."""
    rows = np.zeros(4, dtype=PCD_ROW)
    rows["x"], rows["y"], rows["z"] = POINTS.T
    red, green, blue = COLORS.astype(np.uint32).T
    rows["rgb"] = red << 16 | green << 8 | blue
    rows["intensity"] = INTENSITY
    return rows


def literal_lzf(plain: bytes) -> bytes:
    """`plain` as LZF that compresses nothing: runs of up to 32 bytes."""
    runs = [plain[start : start + 32] for start in range(0, len(plain), 32)]
    return b"".join(bytes([len(run) - 1]) + run for run in runs)


def compressed_pcd(rows: Any) -> bytes:
    """A compressed PCD of the rows: column after column."""
    plain = b"".join(np.ascontiguousarray(rows[name]).tobytes() for name in PCD_ROW.names or ())
    packed = literal_lzf(plain)
    return pcd_head("binary_compressed").encode() + struct.pack("<II", len(packed), len(plain)) + packed


def ascii_pcd() -> str:
    """An ASCII PCD, its packed colors written as the floats that they claim to be."""
    lines = [
        f"{row['x']} {row['y']} {row['z']} {row['rgb'].view(np.float32):.9g} 0 0 0 {row['intensity']}"
        for row in pcd_rows()
    ]
    return pcd_head("ascii") + "\n".join(lines) + "\n"
