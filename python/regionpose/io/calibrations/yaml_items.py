"""Items of a YAML file with their lines.

The file is parsed to nodes and numbers are read from their text, so that tags such as `!!opencv-matrix` build nothing,
and errors can name the line.
"""

from __future__ import annotations

from dataclasses import dataclass

from regionpose.io.calibrations.text import CalibrationError, CalibrationText
from regionpose.io.json_text import json_value
from regionpose.io.text_error import TextError
from regionpose.io.yaml_text import MappingNode, Node, ScalarNode, SequenceNode, line_of, yaml_node

DIRECTIVES = ("%YAML:1.0", "%YAML 1.0", "%YAML 1.1", "%YAML 1.2")
"""First lines that OpenCV and others write; OpenCV's colon is not YAML."""

MOST_SHOWN = 8
"""Names of items that a message lists at most: a line's worth."""


@dataclass(frozen=True)
class YamlItem:
    """A node with its name, for values and for errors."""

    source: CalibrationText
    name: str
    node: Node

    @property
    def line(self) -> int:
        """The line of the value, from 1."""
        return line_of(self.node)

    def error(self, found: object, needed: str) -> CalibrationError:
        """The error about this item."""
        return self.source.error(self.name, found, needed, self.line)

    def text(self) -> str:
        """The value as a word."""
        if not isinstance(self.node, ScalarNode):
            raise self.error(self._kind(), "a single value")
        return str(self.node.value)

    def number(self) -> float:
        """The value as a finite number."""
        return self.source.number(self.name, self.text(), self.line)

    def whole_number(self) -> int:
        """The value as a whole number."""
        return self.source.whole_number(self.name, self.text(), self.line)

    def numbers(self) -> list[float]:
        """The numbers of a sequence, of sequences row by row, or of a mapping with rows, cols and data."""
        if isinstance(self.node, MappingNode):
            return self.mapping()._matrix_numbers()
        if not isinstance(self.node, SequenceNode):
            raise self.error(self._kind(), "a sequence of numbers")
        values: list[float] = []
        for item in self._children():
            nested = isinstance(item.node, SequenceNode)
            values.extend([entry.number() for entry in item._children()] if nested else [item.number()])
            # Aliases unfold a small file without end.
            if len(values) > len(self.source.text):
                raise self.error("more numbers than characters in the file", "numbers written out")
        return values

    def entries(self) -> list[YamlItem]:
        """The items of a sequence; CalibrationError for anything else."""
        if not isinstance(self.node, SequenceNode):
            raise self.error(self._kind(), "a sequence")
        return self._children()

    def _children(self) -> list[YamlItem]:
        """The items of a sequence, numbered."""
        return [YamlItem(self.source, f"{self.name}[{index}]", child) for index, child in enumerate(self.node.value)]

    def counted(self, *counts: int) -> list[float]:
        """The numbers, whose count must be one of `counts`."""
        values = self.numbers()
        if len(values) not in counts:
            raise self.error(f"{len(values)} numbers", f"{' or '.join(str(count) for count in counts)} numbers")
        return values

    def mapping(self) -> YamlMapping:
        """The item as a mapping."""
        if not isinstance(self.node, MappingNode):
            raise self.error(self._kind(), "a mapping")
        return YamlMapping.of(self.source, self.name, self.node)

    @property
    def is_mapping(self) -> bool:
        """Whether the item holds named items."""
        return isinstance(self.node, MappingNode)

    @property
    def is_sequence(self) -> bool:
        """Whether the item is a list."""
        return isinstance(self.node, SequenceNode)

    @property
    def is_scalar(self) -> bool:
        """Whether the item is a single value."""
        return isinstance(self.node, ScalarNode)

    def _kind(self) -> str:
        kinds = {ScalarNode: "a single value", SequenceNode: "a sequence", MappingNode: "a mapping"}
        return kinds.get(type(self.node), "something else")


@dataclass(frozen=True)
class YamlMapping:
    """Named items of a YAML mapping."""

    source: CalibrationText
    name: str
    line: int
    items: dict[str, YamlItem]

    @classmethod
    def parse(cls, source: CalibrationText) -> YamlMapping | None:
        """The first document of the file, None when it is not a mapping; CalibrationError when it is not YAML."""
        root = parsed(source)
        return root.mapping() if root is not None and root.is_mapping else None

    @classmethod
    def of(cls, source: CalibrationText, name: str, node: MappingNode) -> YamlMapping:
        """The items of `node`; CalibrationError when a name appears twice."""
        items: dict[str, YamlItem] = {}
        for key, value in node.value:
            label = str(key.value) if isinstance(key, ScalarNode) else ""
            full = f"{name}.{label}" if name else label
            if label in items:
                raise source.error(full, "a second item of this name", "one", line_of(key))
            items[label] = YamlItem(source, full, value)
        return cls(source, name, line_of(node), items)

    def __contains__(self, name: str) -> bool:
        """Whether there is an item called `name`."""
        return name in self.items

    def get(self, *names: str) -> YamlItem | None:
        """The first item there is of `names`."""
        return next((self.items[name] for name in names if name in self.items), None)

    def need(self, *names: str) -> YamlItem:
        """The first item there is of `names`; CalibrationError when there is none."""
        item = self.get(*names)
        if item is None:
            raise self.source.error(self.name or "file", self.contents, f"an item {' or '.join(names)}", self.line)
        return item

    @property
    def contents(self) -> str:
        """What it holds, in words: the first names."""
        names = list(self.items)
        return f"the items {', '.join(names[:MOST_SHOWN])}{', ...' if len(names) > MOST_SHOWN else ''}"

    def size(self, width: tuple[str, ...], height: tuple[str, ...]) -> tuple[int | None, int | None]:
        """Width and height under the first of the given names, None where there are none."""
        items = self.get(*width), self.get(*height)
        values = [None if item is None else item.whole_number() for item in items]
        return values[0], values[1]

    def _matrix_numbers(self) -> list[float]:
        rows, columns = (self.need(name).whole_number() for name in ("rows", "cols"))
        if rows < 1 or columns < 1:
            raise self.source.error(self.name, f"{rows} rows and {columns} columns", "at least one of each", self.line)
        return self.need("data").counted(rows * columns)


def parsed(source: CalibrationText) -> YamlItem | None:
    """The first document of the file, None of one without any; CalibrationError when it is not YAML."""
    text = source.text
    if text.startswith(DIRECTIVES):
        text = text[text.find("\n") :] if "\n" in text else ""
    # JSON is YAML but for tabs between values.
    node = _node(source, text.replace("\t", " ") if _looks_like_json(source) else text)
    return None if node is None else YamlItem(source, "", node)


def _node(source: CalibrationText, text: str) -> Node | None:
    """The node of a YAML text, to which JSON belongs; CalibrationError where it is neither."""
    try:
        return yaml_node(text, aliases=True)
    except TextError as error:
        refuse_broken_json(source)
        raise CalibrationError(f"{source.path}: {error.place}{error}") from error


def refuse_broken_json(source: CalibrationText) -> None:
    """CalibrationError where a file that is meant to be JSON is none, though it may be YAML."""
    if not _looks_like_json(source):
        return
    try:
        json_value(source.text)
    except TextError as error:
        raise CalibrationError(f"{source.path}: {error.place}{error}") from error


def _looks_like_json(source: CalibrationText) -> bool:
    return source.path.suffix.lower() == ".json" or source.text.lstrip().startswith(("{", "["))
