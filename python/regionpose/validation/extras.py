"""Packages that not every installation has."""

from __future__ import annotations

import importlib
from typing import Any


class MissingExtraError(ImportError):
    """Raised where an optional package is missing; the message names the extra of regionpose that installs it."""


def load_extra(module: str, extra: str, purpose: str) -> Any:
    """The module `module`; MissingExtraError naming the extra that brings it, where it is not installed."""
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        name = module.partition(".")[0]
        if error.name not in {name, module}:
            raise
        message = f'{purpose} needs the package {name}, which is not installed: pip install "regionpose[{extra}]"'
        raise MissingExtraError(message, name=name) from error
