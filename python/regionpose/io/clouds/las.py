"""Reading LAS and LAZ through laspy (extra `las`)."""

from __future__ import annotations

import re
import struct
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from regionpose.io.clouds.cloud import Cloud, Scalars
from regionpose.io.clouds.columns import COLOR_NAMES, cloud_of_columns
from regionpose.io.clouds.errors import CloudError, cloud_error
from regionpose.io.clouds.pieces import PIECE_POINTS
from regionpose.io.reading import unfolding_error
from regionpose.progress import Progress
from regionpose.validation.extras import load_extra

HEADER = np.dtype(
    {
        "names": ["minor", "header_size", "points_at", "records", "format", "point_size", "short_count"],
        "formats": ["u1", "<u2", "<u4", "<u4", "u1", "<u2", "<u4"],
        "offsets": [25, 94, 96, 100, 104, 105, 107],
        "itemsize": 227,
    }
)
"""The fields of the header that give the size of what follows, for every version."""

LONG_HEADER = np.dtype(
    {
        "names": ["late_at", "late_records", "count"],
        "formats": ["<u8", "<u4", "<u8"],
        "offsets": [235, 243, 247],
        "itemsize": 255,
    }
)
"""What version 1.4 adds to them."""

RECORD_SIZE, LATE_RECORD_SIZE = 54, 60
"""Bytes of a variable length record without content, before the points and after them."""

COMPRESSED_BITS = 0b1100_0000
"""Bits of the point format that are set when the points are compressed."""

LASZIP_USER, LASZIP_RECORD, LASZIP_ITEMS_AT = b"laszip encoded", 22204, 34
LAYERS = {10: 9, 11: 1, 12: 2, 13: 1}
BYTES_ITEM, VARIOUS_SIZES = 14, 0xFFFFFFFF
"""Layers of LASzip's items: point, RGB, RGB with infrared, wave packet; the item with one a byte; the chunk size
that stands for various ones."""

WKT_UNIT = re.compile(r'\bUNIT\s*\[\s*"([^"]*)"\s*,\s*([-+.\deE]+)|\bLENGTHUNIT\s*\[\s*"([^"]*)"\s*,\s*([-+.\deE]+)')
WKT_VERTICAL = re.compile(r"\bVERT(_CS|CRS)\s*\[")
ANGLES = ("deg", "rad", "grad", "arc")
"""What the names of angular units begin with."""

LINEAR_UNITS_KEY = 3076
"""ProjLinearUnitsGeoKey of GeoTIFF."""

EPSG_METERS = {9001: 1.0, 9002: 0.3048, 9003: 1200.0 / 3937.0}
"""Meters in EPSG's meter, international foot and US survey foot."""

MODEL_KEY, PROJECTED_KEY, GEOGRAPHIC_KEY = 1024, 3072, 2048
GEOGRAPHIC_MODEL = 2
"""GTModelTypeGeoKey, ProjectedCSTypeGeoKey and GeographicTypeGeoKey of GeoTIFF; the model of longitude and latitude."""

WKT_GEOGRAPHIC = re.compile(r"\b(GEOGCS|GEOGCRS|GEOGRAPHICCRS|GEODCRS|GEODETICCRS)\s*\[")
WKT_METRIC = re.compile(
    r"\b(PROJCS|PROJCRS|PROJECTEDCRS|GEOCCS|LOCAL_CS|ENGCRS|ENGINEERINGCRS)\s*\[|\bCS\s*\[\s*Cartesian", re.I
)

FARTHEST_DEGREES = (180.0, 90.0)
FINEST_METERS = 1e-5
"""Scale below which coordinates are no meters of a survey: a hundredth of a millimeter; a meter has 1e-5 degrees."""

FLAT = 0.1
"""Horizontal extent over vertical below which a cloud in meters would be a post. In degrees 10 km are less than 0.1, of
heights of some meters."""

PROJECTED = (
    "meters: project it first, as by `pdal translate in.las out.las reprojection "
    "--filters.reprojection.out_srs=EPSG:32632` with the UTM zone of the place"
)

RAW_COORDINATES = ("X", "Y", "Z")


