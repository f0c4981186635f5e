"""The benchmark's template shapes, read from the package's data file."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from benchmarks.synthetic.polygons import random_polygon

TemplateSet = Literal["asymmetric", "symmetric", "all", "polygons"]

POLYGON = "polygon"
"""Name of a shape that was drawn at random (`polygons.py`)."""


@dataclass(frozen=True)
class Template:
    """A planar shape of longer side 1 m, area centroid at the origin, x right and y down as its front is seen.

    `rings`: (n, 2) meters, the outer ring first and counter-clockwise in (x, y), holes clockwise.
    `symmetry_order`: how many rotations about the origin (the identity included) map the shape onto itself.
    `mirror`: whether a reflection about a line through the origin does.
    """

    name: str
    symmetry_order: int
    mirror: bool
    rings: tuple[NDArray[np.float64], ...]

    @property
    def symmetric(self) -> bool:
        """True when a rotation other than the identity, or a reflection, maps the shape onto itself."""
        return self.symmetry_order > 1 or self.mirror

    def region(self) -> list[NDArray[np.float64]]:
        """The rings as (n, 3) world points in the plane z = 0; the front is seen along +z."""
        return [np.column_stack([ring, np.zeros(len(ring))]) for ring in self.rings]


@cache
def all_templates() -> tuple[Template, ...]:
    """All 25 templates, in the order of the data file; their arrays are read-only."""
    text = files("benchmarks.synthetic").joinpath("templates.json").read_text(encoding="utf-8")
    templates = []
    for record in json.loads(text):
        rings = tuple(np.array(ring, dtype=np.float64) for ring in record["rings"])
        for ring in rings:
            ring.setflags(write=False)
        templates.append(Template(record["name"], record["symmetry_order"], record["mirror"], rings))
    return tuple(templates)


def polygon_template(rng: np.random.Generator, longer_side: float = 1.0) -> Template:
    """A random polygon whose longer side has that length, meters."""
    return Template(POLYGON, 1, False, (random_polygon(rng, longer_side),))


def is_symmetric(name: str) -> bool:
    """Whether the shape of that name is symmetric."""
    return name != POLYGON and template_named(name).symmetric


def load_templates(which: TemplateSet = "all") -> tuple[Template, ...]:
    """The templates of one set: "asymmetric" has no symmetry at all, "symmetric" is the rest, "all" both.

    Random polygons ("polygons") have no list: `polygon_template` draws each.
    """
    if which == "all":
        return all_templates()
    if which not in ("asymmetric", "symmetric"):
        raise ValueError(f'template set is {which!r}; it must be "asymmetric", "symmetric" or "all"')
    return tuple(template for template in all_templates() if template.symmetric == (which == "symmetric"))


def template_named(name: str) -> Template:
    """The template of that name; ValueError lists the known names."""
    for template in all_templates():
        if template.name == name:
            return template
    known = ", ".join(template.name for template in all_templates())
    raise ValueError(f"no template is named {name!r}; the names are: {known}")
