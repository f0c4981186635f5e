"""The command `regionpose`."""

from __future__ import annotations

from regionpose.cli.app import main

__all__ = ["main"]
