"""Reading PCD, the Point Cloud Library's files: ASCII, binary and compressed."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from regionpose.io.clouds import lzf
from regionpose.io.clouds.cloud import Cloud, Scalars
from regionpose.io.clouds.columns import SKIPPED, cloud_of_columns
from regionpose.io.clouds.errors import cloud_error
from regionpose.io.clouds.pieces import file_bytes
from regionpose.io.clouds.text import rows_of_text
from regionpose.io.reading import BOM, whole_number
from regionpose.progress import Progress

LONGEST_HEADER = 1 << 20
"""Bytes within which the header ends; it takes some hundreds."""

KINDS = {
    (letter, size): f"<{code}{size}"
    for letter, code, sizes in (("F", "f", (4, 8)), ("I", "i", (1, 2, 4, 8)), ("U", "u", (1, 2, 4, 8)))
    for size in sizes
}

MOST_VALUES = 65536
"""Values in a row; the widest descriptors of the Point Cloud Library have 640."""

PACKED_COLORS = ("rgb", "rgba")
"""Fields of 4 bytes that hold blue, green, red and alpha, from the lowest byte, whatever type they claim."""

UNSET_VIEWPOINT = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
"""Translation and quaternion (w first) that writers use as default, also for merged maps."""

COMPRESSED_SIZES = np.dtype([("compressed", "<u4"), ("plain", "<u4")])


@dataclass(frozen=True)
class PcdHeader:
    """The header: the columns of a row, their number, how and where the rows are stored, where the scanner
    stood, rows and columns of an organized scan.
    """

    row: np.dtype[np.void]
    count: int
    storage: str
    offset: int
    sensor_origin: list[float] | None
    grid_shape: tuple[int, int] | None


def is_pcd(start: bytes) -> bool:
    """Whether a file that starts so is a PCD file: comments, then its version."""
    return re.match(rb"(\s*#[^\n]*\n)*\s*(#\s*\.PCD|VERSION\s|FIELDS\s)", start) is not None


def read_pcd(path: Path, *, progress: Progress | None = None) -> Cloud:
    """The cloud of a PCD file; as in PCL the VIEWPOINT is not applied, but it is where the scanner stood."""
    with path.open("rb") as file:
        start = file.read(LONGEST_HEADER)
    header = _header(path, start)
    readers = {"ascii": _text_columns, "binary": _binary_columns, "binary_compressed": _compressed_columns}
    if header.storage not in readers:
        raise cloud_error(path, "DATA", header.storage, "ascii, binary or binary_compressed")
    columns = named_columns(readers[header.storage](path, header, progress))
    cloud = cloud_of_columns(path, columns, grid_shape=header.grid_shape)
    return cloud if header.sensor_origin is None else cloud.scanned_from(header.sensor_origin)


def _header(path: Path, start: bytes) -> PcdHeader:
    """The header at the start of the file."""
    data = re.search(rb"^\s*DATA\s+(\w+)[ \t]*\r?\n", start, re.MULTILINE)
    if data is None:
        raise cloud_error(path, "header", repr(start[:40]), "a PCD header that ends with a DATA line")
    lines = start[: data.start()].removeprefix(BOM).decode("latin-1").splitlines()
    entries = {words[0]: words[1:] for line in lines if (words := line.split()) and not words[0].startswith("#")}
    names = entries.get("FIELDS", entries.get("COLUMNS", []))
    counts = _whole_numbers(path, entries, "COUNT") if "COUNT" in entries else [1] * len(names)
    sizes, letters = _whole_numbers(path, entries, "SIZE"), entries.get("TYPE", [])
    if not names or not len(names) == len(sizes) == len(letters) == len(counts):
        found = f"{len(names)} names, {len(sizes)} sizes, {len(letters)} types, {len(counts)} counts"
        raise cloud_error(path, "FIELDS, SIZE, TYPE, COUNT", found, "as many of each, at least x, y and z")
    row = _row_type(path, names, list(zip(letters, sizes, strict=True)), counts)
    storage = data.group(1).decode().lower()
    count, grid = _point_count(path, entries)
    return PcdHeader(row, count, storage, data.end(), _sensor_origin(path, entries), grid)


def _whole_numbers(path: Path, entries: dict[str, list[str]], key: str) -> list[int]:
    """The whole numbers at `key`."""
    words = entries.get(key, [])
    numbers = [number for word in words if (number := whole_number(word)) is not None]
    if len(numbers) < len(words):
        raise cloud_error(path, key, " ".join(words), "whole numbers")
    return numbers


def _sensor_origin(path: Path, entries: dict[str, list[str]]) -> list[float] | None:
    """The translation of the VIEWPOINT; None where there is none, or the default one."""
    words = entries.get("VIEWPOINT")
    if words is None:
        return None
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        numbers = []
    if len(numbers) != len(UNSET_VIEWPOINT) or not np.isfinite(numbers).all():
        raise cloud_error(path, "VIEWPOINT", " ".join(words) or "nothing", "7 finite numbers, tx ty tz qw qx qy qz")
    return None if numbers == UNSET_VIEWPOINT else numbers[:3]


def _point_count(path: Path, entries: dict[str, list[str]]) -> tuple[int, tuple[int, int] | None]:
    """The number of points: POINTS, which agrees with WIDTH x HEIGHT; HEIGHT and WIDTH where these are a grid's."""
    numbers = {key: _whole_numbers(path, entries, key) for key in ("POINTS", "WIDTH", "HEIGHT") if key in entries}
    for key, values in numbers.items():
        if len(values) != 1:
            raise cloud_error(path, key, " ".join(entries[key]) or "nothing", "one whole number")
    area = numbers["WIDTH"][0] * numbers.get("HEIGHT", [1])[0] if "WIDTH" in numbers else None
    points = numbers["POINTS"][0] if "POINTS" in numbers else area
    if points is None or area not in (None, points):
        raise cloud_error(path, "POINTS", points, "WIDTH x HEIGHT" if area is None else f"{area}, WIDTH x HEIGHT")
    width, height = (numbers.get(key, [1])[0] for key in ("WIDTH", "HEIGHT"))
    return points, (height, width) if width > 1 and height > 1 else None


