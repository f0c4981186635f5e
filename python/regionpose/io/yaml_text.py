"""YAML 1.2 with the line of each value: the one place that reads and writes it."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, StringMark, YAMLError
from ruamel.yaml.events import (
    AliasEvent,
    CollectionEndEvent,
    CollectionStartEvent,
    MappingStartEvent,
    NodeEvent,
    ScalarEvent,
)
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode
from ruamel.yaml.reader import ReaderError
from ruamel.yaml.representer import SafeRepresenter

from regionpose.io.text_error import TextError, found_at

__all__ = ["MappingNode", "Node", "ScalarNode", "SequenceNode", "line_of", "plain_value"]
__all__ += ["to_yaml", "yaml_node"]

MOST_LEVELS = 100
"""Levels of a YAML file; scenes and calibrations have up to ten."""

LINE_WIDTH = 120
"""Columns at which to_yaml lines are broken; a convention."""

_WORD = re.compile(r"[A-Za-z_][\w./-]*", re.ASCII)
"""Texts that are written without quotes."""

_SEQUENCE = -1
"""In place of a count: a sequence has no keys."""


NEEDED = {
    "mapping values are not allowed": "one key a line, at the indentation of those beside it; a text with a colon in"
    " quotes",
    "did not find expected key": "a key at the indentation of those beside it",
    "did not find expected '-'": "a dash at the indentation of those of the list",
    "did not find expected ',' or": "a comma, or the bracket that closes that of line {line}",
    "did not find expected node content": "a value, or the bracket that closes",
    "could not find expected ':'": "a colon and a space after the key",
    "found unexpected end of stream": "a quote where the text ends",
    "found unknown escape": "a backslash written twice, or single quotes around the text",
    "found invalid Unicode": "a character, not half of one; a backslash is written twice",
    "found character that cannot start": "a value; texts that begin with a sign in quotes, and spaces in place of tabs",
    "found a tab": "spaces in place of tabs",
}
"""What YAML needs where it ends, by how libyaml begins its message; `line` is that where the list or text began."""

BEGUN_BEFORE = ("could not find expected ':'", "found unexpected end of stream")
"""Messages about what began at the mark of their context: a key, or a text in quotes."""


def yaml_node(text: str, *, aliases: bool = False) -> Node | None:
    """The node of the first document, None of an empty text.

    TextError for what isn't YAML, nests deeper than `MOST_LEVELS`, or names another value (*) without `aliases`.
    """
    try:
        _check(text, aliases)
        node: Node | None = next(iter(_parser().compose_all(text)), None)
    except (YAMLError, ValueError, RecursionError) as error:
        raise _described(error, text) from error
    return node


def plain_value(node: Node | None) -> Any:
    """The value of a node as mappings, lists, texts and numbers; TextError where it has none."""
    try:
        return None if node is None else _constructor().construct_document(node)
    except (YAMLError, ValueError, LookupError, RecursionError) as error:
        raise _valueless(node) or _described(error) from error


def _constructor() -> Any:
    return YAML(typ="safe", pure=True).constructor


def _valueless(root: Node | None) -> TextError | None:
    """The error about the first single value within a node that is none of its kind."""
    constructor = _constructor()
    for node in _scalars(root):
        try:
            constructor.construct_document(node)
        except (YAMLError, ValueError, LookupError):
            kind = str(node.tag).rpartition(":")[2]
            found = f"found {node.value!r}, which is no {kind}; needed one, or quotes around a text"
            return TextError(found, line_of(node), node.start_mark.column + 1)
    return None


def _scalars(root: Node | None) -> Iterator[ScalarNode]:
    """The single values within a node."""
    stack = [root]
    while stack:
        node = stack.pop()
        if isinstance(node, ScalarNode):
            yield node
        elif isinstance(node, SequenceNode):
            stack.extend(reversed(node.value))
        elif isinstance(node, MappingNode):
            stack.extend(part for pair in reversed(node.value) for part in reversed(pair))


def line_of(node: Node | NodeEvent) -> int:
    """The line at which a node begins, from 1."""
    return int(node.start_mark.line) + 1


def to_yaml(value: object) -> str:
    """A value as YAML text, keys in their order, rows of numbers on one line each."""
    writer = YAML(typ="safe", pure=True)
    writer.Representer = _Representer
    writer.sort_base_mapping_type_on_output = False  # type: ignore[assignment]
    writer.default_flow_style = None
    writer.allow_unicode = True
    writer.width = LINE_WIDTH
    stream = io.StringIO()
    writer.dump(value, stream)
    return stream.getvalue()


class _Representer(SafeRepresenter):
    """Writes what `yaml_node` reads."""

    def ignore_aliases(self, data: Any) -> bool:
        """One list in two places is written out twice: the reader takes no aliases."""
        return True

    def represent_str(self, data: str) -> ScalarNode:
        """Quotes all but plain words: libyaml reads texts with ? or : in them otherwise than they are written."""
        node: ScalarNode = self.represent_scalar("tag:yaml.org,2002:str", data, None if _WORD.fullmatch(data) else '"')
        return node


_Representer.add_representer(str, _Representer.represent_str)


def _parser() -> YAML:
    """Libyaml's where it is there, five times as fast."""
    return YAML(typ="safe")


