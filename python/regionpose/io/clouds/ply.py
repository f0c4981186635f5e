"""Reading PLY: ASCII and both binary orders, points and the triangles of meshes."""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from regionpose.io.clouds.cloud import Cloud, Scalars
from regionpose.io.clouds.columns import cloud_of_columns
from regionpose.io.clouds.errors import cloud_error
from regionpose.io.clouds.pieces import file_bytes, file_words
from regionpose.io.reading import BOM, whole_number
from regionpose.progress import Progress

LONGEST_HEADER = 1 << 20
"""Bytes within which the header ends; it takes some hundreds."""

TYPES = {
    name: code
    for names, code in (
        (("char", "int8"), "i1"),
        (("uchar", "uint8"), "u1"),
        (("short", "int16"), "i2"),
        (("ushort", "uint16"), "u2"),
        (("int", "int32"), "i4"),
        (("uint", "uint32"), "u4"),
        (("float", "float32"), "f4"),
        (("double", "float64"), "f8"),
    )
    for name in names
}

ORDERS = {"ascii": "<", "binary_little_endian": "<", "binary_big_endian": ">"}

FILLING = tuple(b"\0\t\n\r ")
"""Bytes that may follow the last element of a binary file."""

LONGEST_LIST = 1 << 27
"""Values in one list at most: a gigabyte of doubles, the most that a row can be."""

CORNER_LISTS = ("vertex_indices", "vertex_index")


@dataclass(frozen=True)
class Property:
    """A property: its name, its type, and the type of the count before it where it is a list."""

    name: str
    kind: str
    count_kind: str | None


@dataclass(frozen=True)
class Element:
    """An element: `count` rows of `properties`."""

    name: str
    count: int
    properties: tuple[Property, ...]


@dataclass(frozen=True)
class Lists:
    """A list property: all values one after the other, and how many each row has."""

    values: Scalars
    counts: NDArray[np.int64]


@dataclass(frozen=True)
class Body:
    """The values after the header as bytes; the numbers of an ASCII file are held as little-endian doubles."""

    path: Path
    data: NDArray[np.uint8]
    order: str
    ascii: bool

    @classmethod
    def read(cls, path: Path, form: str, offset: int, progress: Progress | None) -> Body:
        """The values of the file from byte `offset` on."""
        if form != "ascii":
            return cls(path, file_bytes(path, offset, progress=progress), ORDERS[form], ascii=False)
        numbers = np.concatenate([_numbers(path, text) for text in file_words(path, offset, progress=progress)])
        return cls(path, numbers.astype("<f8", copy=False).view(np.uint8), ORDERS[form], ascii=True)

    def kind(self, declared: str) -> np.dtype[np.generic]:
        """How a value of a declared type is held."""
        return np.dtype("<f8") if self.ascii else np.dtype(self.order + declared)

    def short(self, element: Element, offset: int, needed: int) -> Exception:
        """The error about data that end within an element; sizes in bytes."""
        unit, width = ("numbers", 8) if self.ascii else ("bytes", 1)
        found = f"{(len(self.data) - offset) // width} {unit}"
        return cloud_error(
            self.path, f"element {element.name}", found, f"{needed // width} {unit} at least for {element.count} rows"
        )


def read_ply(path: Path, *, progress: Progress | None = None) -> Cloud:
    """The cloud of a PLY file; polygons are cut into triangles about their first corner."""
    with path.open("rb") as file:
        start = file.read(LONGEST_HEADER)
    form, elements, offset = _header(path, start.removeprefix(BOM))
    offset += len(BOM) if start.startswith(BOM) else 0
    body = Body.read(path, form, offset, progress)
    tables: dict[str, dict[str, Scalars | Lists]] = {}
    at = 0
    for element in elements:
        tables[element.name], at = _table(body, element, at)
    _refuse_remainder(body, at)
    vertices = {name: values for name, values in tables["vertex"].items() if not isinstance(values, Lists)}
    return cloud_of_columns(path, vertices, _triangles(path, tables.get("face", {})))


def _refuse_remainder(body: Body, at: int) -> None:
    """CloudError where more than white space or zeros follow the last element."""
    rest = body.data[at:]
    if len(rest) if body.ascii else not np.isin(rest, FILLING).all():
        found = f"{len(rest) // 8} numbers" if body.ascii else f"{len(rest)} bytes"
        raise cloud_error(body.path, "end of file", f"{found} after the last element", "nothing")