def _row_type(path: Path, names: list[str], kinds: list[tuple[str, int]], counts: list[int]) -> np.dtype[np.void]:
    """The type of a row; padding fields get names of their own, and other names may come once.

    Fields of no values, which some drivers write where others pad, take no bytes.
    """
    parts: list[tuple[str, str, tuple[int, ...]]] = []
    for index, (name, kind, count) in enumerate(zip(names, kinds, counts, strict=True)):
        if kind not in KINDS or not 0 <= count <= MOST_VALUES:
            found = f"TYPE {kind[0]}, SIZE {kind[1]}, COUNT {count}"
            needed = f"F of 4 or 8, or I or U of 1, 2, 4 or 8, 0 to {MOST_VALUES} times"
            raise cloud_error(path, f"field {name}", found, needed)
        own = f"{SKIPPED}{index}" if name == SKIPPED else name
        if own in {part[0] for part in parts}:
            raise cloud_error(path, "FIELDS", f"{name} twice", "each name once")
        if count:
            parts.append((own, KINDS[kind], (count,) if count > 1 else ()))
    if sum(counts) > MOST_VALUES:
        raise cloud_error(path, "COUNT", f"{sum(counts)} values a row", f"at most {MOST_VALUES}")
    return np.dtype(parts)


def _text_columns(path: Path, header: PcdHeader, progress: Progress | None) -> dict[str, Scalars]:
    """Columns of lines of numbers; floats at full precision, packed colors by the bytes of their own type."""
    exact = [
        (name, "<f8" if header.row[name].base.kind == "f" else header.row[name].base.str, header.row[name].shape)
        for name in header.row.names or ()
    ]
    rows = rows_of_text(path, header.offset, np.dtype(exact), progress=progress)
    if len(rows) != header.count:
        raise cloud_error(path, "points", f"{len(rows)} lines", f"{header.count}, as the header states")
    packed = [name for name in PACKED_COLORS if name in (header.row.names or ())]
    return {name: rows[name].astype(header.row[name].base) if name in packed else rows[name] for name, *_ in exact}


def _binary_columns(path: Path, header: PcdHeader, progress: Progress | None) -> dict[str, Scalars]:
    """Columns of rows stored one after the other."""
    data = file_bytes(path, header.offset, progress=progress)
    _check_size(path, "points", data, header.count * header.row.itemsize)
    rows = np.frombuffer(data, dtype=header.row, count=header.count)
    return {name: rows[name] for name in header.row.names or ()}


def _compressed_columns(path: Path, header: PcdHeader, progress: Progress | None) -> dict[str, Scalars]:
    """Columns stored one after the other, compressed as a whole."""
    data = file_bytes(path, header.offset, progress=progress)
    if len(data) < COMPRESSED_SIZES.itemsize:
        raise cloud_error(path, "compressed data", f"{len(data)} bytes", "two sizes of 4 bytes")
    compressed, plain = (int(size) for size in np.frombuffer(data, COMPRESSED_SIZES, 1)[0])
    _check_size(path, "compressed data", data[COMPRESSED_SIZES.itemsize :], compressed)
    size = header.count * header.row.itemsize
    if plain != size:
        raise cloud_error(path, "plain size", f"{plain} bytes", f"{size} for {header.count} points")
    if plain > lzf.MOST_RATIO * compressed:
        raise cloud_error(path, "compressed data", f"{compressed} bytes", f"{-(-plain // lzf.MOST_RATIO)} at least")
    try:
        content = lzf.decompress(data[COMPRESSED_SIZES.itemsize :][:compressed].tobytes(), plain)
    except ValueError as error:
        raise cloud_error(path, "compressed data", error, "a whole LZF stream") from error
    columns, offset = {}, 0
    for name in header.row.names or ():
        kind = header.row[name]
        columns[name] = np.frombuffer(content, dtype=kind, count=header.count, offset=offset)
        offset += header.count * kind.itemsize
    return columns


def _check_size(path: Path, item: str, data: Scalars, needed: int) -> None:
    """CloudError unless `data` holds `needed` bytes, and then at most zeros, which some writers leave."""
    if len(data) < needed or data[needed:].any():
        raise cloud_error(path, item, f"{len(data)} bytes", f"{needed}, as the header states")


def named_columns(columns: dict[str, Scalars]) -> dict[str, Scalars]:
    """Columns (n,): packed colors apart, wide fields numbered, padding left out."""
    named: dict[str, Scalars] = {}
    for name, values in columns.items():
        if name in PACKED_COLORS and values.dtype.itemsize == 4 and values.ndim == 1:
            parts = np.ascontiguousarray(values).view(np.uint8).reshape(-1, 4)
            channels = ("blue", "green", "red", "alpha")[: len(name)]
            named.update({channel: parts[:, index] for index, channel in enumerate(channels)})
        elif values.ndim == 2:
            named.update({f"{name}_{index}": values[:, index] for index in range(values.shape[1])})
        else:
            named[name] = values
    return {name: values for name, values in named.items() if not re.fullmatch(rf"{SKIPPED}\d+(_\d+)?", name)}
