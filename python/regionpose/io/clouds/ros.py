"""Clouds of a bag's messages, PointCloud2 and Livox's CustomMsg, in the scanner's frame."""

from __future__ import annotations

from typing import Any

import numpy as np

from regionpose.io.bags.messages import read_messages, usual_fields
from regionpose.io.bags.place import BagPlace
from regionpose.io.clouds.cloud import Cloud, Scalars
from regionpose.io.clouds.columns import cloud_of_columns
from regionpose.io.clouds.errors import cloud_error
from regionpose.io.clouds.pcd import MOST_VALUES, named_columns
from regionpose.progress import Progress

KINDS = ("PointCloud2", "CustomMsg")
"""Scans of most drivers, and of Livox's."""

LIVOX_FIELDS = {"x": "f4", "y": "f4", "z": "f4", "reflectivity": "u1", "tag": "u1", "line": "u1", "offset_time": "u4"}

NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
"""The numbers of a PointField's `datatype`."""

MOST_POINT_BYTES = 8 * MOST_VALUES
"""Bytes of a point: the most values, of the widest type."""

SCAN = "scan"
"""The field that numbers the scans of a cloud of several, from 0."""


def read_bag_cloud(place: BagPlace, *, progress: Progress | None = None) -> Cloud:
    """The cloud of a place's messages, one after the other, in their frame, whose zero is the scanner.

    Fields that only some of the messages have are left out. CloudError for messages of several frames, or whose fields
    aren't in their bytes; else as of `read_messages`.
    """
    messages = [message.content for message in read_messages(place, KINDS, progress=progress)]
    with usual_fields(place):
        return _joined(place, messages)


def _joined(place: BagPlace, messages: list[Any]) -> Cloud:
    """The cloud of messages, one after the other."""
    frames = sorted({str(message.header.frame_id) for message in messages})
    if len(frames) > 1:
        raise cloud_error(str(place), "frames", ", ".join(frames), "scans in one frame")
    scans = [named_columns(_columns(place, message)) for message in messages]
    if len(scans) > 1:
        scans = [scan | {SCAN: np.full(len(scan["x"]), k)} for k, scan in enumerate(scans) if "x" in scan]
    shared = [name for name in scans[0] if all(name in scan for scan in scans)] if scans else []
    columns = {name: np.concatenate([scan[name] for scan in scans]) for name in shared}
    cloud = cloud_of_columns(place.bag, columns, grid_shape=_grid_shape(messages))
    return cloud.scanned_from(np.zeros(3))


def _grid_shape(messages: list[Any]) -> tuple[int, int] | None:
    """Rows and columns of a single organized scan."""
    if _is_livox(messages[0]):
        return None
    height, width = (int(getattr(messages[0], name)) for name in ("height", "width"))
    return (height, width) if len(messages) == 1 and height > 1 and width > 1 else None


def _columns(place: BagPlace, message: Any) -> dict[str, Scalars]:
    """The columns of a message as they are stored; CloudError where its bytes don't hold them."""
    if _is_livox(message):
        return _livox_columns(place, message)
    row, step = _row(place, message), int(message.row_step)
    height, width = int(message.height), int(message.width)
    data = np.asarray(message.data, dtype=np.uint8)
    if not (width * row.itemsize <= step and height * step <= len(data)):
        needed = f"{height} rows of {width} points of {row.itemsize} bytes"
        raise cloud_error(str(place), "data", f"{len(data)} bytes in rows of {step}", needed)
    rows = data[: height * step].reshape(height, step)[:, : width * row.itemsize]
    points = np.ascontiguousarray(rows).reshape(-1).view(row)
    return {name: points[name] for name in row.names or ()}


def _is_livox(message: Any) -> bool:
    return hasattr(message, "point_num")


def _livox_columns(place: BagPlace, message: Any) -> dict[str, Scalars]:
    """The columns of a CustomMsg, whose reflectivity is the intensity."""
    points = message.points
    if len(points) != int(message.point_num):
        raise cloud_error(str(place), "points", len(points), f"{message.point_num}, as the message states")
    columns = {
        name: np.array([getattr(point, name) for point in points], dtype=kind) for name, kind in LIVOX_FIELDS.items()
    }
    return {"intensity" if name == "reflectivity" else name: values for name, values in columns.items()}


def _row(place: BagPlace, message: Any) -> np.dtype[np.void]:
    """What the bytes of a point are."""
    order, size = ">" if message.is_bigendian else "<", int(message.point_step)
    names, kinds, offsets = [], [], []
    for field in message.fields:
        number, count, offset = NUMBERS.get(int(field.datatype)), max(1, int(field.count)), int(field.offset)
        if number is None:
            raise cloud_error(str(place), f"field {field.name}", f"datatype {field.datatype}", "one from 1 to 8")
        # Python's whole numbers don't overflow, as numpy's own check of this does.
        end = offset + count * np.dtype(number).itemsize
        if count > MOST_VALUES or end > size or offset < 0:
            found = f"{count} values up to byte {end}"
            raise cloud_error(str(place), f"field {field.name}", found, f"at most {MOST_VALUES} within {size} bytes")
        names.append(str(field.name))
        kinds.append(np.dtype((order + number, (count,) if count > 1 else ())))
        offsets.append(offset)
    if size > MOST_POINT_BYTES:
        raise cloud_error(str(place), "point_step", f"{size} bytes", f"at most {MOST_POINT_BYTES}")
    try:
        return np.dtype({"names": names, "formats": kinds, "offsets": offsets, "itemsize": size})
    except ValueError as error:
        raise cloud_error(str(place), "fields", str(error), f"different ones within {size} bytes a point") from error
