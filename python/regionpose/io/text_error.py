"""What is wrong with a text that a person may have typed, and where."""

from __future__ import annotations

import json
import re

MOST_QUOTED = 20
"""Characters of a text that a message quotes at most: a word, which is found again on its line."""

_ESCAPED_SURROGATE = re.compile(r"\\u[dD][89a-fA-F]")
_WORD = re.compile(r"[\w.+-]+|.", re.DOTALL)


class TextError(ValueError):
    """A text that isn't what it should be: `found ...; needed ...`, and line and column, from 1, where known."""

    def __init__(self, problem: str, line: int | None = None, column: int | None = None) -> None:
        """Keep the place beside the message."""
        super().__init__(problem)
        self.line, self.column = line, column

    @property
    def place(self) -> str:
        """The place in words, before a message: nothing where it isn't known."""
        if self.line is None:
            return ""
        return f"line {self.line}: " if self.column is None else f"line {self.line}, column {self.column}: "

    @property
    def suffix(self) -> str:
        """The place as it follows the name of a file: `:line:column`, as far as it is known."""
        return "".join(f":{number}" for number in (self.line, self.column) if number is not None)


def found_at(text: str, position: int) -> str:
    """The word or the sign at a position of a text, as a message quotes it."""
    word = _WORD.match(text, position)
    if word is None:
        return "the end of the text"
    return "the end of the line" if word.group() in "\r\n" else repr(word.group()[:MOST_QUOTED])


def refuse_halves(text: str, value: object) -> None:
    """TextError where a value read from a text holds half of a surrogate pair, which no file can."""
    if not _ESCAPED_SURROGATE.search(text):
        return
    try:
        json.dumps(value, ensure_ascii=False, default=str, skipkeys=True).encode("utf-8")
    except UnicodeEncodeError as error:
        raise TextError("found half of a surrogate pair, \\ud800 to \\udfff; needed both halves") from error
