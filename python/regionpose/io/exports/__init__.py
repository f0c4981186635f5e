"""A camera's pose, and the camera where they want it, in the files of other tools."""

from __future__ import annotations

from regionpose.io.exports.formats import FORMATS, Format, exported
from regionpose.io.exports.view import ExportedView

__all__ = ["FORMATS", "ExportedView", "Format", "exported"]
