"""The text of a scene file as plain values, with the line of each."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from regionpose.io.json_text import joined_pairs, json_value
from regionpose.io.reading import check_regular
from regionpose.io.text_error import TextError, refuse_halves
from regionpose.io.yaml_text import MappingNode, Node, SequenceNode, line_of, plain_value, yaml_node
from regionpose.validation.quoting import quoted

Place = tuple[str | int, ...]
"""Where a value stands: the keys and indices that lead to it, () for the whole file."""

MAX_BYTES = 4 * 2**20
"""Largest scene file read, in bytes, which takes a gigabyte at the worst: polygons are typed by hand or by a script,
clouds and masks are files of their own."""


class SceneError(ValueError):
    """A scene that cannot be used: names the file, the line, the item, what was found and what is needed."""


@dataclass(frozen=True)
class Document:
    """The values of a scene file, the line (from 1) of each place in it, and its bytes.

    `lines`: None for values that stand in no file yet.
    """

    path: Path
    value: object
    lines: dict[Place, int] | None
    content: bytes = b""

    def line(self, place: Place) -> int:
        """The line of the value at `place`, or of the innermost value around it that the file has."""
        lines = self.lines or {}
        while place and place not in lines:
            place = place[:-1]
        return lines.get(place, 1)

    def error(self, place: Place, message: str) -> SceneError:
        """The error about the value at `place`."""
        item = f"{written_place(place)}: " if place else ""
        line = "" if self.lines is None else f":{self.line(place)}"
        return SceneError(f"{self.path}{line}: {item}{message}")


def written_place(place: Place) -> str:
    """The place as `regions[1].image.seed`."""
    written = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in place)
    return written.removeprefix(".")


def described(value: object) -> str:
    """A found value for a message: lists and mappings by their kind, the rest as written, cut to a length that
    fits.
    """
    if isinstance(value, dict):
        return "a mapping"
    if isinstance(value, list):
        return f"a list of {len(value)}"
    return "nothing" if value is None else quoted(value)


def read_document(path: str | Path) -> Document:
    """The scene file at `path`, JSON when its name ends in .json, YAML otherwise.

    FileNotFoundError when it is missing; SceneError when it is not UTF-8, not YAML or JSON, holds a key twice or an
    alias.
    """
    location = Path(path)
    return document_of(location, _content(location))


def document_of(path: Path, content: bytes) -> Document:
    """The scene file that holds `content`, which need not be written yet; errors as of `read_document`."""
    _check_size(path, len(content))
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise SceneError(f"{path}: found a binary file; needed YAML or JSON in UTF-8") from error
    value, lines = _json_parts(path, text) if path.suffix.lower() == ".json" else _yaml_parts(path, text)
    return Document(path, value, lines, content)


def _content(path: Path) -> bytes:
    if path.is_dir():
        raise SceneError(f"{path}: found a directory; needed a scene file")
    if not path.exists():
        raise FileNotFoundError(f"{path}: no such file; needed a scene file")
    check_regular(path)
    _check_size(path, path.stat().st_size)
    return path.read_bytes()


def _check_size(path: Path, size: int) -> None:
    if size > MAX_BYTES:
        raise SceneError(f"{path}: found {size} bytes; needed a scene file of at most {MAX_BYTES}")


def _yaml_parts(path: Path, text: str) -> tuple[object, dict[Place, int]]:
    """The value of a YAML text, and the line of each place in it."""
    try:
        node = yaml_node(text)
        lines = _lines(path, node)
        value = plain_value(node)
        refuse_halves(text, value)
    except TextError as error:
        raise SceneError(f"{path}{error.suffix}: {error}") from error
    return value, lines


def _json_parts(path: Path, text: str) -> tuple[object, dict[Place, int]]:
    """The value of a JSON text, and the line of each place in it."""
    try:
        value = json_value(text)
        # JSON is YAML but for tabs between values, of which strings hold none, and for pairs of escapes.
        node = yaml_node(joined_pairs(text.replace("\t", " ")))
    except TextError as error:
        raise SceneError(f"{path}{error.suffix}: {error}") from error
    return value, _lines(path, node)


def _lines(path: Path, root: Node | None) -> dict[Place, int]:
    """The line of each value: of its key, where it has one. SceneError where a key appears twice."""
    lines: dict[Place, int] = {}
    stack: list[tuple[Place, Node]] = [] if root is None else [((), root)]
    while stack:
        place, node = stack.pop()
        lines.setdefault(place, line_of(node))
        if isinstance(node, SequenceNode):
            stack.extend(((*place, index), child) for index, child in enumerate(node.value))
        elif isinstance(node, MappingNode):
            for key, child in node.value:
                inner = (*place, str(key.value))
                if inner in lines:
                    raise SceneError(
                        f"{path}:{line_of(key)}: {written_place(inner)}: found the key twice; needed it once"
                    )
                lines[inner] = line_of(key)
                stack.append((inner, child))
    return lines
