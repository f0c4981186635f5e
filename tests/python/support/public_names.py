"""The public names: those of the package, and those of its modules as `module.name`."""

from __future__ import annotations

import inspect
from operator import attrgetter

import regionpose as rp

MODULES = tuple(name for name in rp.__all__ if inspect.ismodule(getattr(rp, name)))
"""Modules that the package hands out."""

PUBLIC: dict[str, object] = {
    name: attrgetter(name)(rp)
    for name in (
        *(name for name in rp.__all__ if name not in (*MODULES, "__version__")),
        *(f"{module}.{name}" for module in MODULES for name in getattr(rp, module).__all__),
    )
}
"""Public objects by their dotted names; a camera is in the package as well as in `cameras`."""
