"""JSON reading, with line and column of syntax errors."""

from __future__ import annotations

import json
import re
from typing import Any

from regionpose.io.text_error import TextError, found_at, refuse_halves

NEEDED = {
    "Expecting value": "a value: a number, a text in double quotes, true, false, null, [ or {",
    "Expecting ',' delimiter": "a comma, or the bracket that closes",
    "Expecting ':' delimiter": "a colon after the name",
    "Expecting property name": "a name in double quotes",
    "Illegal trailing comma": "no comma before a closing bracket",
    "Extra data": "nothing after the end of the value",
    "Unterminated string": "a double quote where the text ends",
    "Invalid control character": "a double quote where the text ends, or \\n for a new line in it",
    "Invalid \\": "an escape of JSON's, such as \\n or \\u00e4; a backslash is written twice",
}
"""What JSON needs where it ends, by how Python's parser begins its message."""

_ESCAPE = re.compile(r"\\(?:(u[dD][89abAB]..\\u[dD][c-fC-F]..)|.)")


def json_value(text: str) -> Any:
    """The value of a JSON text; TextError where it is none, or holds half of a surrogate pair.

    NaN and infinities, which JSON lacks, are read as Python's writer spells them.
    """
    if not text.strip():
        raise TextError("found an empty file; needed JSON")
    try:
        value = json.loads(text)
    except json.JSONDecodeError as error:
        raise TextError(_described(error), error.lineno, error.colno) from error
    except RecursionError as error:
        raise TextError("found brackets nested too deep; needed fewer levels") from error
    except ValueError as error:
        raise TextError("found a number of thousands of digits; needed fewer") from error
    refuse_halves(text, value)
    return value


def joined_pairs(text: str) -> str:
    """A JSON text with the characters that it writes as two escapes, a surrogate pair, which YAML does not know."""
    return _ESCAPE.sub(lambda found: json.loads(f'"{found.group()}"') if found.group(1) else found.group(), text)


def _described(error: json.JSONDecodeError) -> str:
    needed = next((text for start, text in NEEDED.items() if error.msg.startswith(start)), f"JSON ({error.msg})")
    return f"found {found_at(error.doc, error.pos)}; needed {needed}"
