"""Found values as they are quoted in error messages."""

from __future__ import annotations

MOST_CHARACTERS = 60
"""Characters of a found value that a message quotes at most."""


def quoted(value: object) -> str:
    """`repr` of a value, cut to `MOST_CHARACTERS`."""
    text = repr(value)
    return text if len(text) <= MOST_CHARACTERS else f"{text[: MOST_CHARACTERS - 3]}..."