def _header(path: Path, start: bytes) -> tuple[str, list[Element], int]:
    """The format, the elements and the offset of the data."""
    if start[:3] != b"ply" or start[3:4] not in (b"\n", b"\r"):
        raise cloud_error(path, "first line", repr(start[:16]), "ply")
    end = re.search(rb"[\r\n]end_header[ \t]*(\r\n|\n|\r)", start)
    if end is None:
        raise cloud_error(path, "header", "no end", "a line end_header")
    form = ""
    elements: dict[str, tuple[int, list[Property]]] = {}
    for line in start[: end.start()].decode("latin-1").splitlines()[1:]:
        match line.split():
            case [] | ["comment" | "obj_info", *_]:
                continue
            case ["format", given, _] if given in ORDERS and not form:
                form = given
            case ["element", name, word] if (count := whole_number(word)) is not None and name not in elements:
                elements[name] = (count, [])
            case ["property", *described] if elements:
                properties = next(reversed(elements.values()))[1]
                properties.append(_property(path, described, properties))
            case _:
                raise cloud_error(path, "header", repr(line), "a format, comment, element or property, each once")
    if not form or "vertex" not in elements:
        found = f"format {form!r}, elements {list(elements)}"
        raise cloud_error(path, "header", found, f"a format of {', '.join(ORDERS)} and an element vertex")
    built = [Element(name, count, tuple(properties)) for name, (count, properties) in elements.items()]
    return form, built, end.end()


def _property(path: Path, words: list[str], before: list[Property]) -> Property:
    """The property that `words` describe."""
    match words:
        case [kind, name] if kind in TYPES:
            described = Property(name, TYPES[kind], None)
        case ["list", count_kind, kind, name] if kind in TYPES and TYPES.get(count_kind, "f")[0] in "iu":
            described = Property(name, TYPES[kind], TYPES[count_kind])
        case _:
            raise cloud_error(
                path, "property", repr(" ".join(words)), "TYPE NAME or list TYPE TYPE NAME of PLY's types"
            )
    if described.name in [given.name for given in before]:
        raise cloud_error(path, "property", f"{described.name} twice", "each name once in an element")
    return described


def _numbers(path: Path, text: bytes) -> NDArray[np.float64]:
    """All the numbers of a text."""
    if not text.strip():
        return np.empty(0)
    try:
        numbers = np.fromstring(text, dtype=np.float64, sep=" ")
    except (ValueError, DeprecationWarning):
        numbers = np.empty(0)
    # Before numpy 2.3 words that are no numbers end the reading, and no more.
    if len(numbers) != _word_count(text):
        raise cloud_error(path, "data", repr(_first_word_not_a_number(text)), "numbers alone")
    return numbers


def _word_count(text: bytes) -> int:
    """The number of words that blanks of ASCII part, as `bytes.split` does."""
    letters = np.frombuffer(text, np.uint8)
    # One operation for all blanks: 9 to 13, which wrap to 0 to 4, and 32, to 23.
    wrapped = letters - np.uint8(9)
    in_word = (wrapped > 4) & (wrapped != 23)
    return int(in_word[0]) + int(np.count_nonzero(in_word[1:] & ~in_word[:-1]))


def _first_word_not_a_number(text: bytes) -> str:
    """The first word of a text that is no number."""
    for word in text.split():
        try:
            float(word)
        except ValueError:
            return word.decode("latin-1")
    return "text that ends within a number"


def _table(body: Body, element: Element, at: int) -> tuple[dict[str, Scalars | Lists], int]:
    """The columns of the element that begins at `at`, and where it ends."""
    if not element.count or not element.properties:
        return {}, at
    row = _uniform_row(body, element, at)
    needed = element.count * row.itemsize
    if at + needed <= len(body.data):
        rows = np.frombuffer(body.data, dtype=row, count=element.count, offset=at)
        columns = _uniform_columns(body, element, rows)
        if columns is not None:
            return columns, at + needed
    elif all(given.count_kind is None for given in element.properties):
        raise body.short(element, at, needed)
    return _walked_columns(body, element, at)


def _uniform_row(body: Body, element: Element, at: int) -> np.dtype[np.void]:
    """The type of a row, if all rows have lists as long as the first row's."""
    parts: list[tuple[str, np.dtype[np.generic], tuple[int, ...]]] = []
    for index, given in enumerate(element.properties):
        length: tuple[int, ...] = ()
        if given.count_kind is not None:
            parts.append((f"count {index}", body.kind(given.count_kind), ()))
            first = at + np.dtype(parts[:-1]).itemsize
            length = (_list_length(body, element, given, first),)
        parts.append((given.name, body.kind(given.kind), length))
    return np.dtype(parts)