def read_las(path: Path, *, progress: Progress | None = None) -> Cloud:
    """The cloud of a LAS or LAZ file: scaled coordinates, colors brought to 8 bits, other dimensions as fields."""
    laspy = load_extra("laspy", "las", f"{path}: LAS")
    content = np.memmap(path, dtype=np.uint8, mode="r")
    if _checked_header(path, content)["format"] & COMPRESSED_BITS:
        load_extra("lazrs", "las", f"{path}: LAZ")
    try:
        # The parallel backend aborts the process for want of memory where a chunk's size is damaged.
        with laspy.open(path, laz_backend=laspy.LazBackend.Lazrs) as reader:
            stored = laspy.LasData(reader.header, _points(laspy, reader, progress))
        names = [*stored.point_format.dimension_names]
        named = {name: np.asarray(stored[name]) for name in names if name not in RAW_COORDINATES}
        coordinates = {name.lower(): np.asarray(stored[name.lower()]) for name in RAW_COORDINATES}
        stated = int(stored.header.point_count)
        records = [*stored.header.vlrs, *(stored.evlrs or [])]
        unit, scales = _unit_m(records), np.asarray(stored.header.scales, dtype=np.float64)
    except (KeyboardInterrupt, SystemExit):
        raise
    # Damage shows as errors of laspy, lazrs, numpy and struct, and as a panic, which is no Exception.
    except BaseException as error:
        raise cloud_error(path, "points", f"{type(error).__name__}: {error}", "a whole LAS or LAZ file") from error
    if len(coordinates["x"]) != stated:
        raise cloud_error(path, "points", len(coordinates["x"]), f"{stated}, as the header states")
    cloud = cloud_of_columns(path, coordinates | _flat(named))
    if _is_geographic(records) or (unit is None and _looks_geographic(cloud, scales)):
        low, high = cloud.points[:, 0].min(), cloud.points[:, 0].max()
        found = f"degrees of longitude and latitude, x from {low:.6f} to {high:.6f}"
        raise cloud_error(path, "coordinates", found, PROJECTED)
    return replace(cloud, unit_m=unit)


def _points(laspy: Any, reader: Any, progress: Progress | None) -> Any:
    """All points of a file, fewer where it ends early."""
    header = reader.header
    rows, read = np.empty(header.point_count, dtype=header.point_format.dtype()), 0
    while len(piece := reader.read_points(PIECE_POINTS)):
        rows[read : read + len(piece)] = piece.array
        read += len(piece)
        if progress is not None:
            progress(read / len(rows))
    return laspy.ScaleAwarePointRecord(rows[:read], header.point_format, header.scales, header.offsets)


def _unit_m(records: Sequence[Any]) -> float | None:
    """Meters in the unit of the horizontal coordinates, by WKT or GeoTIFF keys; None where neither states it."""
    for record in records:
        for key in getattr(record, "geo_keys", ()):
            if key.id == LINEAR_UNITS_KEY and key.value_offset in EPSG_METERS:
                return EPSG_METERS[key.value_offset]
        unit = _wkt_meters(str(getattr(record, "string", "")))
        if unit is not None:
            return unit
    return None


def _is_geographic(records: Sequence[Any]) -> bool:
    """Whether WKT or GeoTIFF keys declare coordinates as longitude and latitude."""
    for record in records:
        keys = {key.id: key.value_offset for key in getattr(record, "geo_keys", ())}
        if keys.get(MODEL_KEY) == GEOGRAPHIC_MODEL or (
            MODEL_KEY not in keys and GEOGRAPHIC_KEY in keys and PROJECTED_KEY not in keys
        ):
            return True
        text = str(getattr(record, "string", ""))
        if WKT_GEOGRAPHIC.search(text) and not WKT_METRIC.search(text):
            return True
    return False


def _looks_geographic(cloud: Cloud, scales: Scalars) -> bool:
    """Whether coordinates of a file without such keys can hardly be meters: on the globe, finer, and flat."""
    low, high = cloud.points.min(axis=0), cloud.points.max(axis=0)
    on_globe = np.maximum(np.abs(low), np.abs(high))[:2] <= FARTHEST_DEGREES
    wide, tall = float((high - low)[:2].max()), float((high - low)[2])
    return bool(on_globe.all() and scales[:2].max() < FINEST_METERS and wide < FLAT * tall)


def _wkt_meters(text: str) -> float | None:
    """Meters in the last length unit before the vertical system, which is that of the projection."""
    found = WKT_UNIT.findall(WKT_VERTICAL.split(text)[0])
    named = [(old or new, factor or other) for old, factor, new, other in found]
    lengths = [factor for name, factor in named if not name.lower().startswith(ANGLES)]
    try:
        meters = float(lengths[-1])
    except (IndexError, ValueError):
        return None
    return meters if np.isfinite(meters) and meters > 0.0 else None


