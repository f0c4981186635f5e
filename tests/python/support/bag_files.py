"""ROS bags of a few small messages, of each kind, written by rosbags (extra `ros`)."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from regionpose.io.bags.messages import FURTHER_TYPES
from rosbags import rosbag1, rosbag2, typesys

SECOND, BEGIN = 10**9, 1_700_000_000 * 10**9
SCANS = 5
"""Scans in a bag, ten a second."""

KINDS = ("ros1", "sqlite", "sqlite file", "mcap", "mcap file")

PACKED = (("ros1", "BZ2"), ("ros1", "LZ4"), ("mcap file", "STORAGE"), ("mcap", "MESSAGE"), ("sqlite", "MESSAGE"))
"""Kinds, and how what they hold can be compressed: by a format, or one by one or in chunks by ZSTD."""


def points_of(scan: int) -> NDArray[np.void]:
    """The points of a scan: x, y, z, intensity and packed color, in rows of 24 bytes."""
    layout: Any = {"names": ["x", "y", "z", "intensity", "rgb"], "formats": ["<f4"] * 4 + ["<u4"], "itemsize": 24}
    layout["offsets"] = [0, 4, 8, 12, 16]
    kind = np.dtype(layout)
    points = np.zeros(6, dtype=kind)
    for axis, name in enumerate("xyz"):
        points[name] = np.arange(6) * (axis + 1.0) + scan + axis
    points["intensity"], points["rgb"] = np.arange(6) * 10.0, 0x102030
    return points


class Bag:
    """The messages that a bag gets, of one of the kinds."""

    def __init__(self, kind: str, packed: str | None = None) -> None:
        self.kind, self.packed = kind, packed
        stores = typesys.Stores
        self.store = typesys.get_typestore(stores.ROS1_NOETIC if kind == "ros1" else stores.ROS2_HUMBLE)
        self.written: list[tuple[str, int, Any]] = []

    def make(self, kind: str, /, **values: Any) -> Any:
        return self.store.types[kind](**values)

    def header(self, at: int, frame: str = "lidar") -> Any:
        stamp = self.make("builtin_interfaces/msg/Time", sec=at // SECOND, nanosec=at % SECOND)
        extra = {"seq": 0} if self.kind == "ros1" else {}
        return self.make("std_msgs/msg/Header", stamp=stamp, frame_id=frame, **extra)

    def scan(
        self, at: int, points: NDArray[np.void], *, frame: str = "lidar", topic: str = "/points", **changed: Any
    ) -> None:
        named = points.dtype.fields
        assert named is not None
        fields = [
            self.make(
                "sensor_msgs/msg/PointField",
                name=name,
                offset=named[name][1],
                datatype=6 if name == "rgb" else 7,
                count=1,
            )
            for name in points.dtype.names or ()
        ]
        step = points.dtype.itemsize
        values = {"header": self.header(at, frame), "height": 1, "width": len(points), "fields": fields}
        values |= {"is_bigendian": False, "point_step": step, "row_step": step * len(points)}
        values |= {"data": np.frombuffer(points.tobytes(), dtype=np.uint8), "is_dense": True}
        self.written.append((topic, at, self.make("sensor_msgs/msg/PointCloud2", **(values | changed))))

    def picture(self, at: int, pixels: NDArray[Any], encoding: str, *, topic: str = "/camera", pad: int = 0) -> None:
        rows = np.ascontiguousarray(pixels).view(np.uint8).reshape(len(pixels), -1)
        padded = np.pad(rows, ((0, 0), (0, pad)))
        values = {"header": self.header(at), "height": len(pixels), "width": pixels.shape[1], "encoding": encoding}
        values |= {"is_bigendian": 0, "step": padded.shape[1], "data": padded.ravel()}
        self.written.append((topic, at, self.make("sensor_msgs/msg/Image", **values)))

    def compressed(self, at: int, pixels: NDArray[np.uint8]) -> None:
        held = io.BytesIO()
        Image.fromarray(pixels).save(held, format="PNG")
        data = np.frombuffer(held.getvalue(), dtype=np.uint8)
        message = self.make("sensor_msgs/msg/CompressedImage", header=self.header(at), format="png", data=data)
        self.written.append(("/compressed", at, message))

    def camera_info(
        self, at: int, topic: str, matrices: dict[str, NDArray[np.float64]], shape: tuple[int, int]
    ) -> None:
        """A calibration by its matrices d, k, r and p."""
        named = {name.upper() if self.kind == "ros1" else name: values for name, values in matrices.items()}
        sizes = {"height": shape[0], "width": shape[1], "binning_x": 0, "binning_y": 0}
        window = self.make(
            "sensor_msgs/msg/RegionOfInterest", x_offset=0, y_offset=0, height=0, width=0, do_rectify=False
        )
        message = self.make(
            "sensor_msgs/msg/CameraInfo",
            header=self.header(at),
            distortion_model="plumb_bob",
            roi=window,
            **sizes,
            **named,
        )
        self.written.append((topic, at, message))

    def write(self, folder: Path) -> Path:
        """Write it to a folder; the path of the bag."""
        path = folder / ("bag.bag" if self.kind == "ros1" else "bag")
        with self._writer(path) as writer:
            topics: dict[str, Any] = {}
            for topic, at, message in self.written:
                if topic not in topics:
                    topics[topic] = writer.add_connection(topic, message.__msgtype__, typestore=self.store)
                serialize = self.store.serialize_ros1 if self.kind == "ros1" else self.store.serialize_cdr
                writer.write(topics[topic], at, serialize(message, message.__msgtype__))
        return next(each for each in path.iterdir() if each.suffix != ".yaml") if self.kind.endswith("file") else path

    def _writer(self, path: Path) -> Any:
        if self.kind == "ros1":
            first = rosbag1.Writer(path)
            if self.packed:
                first.set_compression(rosbag1.Writer.CompressionFormat[self.packed])
            return first
        plugins = rosbag2.StoragePlugin
        second = rosbag2.Writer(
            path, version=9, storage_plugin=plugins.SQLITE3 if self.kind.startswith("sqlite") else plugins.MCAP
        )
        if self.packed:
            second.set_compression(rosbag2.CompressionMode[self.packed], rosbag2.CompressionFormat.ZSTD)
        return second


PIXELS = np.random.default_rng(0).integers(0, 256, (5, 7, 3), dtype=np.uint8)


def filled(kind: str, packed: str | None = None) -> Bag:
    """A bag of five scans, and pictures."""
    bag = Bag(kind, packed)
    for scan in range(SCANS):
        bag.scan(BEGIN + scan * SECOND // 10, points_of(scan))
    bag.picture(BEGIN + SECOND // 4, PIXELS, "rgb8", pad=3)
    bag.compressed(BEGIN + SECOND // 4, PIXELS)
    return bag


MATRICES = {
    "d": np.array([0.1, -0.2, 1e-3, -2e-3, 0.0]),
    "k": np.array([500.0, 0.0, 320.5, 0.0, 501.25, 240.25, 0.0, 0.0, 1.0]),
    "r": np.eye(3).ravel(),
    "p": np.eye(3, 4).ravel(),
}


def livox_bag(folder: Path, *, stated: int | None = None, kind: str = "mcap") -> Path:
    """A bag of one scan of a Livox driver, and the calibration of a camera."""
    made = Bag(kind)
    for name, definition in FURTHER_TYPES.items():
        made.store.register(typesys.get_types_from_msg(definition, name))
    given = points_of(1)
    points = [
        made.make(
            "livox_ros_driver2/msg/CustomPoint",
            offset_time=k * 10,
            x=float(point["x"]),
            y=float(point["y"]),
            z=float(point["z"]),
            reflectivity=200 - k,
            tag=16,
            line=k % 4,
        )
        for k, point in enumerate(given)
    ]
    scan = made.make(
        "livox_ros_driver2/msg/CustomMsg",
        header=made.header(BEGIN),
        timebase=BEGIN,
        point_num=len(points) if stated is None else stated,
        lidar_id=1,
        rsvd=np.zeros(3, np.uint8),
        points=points,
    )
    made.written.append(("/livox/lidar", BEGIN, scan))
    made.camera_info(BEGIN, "/camera/camera_info", MATRICES, (480, 640))
    return made.write(folder)