def _list_length(body: Body, element: Element, given: Property, at: int) -> int:
    """The length of the list whose count is at `at`; CloudError for one that cannot be."""
    kind = body.kind(given.count_kind or "")
    if at + kind.itemsize > len(body.data):
        raise body.short(element, at, kind.itemsize)
    length = struct.unpack_from(f"{body.order}{kind.char}", body.data.data, at)[0]
    if not 0 <= length <= LONGEST_LIST or length != int(length):
        item = f"element {element.name}, list {given.name}"
        raise cloud_error(body.path, item, f"a count of {length}", f"a whole number up to {LONGEST_LIST}")
    return int(length)


def _uniform_columns(body: Body, element: Element, rows: Scalars) -> dict[str, Scalars | Lists] | None:
    """The columns of rows of one type; None where a list is not as long as the first row's."""
    lists = {given.name: f"count {index}" for index, given in enumerate(element.properties) if given.count_kind}
    if any((rows[count] != rows[name].shape[1]).any() for name, count in lists.items()):
        return None
    columns: dict[str, Scalars | Lists] = {}
    for given in element.properties:
        values = _declared(body, element, given, rows[given.name])
        if given.name in lists:
            columns[given.name] = Lists(values.reshape(-1), rows[lists[given.name]].astype(np.int64))
        else:
            columns[given.name] = values
    return columns


def _walked_columns(body: Body, element: Element, at: int) -> tuple[dict[str, Scalars | Lists], int]:
    """The columns of rows whose lists differ in length, row by row."""
    starts: dict[str, list[int]] = {given.name: [] for given in element.properties}
    counts: dict[str, list[int]] = {given.name: [] for given in element.properties}
    for _ in range(element.count):
        for given in element.properties:
            length = 1
            if given.count_kind is not None:
                length = _list_length(body, element, given, at)
                at += body.kind(given.count_kind).itemsize
            starts[given.name].append(at)
            counts[given.name].append(length)
            at += length * body.kind(given.kind).itemsize
            if at > len(body.data):
                raise body.short(element, starts[given.name][-1], at - starts[given.name][-1])
    columns: dict[str, Scalars | Lists] = {}
    for given in element.properties:
        lengths = np.array(counts[given.name])
        values = _declared(body, element, given, _gathered(body, given, np.array(starts[given.name]), lengths))
        columns[given.name] = values if given.count_kind is None else Lists(values, lengths)
    return columns, at


def _gathered(body: Body, given: Property, starts: NDArray[np.int64], lengths: NDArray[np.int64]) -> Scalars:
    """The values of the runs that begin at byte `starts`, one run after the other."""
    kind = body.kind(given.kind)
    before = np.cumsum(lengths) - lengths
    places = np.repeat(starts - before * kind.itemsize, lengths) + np.arange(lengths.sum()) * kind.itemsize
    values: Scalars = body.data[places[:, None] + np.arange(kind.itemsize)].reshape(-1).view(kind)
    return values


def _declared(body: Body, element: Element, given: Property, values: Scalars) -> Scalars:
    """`values` in the declared type: integers of ASCII files are brought from doubles; floats keep all their digits."""
    if not body.ascii or given.kind[0] == "f":
        return values
    limits = np.iinfo(given.kind)
    fit = (values >= limits.min) & (values <= limits.max) & (values == np.floor(values))
    if not fit.all():
        item = f"element {element.name}, property {given.name}"
        raise cloud_error(body.path, item, values[~fit][0], f"whole numbers from {limits.min} to {limits.max}")
    return values.astype(given.kind)


def _triangles(path: Path, faces: dict[str, Scalars | Lists]) -> NDArray[np.int64] | None:
    """The triangles (k, 3) of the polygons, each cut about its first corner; None where there are none."""
    corners = next((faces[name] for name in CORNER_LISTS if name in faces), None)
    if not isinstance(corners, Lists):
        return None
    if corners.values.dtype.kind not in "iu":
        raise cloud_error(path, "element face", f"corners of type {corners.values.dtype}", "whole numbers")
    values = corners.values.astype(np.int64)
    cuts = np.maximum(corners.counts - 2, 0)
    first = np.repeat(np.cumsum(corners.counts) - corners.counts, cuts)
    within = np.arange(cuts.sum()) - np.repeat(np.cumsum(cuts) - cuts, cuts)
    return np.stack([values[first], values[first + within + 1], values[first + within + 2]], axis=1)
