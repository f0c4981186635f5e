"""What goes wrong with clouds: files that cannot be used, and packages that are not installed."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

LONGEST_FOUND = 200
"""Characters of what was found that a message quotes at most."""


class CloudError(ValueError):
    """A cloud that cannot be used: names the file, the item, what was found and what is needed."""


class MissingExtraError(ImportError):
    """A kind of file whose package is not installed; the message says which extra of regionpose brings it."""


def cloud_error(place: Path | str | None, item: str, found: object, needed: str) -> CloudError:
    """The error about `item` of the file `place` (None: of a cloud that comes from no file)."""
    text = " ".join(str(found).split())
    if len(text) > LONGEST_FOUND:
        text = f"{text[:LONGEST_FOUND]}..."
    return CloudError(f"{place or 'cloud'}: {item}: found {text}; needed {needed}")


def load_extra(module: str, extra: str, purpose: str) -> Any:
    """The module `module`; MissingExtraError naming the extra that brings it, where it is not installed."""
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        if error.name != module.partition(".")[0]:
            raise
        message = f'{purpose} needs the package {module}, which is not installed: pip install "regionpose[{extra}]"'
        raise MissingExtraError(message, name=module) from error