def _checked_header(path: Path, content: Scalars) -> dict[str, int]:
    """The header's numbers; CloudError where the file is too short for them.

    laspy and lazrs take sizes on trust: a damaged one can cost minutes, or more memory than there is.
    """
    size = len(content)
    if size < HEADER.itemsize:
        raise cloud_error(path, "header", f"{size} bytes", f"at least {HEADER.itemsize}")
    header = _numbers(content, HEADER)
    header |= {"late_at": 0, "late_records": 0, "count": header["short_count"]}
    if header["minor"] >= 4 and size >= LONG_HEADER.itemsize:
        header |= _numbers(content, LONG_HEADER)
    records_end = header["header_size"] + header["records"] * RECORD_SIZE
    late_end = header["late_at"] + header["late_records"] * LATE_RECORD_SIZE
    points_end = header["points_at"]
    if not header["format"] & COMPRESSED_BITS:
        points_end += header["count"] * header["point_size"]
    if records_end > header["points_at"] or max(late_end, points_end) > size:
        needed = f"{max(records_end, late_end, points_end)} at least, as the header states"
        raise cloud_error(path, "size", f"{size} bytes", needed)
    if header["format"] & COMPRESSED_BITS:
        _check_layers(path, content, header, _chunk_count(path, content, header))
        wrong = unfolding_error(path, header["count"] * header["point_size"])
        if wrong is not None:
            raise CloudError(f"{path}: points: {wrong}")
    return header


def _numbers(content: Scalars, kind: np.dtype[np.void]) -> dict[str, int]:
    """The numbers that the start of the file holds."""
    record = np.frombuffer(content, dtype=kind, count=1)[0]
    return {name: int(record[name]) for name in kind.names or ()}


def _chunk_count(path: Path, content: Scalars, header: dict[str, int]) -> int:
    """How many compressed chunks the table lists; CloudError unless it lies in the file and they fit there."""
    size, points_at = len(content), header["points_at"]
    table_at = int.from_bytes(content[points_at : points_at + 8].tobytes(), "little", signed=True)
    if table_at == -1:
        # Writers that cannot go back leave the place at the very end.
        table_at = int.from_bytes(content[-8:].tobytes(), "little", signed=True)
    if not points_at + 8 <= table_at <= size - 8:
        raise cloud_error(path, "chunk table", f"at byte {table_at}", f"within the file's {size} bytes")
    chunks = int.from_bytes(content[table_at + 4 : table_at + 8].tobytes(), "little")
    most = (table_at - points_at) // max(1, header["point_size"])
    if chunks > most:
        raise cloud_error(path, "chunk table", f"{chunks} chunks", f"at most {most}, by the file's size")
    return chunks


def _check_layers(path: Path, content: Scalars, header: dict[str, int], chunks: int) -> None:
    """CloudError where one of the compressed chunks states layers that the file doesn't hold.

    Chunks of point formats from 6 begin with a point, the number of points and the size of each layer, for which lazrs
    takes memory at once: up to 4 GB each, or it aborts the process.
    """
    chunk_size, layers = _layers(path, content, header)
    if chunk_size != VARIOUS_SIZES:
        chunks = -(-header["count"] // chunk_size)
    at = header["points_at"] + 8
    for _ in range(chunks if layers else 0):
        at += header["point_size"] + 4
        sizes = np.frombuffer(content[at : at + 4 * layers].tobytes().ljust(4 * layers, b"\xff"), "<u4")
        at += 4 * layers + int(sizes.sum(dtype=np.int64))
        if at > len(content):
            raise cloud_error(path, "compressed chunk", f"layers up to byte {at}", f"the file's {len(content)} bytes")


def _layers(path: Path, content: Scalars, header: dict[str, int]) -> tuple[int, int]:
    """Points of a compressed chunk, and its number of layers: 0 of point formats below 6."""
    at = header["header_size"]
    for _ in range(header["records"]):
        user, number, length = struct.unpack_from("<2x16sHH", content[at : at + RECORD_SIZE].tobytes().ljust(54, b"\0"))
        record = content[at + RECORD_SIZE : at + RECORD_SIZE + length].tobytes()
        at += RECORD_SIZE + length
        if user.rstrip(b"\0") == LASZIP_USER and number == LASZIP_RECORD and len(record) >= LASZIP_ITEMS_AT:
            chunk_size, items = *struct.unpack_from("<12xI", record), record[LASZIP_ITEMS_AT:]
            pairs = [struct.unpack_from("<HH", items, start) for start in range(0, len(items) - 5, 6)]
            layers = sum(size if kind == BYTES_ITEM else LAYERS.get(kind, 0) for kind, size in pairs)
            return max(1, chunk_size), layers
    raise cloud_error(path, "records", "none of LASzip's", "one, since the points are compressed")


def _flat(named: dict[str, Scalars]) -> dict[str, Scalars]:
    """Columns (n,): dimensions with several values apart, colors left out where all are zero, as unset."""
    flat: dict[str, Scalars] = {}
    for name, values in named.items():
        if values.ndim == 2:
            flat.update({f"{name}_{index}": values[:, index] for index in range(values.shape[1])})
        else:
            flat[name] = values
    colors = COLOR_NAMES[0]
    if all(name in flat and not flat[name].any() for name in colors):
        return {name: values for name, values in flat.items() if name not in colors}
    return flat
