"""Docstrings of public names: a line for each parameter, and examples that run."""

from __future__ import annotations

import doctest
import importlib
import inspect
import re
from collections.abc import Iterator
from enum import Enum
from pathlib import Path

import pytest
import regionpose as rp
from public_names import PUBLIC

PACKAGE = Path(rp.__file__).parent
MAIN_METHODS = (
    "cameras.Camera.bearings",
    "cameras.Camera.project",
    "cameras.Camera.resized",
    "Cloud.from_points",
    "ImageRegion.from_mask",
    "ImageRegion.from_polygon",
    "Pose.from_matrix",
    "Pose.from_parts",
    "Pose.from_quat",
    "Pose.transform",
    "WorldRegion.from_mesh",
    "WorldRegion.from_points",
    "WorldRegion.from_polygon",
    "WorldRegion.from_polygons",
    "WorldRegion.from_samples",
    "WorldRegion.from_scan",
    "WorldRegion.with_viewpoint",
)
"""Methods that README's main path goes through."""

BARE = {"Camera", "Scene", "WorldRegion"}
"""Classes that are made by subclasses or by their methods."""


def documented() -> Iterator[str]:
    """Public functions and classes with parameters, without enums, and the main methods."""
    for name, value in PUBLIC.items():
        if (
            callable(value)
            and not name.startswith("kernels.")
            and name.split(".")[-1] not in BARE
            and not issubclass_of(value, (Exception, Warning, Enum))
        ):
            yield name
    yield from MAIN_METHODS


def issubclass_of(value: object, kinds: tuple[type, ...]) -> bool:
    """Whether it is a class of these kinds."""
    return isinstance(value, type) and issubclass(value, kinds)


def named(path: str) -> object:
    """The public object of a dotted name."""
    value: object = rp
    for part in path.split("."):
        value = getattr(value, part)
    return value


@pytest.mark.parametrize("path", list(documented()))
def test_every_parameter_has_its_line(path: str) -> None:
    value = named(path)
    assert callable(value)
    text = inspect.cleandoc(value.__doc__ or "")
    section = re.split(r"\n\w+\n-+\n", text.partition("Parameters\n----------\n")[2])[0]
    lines = re.findall(r"^(\w[\w, ]*) : \S", section, re.MULTILINE)
    told = [name.strip() for line in lines for name in line.split(",")]
    assert sorted(told) == sorted(set(inspect.signature(value).parameters) - {"self"})


def modules_with_examples() -> list[str]:
    """Dotted names of the package's modules that hold examples."""
    files = [file for file in sorted(PACKAGE.glob("**/*.py")) if "\n    >>> " in file.read_text(encoding="utf-8")]
    return [".".join(("regionpose", *file.relative_to(PACKAGE).with_suffix("").parts)) for file in files]


@pytest.mark.parametrize("name", modules_with_examples())
def test_examples_of_docstrings_run(name: str) -> None:
    result = doctest.testmod(importlib.import_module(name))
    assert result.attempted > 0 and result.failed == 0