def _check(text: str, aliases: bool) -> None:
    """Check that a text may be composed: the parser goes on without recursion, libyaml's composer would run out of the
    process's stack.
    """
    children: list[int] = []
    for event in _parser().parse(text):
        if isinstance(event, CollectionEndEvent):
            children.pop()
        elif isinstance(event, NodeEvent):
            _check_node(event, children, aliases)
            if isinstance(event, CollectionStartEvent):
                children.append(0 if isinstance(event, MappingStartEvent) else _SEQUENCE)


def _check_node(event: NodeEvent, children: list[int], aliases: bool) -> None:
    """Check one node inside the open collections; `children` counts keys and values of each, and goes on by one."""
    if isinstance(event, AliasEvent) and not aliases:
        raise TextError("found an alias (*); needed the value itself", line_of(event))
    if isinstance(event, CollectionStartEvent) and len(children) == MOST_LEVELS:
        raise TextError(f"found more than {MOST_LEVELS} levels; needed fewer", line_of(event))
    if children and children[-1] != _SEQUENCE:
        if children[-1] % 2 == 0 and not isinstance(event, ScalarEvent):
            raise TextError("found a key that is a list, a mapping or an alias; needed a text", line_of(event))
        children[-1] += 1


def _described(error: Exception, text: str | None = None) -> TextError:
    if isinstance(error, TextError):
        return error
    if isinstance(error, ReaderError) and text is not None:
        # It stands nowhere before; the error's own position counts libyaml's bytes, or characters without it.
        position = text.index(chr(error.character))
        before = text[:position]
        found = f"found the control character U+{error.character:04X}; needed text"
        return TextError(found, before.count("\n") + 1, position - before.rfind("\n"))
    if isinstance(error, MarkedYAMLError):
        return _syntax_error(error, text)
    return TextError(f"found {type(error).__name__}: {' '.join(str(error).split())[:120]}; needed YAML")


def _syntax_error(error: MarkedYAMLError, text: str | None) -> TextError:
    """A libyaml error as what was found and needed."""
    problem = str(error.problem)
    mark: StringMark | None = error.context_mark if problem.startswith(BEGUN_BEFORE) else error.problem_mark
    needed = next((words for start, words in NEEDED.items() if problem.startswith(start)), None)
    if mark is None or text is None:
        return TextError(f"found no YAML ({problem}); needed YAML", None if mark is None else mark.line + 1)
    found = found_at(text, _position(text, mark)) + ("" if needed else f" ({problem})")
    begun = 0 if error.context_mark is None else error.context_mark.line + 1
    expected = (needed or "YAML").format(line=begun)
    return TextError(f"found {found}; needed {expected}", mark.line + 1, mark.column + 1)


def _position(text: str, mark: StringMark) -> int:
    """The index in a text of a mark, whose own counts bytes."""
    before = text.splitlines(keepends=True)[: mark.line]
    return sum(map(len, before)) + int(mark.column)
