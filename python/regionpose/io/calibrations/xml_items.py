"""Elements of an XML file with their lines, and OpenCV's FileStorage in XML as items of YAML."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from xml.parsers import expat

from ruamel.yaml.error import StringMark

from regionpose.io.calibrations.text import CalibrationText
from regionpose.io.calibrations.yaml_items import YamlItem, YamlMapping
from regionpose.io.yaml_text import MappingNode, Node, ScalarNode, SequenceNode

MOST_LEVELS = 50
"""Levels of an XML file; calibrations have up to ten."""

STORAGE = "opencv_storage"
STRING_TAG = "tag:yaml.org,2002:str"


@dataclass
class Element:
    """An element of an XML file: name, attributes, the text right inside, what it holds, and its line, from 1."""

    source: CalibrationText
    tag: str
    attributes: dict[str, str]
    line: int
    text: str = ""
    children: list[Element] = field(default_factory=list)

    def child(self, tag: str) -> Element | None:
        """The first element of a name right inside."""
        return next((one for one in self.children if one.tag == tag), None)

    def all(self, tag: str) -> Iterator[Element]:
        """All elements of a name, at any depth, this one too."""
        if self.tag == tag:
            yield self
        for one in self.children:
            yield from one.all(tag)

    def number(self, tag: str, default: float | None = None) -> float:
        """The number in an element right inside; `default`, or CalibrationError, where there is none."""
        child = self.child(tag)
        if child is not None:
            return self.source.number(tag, child.text.strip(), child.line)
        if default is None:
            raise self.source.error(self.tag, f"no {tag}", "its number", self.line)
        return default


def is_xml(source: CalibrationText) -> bool:
    """Whether a text begins as XML does."""
    return source.text.lstrip().startswith("<")


def xml_root(source: CalibrationText) -> Element:
    """The root of an XML file; CalibrationError for what is none, nests too deep, or declares entities."""
    stack: list[Element] = []
    roots: list[Element] = []

    def begin(tag: str, attributes: dict[str, str]) -> None:
        if len(stack) >= MOST_LEVELS:
            raise source.error("XML", f"more than {MOST_LEVELS} levels", "fewer", parser.CurrentLineNumber)
        element = Element(source, tag, attributes, parser.CurrentLineNumber)
        (stack[-1].children if stack else roots).append(element)
        stack.append(element)

    def add_text(text: str) -> None:
        stack[-1].text += text

    def refuse(*_: object) -> None:
        raise source.error("XML", "a document type", "none", parser.CurrentLineNumber)

    parser = expat.ParserCreate("utf-8")  # The text is decoded already, whatever it declares.
    parser.buffer_text = True
    parser.StartElementHandler = begin
    parser.EndElementHandler = lambda _: stack.pop()
    parser.CharacterDataHandler = add_text
    # Entities unfold a small file without end.
    parser.StartDoctypeDeclHandler = refuse
    try:
        parser.Parse(source.text.encode(), True)
    except expat.ExpatError as error:
        raise source.error("XML", expat.ErrorString(error.code), "XML that is whole", error.lineno) from error
    return roots[0]


def storage(root: Element) -> YamlMapping:
    """What OpenCV's FileStorage holds, as if it had been written as YAML."""
    return YamlItem(root.source, "", _node(root)).mapping()


def _node(element: Element) -> Node:
    if element.children and all(one.tag == "_" for one in element.children):
        return SequenceNode("", [_node(one) for one in element.children], **_marks(element))
    if element.children:
        pairs = [(ScalarNode(STRING_TAG, one.tag, **_marks(one)), _node(one)) for one in element.children]
        return MappingNode("", pairs, **_marks(element))
    words = element.text.split()
    if element.tag == "data" or len(words) > 1:
        return SequenceNode("", [ScalarNode("", word, **_marks(element)) for word in words], **_marks(element))
    return ScalarNode("", element.text.strip().strip('"'), **_marks(element))


def _marks(element: Element) -> dict[str, StringMark]:
    mark = StringMark(str(element.source.path), 0, element.line - 1, 0, None, 0)
    return {"start_mark": mark, "end_mark": mark}
