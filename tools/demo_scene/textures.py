"""Procedural colors of the courtyard: linear light in [0, 1], from plane coordinates in meters."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tools.demo_scene.surfaces import Array, Texture

SRGB_GAMMA = 2.2
"""Exponent between stored and linear light; the exact sRGB curve looks the same."""


def linear(color: str) -> Array:
    """Linear light (3,) of a color written `#rrggbb`."""
    stored = np.array([int(color[i : i + 2], 16) for i in (1, 3, 5)], dtype=np.float64) / 255.0
    return np.asarray(stored**SRGB_GAMMA)


def lattice_noise(i: Array, j: Array, seed: int) -> Array:
    """Repeatable noise in [0, 1) of whole-numbered cells `(i, j)`; integer hashing, so the same on every machine."""
    key = i.astype(np.int64).astype(np.uint32) * np.uint32(0x9E3779B1)
    key ^= j.astype(np.int64).astype(np.uint32) * np.uint32(0x85EBCA77)
    key ^= np.uint32((seed * 0xC2B2AE3D) & 0xFFFFFFFF)
    for shift, factor in ((15, 0x2C1B3C6D), (12, 0x297A2D39)):
        key = (key ^ (key >> np.uint32(shift))) * np.uint32(factor)
    key ^= key >> np.uint32(15)
    return key.astype(np.float64) / 2.0**32


def smooth_noise(u: Array, v: Array, seed: int) -> Array:
    """Noise in [0, 1) that varies smoothly over one unit of `u` and `v`."""
    i, j = np.floor(u), np.floor(v)
    s, t = (w * w * (3.0 - 2.0 * w) for w in (u - i, v - j))
    low = lattice_noise(i, j, seed) * (1.0 - s) + lattice_noise(i + 1, j, seed) * s
    high = lattice_noise(i, j + 1, seed) * (1.0 - s) + lattice_noise(i + 1, j + 1, seed) * s
    return low * (1.0 - t) + high * t


def layered_noise(u: Array, v: Array, seed: int, layers: int = 4) -> Array:
    """Noise in [0, 1): `layers` octaves of smooth noise, each half as strong and twice as fine as the one before."""
    total = sum(0.5**k * smooth_noise(u * 2.0**k, v * 2.0**k, seed + k) for k in range(layers))
    return np.asarray(total / (2.0 - 0.5 ** (layers - 1)))


def tinted(color: Array, strength: Array) -> Array:
    """Colors (n, 3): `color` (3,) or (n, 3) times `strength` (n,)."""
    return np.asarray(color * strength[:, None])


def mixed(below: Array, above: Array, weight: Array | NDArray[np.bool_]) -> Array:
    """Colors (n, 3): `above` where the weight (n,) is 1, `below` where it is 0."""
    share = np.asarray(weight, dtype=np.float64)[:, None]
    return np.asarray(below * (1.0 - share) + above * share)


def plain(color: str, grain: float = 0.04) -> Texture:
    """Paint of one color with a faint grain, a fraction of the color."""
    base = linear(color)

    def shade(u: Array, v: Array) -> Array:
        return tinted(base, 1.0 + grain * (2.0 * layered_noise(9.0 * u, 9.0 * v, 3) - 1.0))

    return shade


def plaster(color: str, plinth: str, plinth_height: float) -> Texture:
    """Weathered plaster, stained from above, on a plinth of stone."""
    base, stone = linear(color), linear(plinth)

    def shade(u: Array, v: Array) -> Array:
        stain = layered_noise(0.9 * u, 0.5 * v, 11) - 0.5
        grain = layered_noise(30.0 * u, 30.0 * v, 17, layers=2) - 0.5
        splash = np.exp(-np.maximum(v - plinth_height, 0.0) / 0.25)
        wall = tinted(base, 1.0 + 0.34 * stain + 0.14 * grain - 0.16 * splash)
        block = np.floor(u / 0.62)
        joint = np.abs(u / 0.62 - block - 0.5) > 0.488
        foot = tinted(stone, 0.85 + 0.25 * lattice_noise(block, block, 5) + 0.2 * grain - 0.35 * joint)
        return mixed(wall, foot, v < plinth_height)

    return shade


class Bond(NamedTuple):
    """Row and column (n,) of the stone at each point, and the distance from its edge, meters."""

    row: Array
    column: Array
    edge: Array


def running_bond(u: Array, v: Array, length: float, height: float) -> Bond:
    """Stones in rows of which every other one is moved by half a stone; sizes in meters."""
    row = np.floor(v / height)
    along = u / length + 0.5 * np.mod(row, 2.0)
    column = np.floor(along)
    edge_u = np.minimum(along - column, column + 1.0 - along) * length
    edge_v = np.minimum(v / height - row, row + 1.0 - v / height) * height
    return Bond(row, column, np.minimum(edge_u, edge_v))


def bricks(color: str, mortar: str, length: float = 0.25, height: float = 0.083, joint: float = 0.011) -> Texture:
    """Running-bond brickwork; sizes in meters."""
    base, bed = linear(color), linear(mortar)

    def shade(u: Array, v: Array) -> Array:
        row, column, edge = running_bond(u, v, length, height)
        tone = lattice_noise(column, row, 7)
        warm = lattice_noise(column, row, 8) - 0.5
        stain = layered_noise(0.8 * u, 0.8 * v, 23) - 0.5
        grain = layered_noise(40.0 * u, 40.0 * v, 29, layers=2) - 0.5
        brick = tinted(base * (1.0 + warm[:, None] * np.array([0.10, -0.12, -0.2])), 0.72 + 0.5 * tone + 0.3 * grain)
        wall = mixed(brick, tinted(bed, 1.0 + 0.3 * grain), edge < 0.5 * joint)
        return tinted(wall, (1.0 + 0.4 * stain) * (1.0 - 0.35 * np.exp(-np.maximum(v, 0.0) / 0.3)))

    return shade


def planks(color: str, width: float, upright: bool = True, gap: float = 0.008) -> Texture:
    """Boards with grain along them; sizes in meters."""
    base = linear(color)

    def shade(u: Array, v: Array) -> Array:
        across, along = (u, v) if upright else (v, u)
        board = np.floor(across / width)
        offset = across - board * width
        tone = lattice_noise(board, board, 13)
        grain = layered_noise(across * 55.0, along * 2.2 + 40.0 * tone, 31, layers=3) - 0.5
        dark = np.minimum(offset, width - offset) < 0.5 * gap
        return tinted(base, (0.82 + 0.3 * tone + 0.45 * grain) * np.where(dark, 0.3, 1.0))

    return shade


def pavers(color: str, joint: str, size: float = 0.42, gap: float = 0.016) -> Texture:
    """Staggered square slabs with joints; sizes in meters."""
    base, bed = linear(color), linear(joint)

    def shade(u: Array, v: Array) -> Array:
        row, column, edge = running_bond(u, v, size, size)
        tone = lattice_noise(column, row, 41)
        warm = (lattice_noise(column, row, 43) - 0.5)[:, None] * np.array([0.16, 0.04, -0.14])
        stain = layered_noise(0.7 * u, 0.7 * v, 47) - 0.5
        grain = layered_noise(22.0 * u, 22.0 * v, 53, layers=3) - 0.5
        slab = tinted(base * (1.0 + warm), 0.8 + 0.32 * tone + 0.35 * grain)
        floor = mixed(slab, tinted(bed, 1.0 + grain), edge < 0.5 * gap)
        return tinted(floor, 1.0 + 0.45 * stain)

    return shade


def roof_tiles(color: str, width: float = 0.24, course: float = 0.2) -> Texture:
    """Courses of curved clay tiles; sizes in meters."""
    base = linear(color)

    def shade(u: Array, v: Array) -> Array:
        row = np.floor(v / course)
        along = u / width + 0.5 * np.mod(row, 2.0)
        column = np.floor(along)
        bow = 1.0 - (2.0 * (along - column) - 1.0) ** 2
        lip = np.exp(-(v / course - row) / 0.12)
        tone = lattice_noise(column, row, 61)
        return tinted(base, (0.62 + 0.4 * tone) * (0.55 + 0.55 * bow) * (1.0 - 0.55 * lip))

    return shade


def foliage(color: str, light: str) -> Texture:
    """Leaves: clumps of two greens with dark gaps."""
    dark, bright = linear(color), linear(light)

    def shade(u: Array, v: Array) -> Array:
        clump = layered_noise(7.0 * u, 7.0 * v, 71)
        leaf = smooth_noise(60.0 * u, 60.0 * v, 73)
        share = np.clip(1.6 * clump + 0.5 * leaf - 0.6, 0.0, 1.0)
        return tinted(mixed(dark, bright, share), 0.55 + 0.7 * leaf)

    return shade


def panes(glass: str, bars: str, columns: int, rows: int, size: tuple[float, float], bar: float = 0.045) -> Texture:
    """A window from (0, 0) to `size`: panes that mirror a sky brighter above, between painted bars, meters."""
    pane, paint = linear(glass), linear(bars)

    def shade(u: Array, v: Array) -> Array:
        a, b = u / size[0] * columns, v / size[1] * rows
        edge_u = np.abs(a - np.round(a)) * size[0] / columns
        edge_v = np.abs(b - np.round(b)) * size[1] / rows
        glow = 0.45 + 0.9 * (v / size[1]) ** 2 + 0.9 * (np.abs(u / size[0] + 0.35 * v / size[1] - 0.62) < 0.07)
        return mixed(tinted(pane, glow), paint, np.minimum(edge_u, edge_v) < 0.5 * bar)

    return shade


def marked(below: Texture, marks: Callable[[Array, Array], Array], strength: float) -> Texture:
    """A texture dimmed by the fraction `strength` where `marks` (0 to 1) says so."""

    def shade(u: Array, v: Array) -> Array:
        return tinted(below(u, v), 1.0 - strength * marks(u, v))

    return shade


def strokes(bars: tuple[tuple[float, float, float, float], ...]) -> Callable[[Array, Array], Array]:
    """Marks 1 inside any of the rectangles `(u0, v0, u1, v1)`, meters."""

    def mark(u: Array, v: Array) -> Array:
        held = [(u >= a) & (u <= c) & (v >= b) & (v <= d) for a, b, c, d in bars]
        return np.asarray(np.any(held, axis=0), dtype=np.float64)

    return mark
