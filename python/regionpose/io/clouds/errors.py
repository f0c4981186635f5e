"""What goes wrong with clouds: files that cannot be used."""

from __future__ import annotations

from pathlib import Path

LONGEST_FOUND = 200
"""Characters of what was found that a message quotes at most."""


class CloudError(ValueError):
    """A cloud that cannot be used: names the file, the item, what was found and what is needed."""


def cloud_error(place: Path | str | None, item: str, found: object, needed: str) -> CloudError:
    """The error about `item` of the file `place` (None: of a cloud that comes from no file)."""
    text = " ".join(str(found).split())
    if len(text) > LONGEST_FOUND:
        text = f"{text[:LONGEST_FOUND]}..."
    return CloudError(f"{place or 'cloud'}: {item}: found {text}; needed {needed}")
