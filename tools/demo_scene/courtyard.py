"""The courtyard itself: its surfaces, its six named regions, its light, and where the camera and the lidar stand.

Courtyard axes: x right, y away from the camera, z up, meters, the ground at z = 0. Users never see these axes: what
ships is in the lidar's frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from tools.demo_scene.surfaces import Array, Frame, Surface, Texture
from tools.demo_scene.textures import (
    bricks,
    foliage,
    marked,
    panes,
    pavers,
    plain,
    planks,
    plaster,
    roof_tiles,
    strokes,
)

UP = np.array([0.0, 0.0, 1.0])

CAMERA_CENTER = np.array([-0.1, 0.0, 1.6])
CAMERA_TURN_DEG = (2.5, 3.0, -0.6)
"""Turn to the right about the vertical, upwards tilt, and roll about the optical axis."""

LIDAR_CENTER = np.array([0.75, 0.45, 1.85])
LIDAR_TURN_DEG = (58.0, 5.0, -7.0)
"""Yaw, pitch and roll about z, y and x of a lidar whose x points along the courtyard's x before it is turned."""

SUN = np.array([-0.22, -0.78, 0.58])
"""Direction towards the sun, not normalized."""


@dataclass(frozen=True)
class RegionDesign:
    """A region's name and a point of it, in its own plane's coordinates, where nothing is painted."""

    name: str
    seed: tuple[float, float]


REGIONS = (
    RegionDesign("door", (0.8, 1.8)),
    RegionDesign("notice-board", (-1.62, 1.72)),
    RegionDesign("arrow", (1.0, 2.41)),
    RegionDesign("poster", (0.92, 1.4)),
    RegionDesign("awning", (0.95, 0.45)),
    RegionDesign("chalkboard", (0.36, 0.25)),
)
"""In the order of their labels, from 1."""


def turned(yaw_deg: float, pitch_deg: float, roll_deg: float) -> Array:
    """Rotation (3, 3) `Rz(yaw) Ry(pitch) Rx(roll)`."""
    return np.asarray(Rotation.from_euler("ZYX", [yaw_deg, pitch_deg, roll_deg], degrees=True).as_matrix())


def courtyard_from_camera() -> tuple[Array, Array]:
    """Rotation (3, 3) and translation (3,), meters, from the camera's frame (x right, y down, z ahead)."""
    turn, tilt, roll = CAMERA_TURN_DEG
    ahead = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    turns = Rotation.from_euler("YXZ", [turn, tilt, roll], degrees=True).as_matrix()
    return ahead @ turns, CAMERA_CENTER


def courtyard_from_lidar() -> tuple[Array, Array]:
    """Rotation (3, 3) and translation (3,), meters, from the lidar's frame (z along its spin axis)."""
    return turned(*LIDAR_TURN_DEG), LIDAR_CENTER


def wall(corner: tuple[float, float], towards: tuple[float, float], height: float = 0.0) -> Frame:
    """Upright frame at `corner` on the ground (or `height` above), with `u` along the ground in the direction given."""
    right = np.array([towards[0], towards[1], 0.0])
    return Frame(np.array([*corner, height]), right / np.linalg.norm(right), UP)


def leaning(corner: tuple[float, float, float], yaw_deg: float, lean_deg: float) -> Frame:
    """Frame at `corner`, turned by `yaw_deg` about the vertical, its top leaning backwards by `lean_deg`."""
    turn = turned(yaw_deg, 0.0, -lean_deg)
    return Frame(np.array(corner), turn[:, 0], turn[:, 2])


def floor(corner: tuple[float, float, float], yaw_deg: float = 0.0) -> Frame:
    """Level frame that faces upwards, `u` along x and `v` along y before the turn by `yaw_deg`."""
    turn = turned(yaw_deg, 0.0, 0.0)
    return Frame(np.array(corner), turn[:, 0], turn[:, 1])


def rectangle(u0: float, v0: float, u1: float, v1: float) -> Array:
    """Ring (4, 2) of an upright rectangle, counter-clockwise."""
    return np.array([(u0, v0), (u1, v0), (u1, v1), (u0, v1)])


def arched(u0: float, v0: float, u1: float, v1: float, arcs: int = 32) -> Array:
    """Ring of a rectangle whose top is a half circle that peaks at `v1`."""
    radius = 0.5 * (u1 - u0)
    angle = np.linspace(0.0, np.pi, arcs + 1)
    arc = np.stack([u0 + radius + radius * np.cos(angle), v1 - radius + radius * np.sin(angle)], axis=1)
    return np.concatenate([[(u0, v0), (u1, v0)], arc])


def scalloped(width: float, drop: float, depth: float, count: int, arcs: int = 8) -> Array:
    """Ring of a strip below v = 0 that hangs in `count` half ovals, counter-clockwise."""
    angle = np.linspace(np.pi, 2.0 * np.pi, arcs + 1)
    half = 0.5 * width / count
    ovals = [
        np.stack([(2 * k + 1) * half + half * np.cos(angle), -drop + depth * np.sin(angle)], axis=1)
        for k in range(count)
    ]
    return np.concatenate([*ovals, [(width, 0.0), (0.0, 0.0)]])


def leafy(width: float, height: float, seed: int, points: int = 90) -> Array:
    """Ring of a bush's outline above v = 0, centered on u = 0."""
    rng = np.random.default_rng(seed)
    angle = np.linspace(0.0, 2.0 * np.pi, points, endpoint=False)
    swell = sum(rng.uniform(0.02, 0.06) * np.cos(k * angle + rng.uniform(0.0, 6.3)) for k in (3, 5, 8))
    radius = 0.9 + swell + rng.uniform(-0.06, 0.06, points)
    ring = np.stack([0.5 * width * radius * np.cos(angle), 0.5 * height * (1.0 + radius * np.sin(angle))], axis=1)
    return np.asarray(ring)


def box(corner: tuple[float, ...], size: tuple[float, float, float], yaw_deg: float, side: Texture) -> list[Surface]:
    """Front, left, right and top faces of a box whose front lower left corner is `corner`: (x, y), or (x, y, z)."""
    width, depth, height = size
    base = corner if len(corner) == 3 else (*corner, 0.0)
    axes = turned(yaw_deg, 0.0, 0.0)
    start = np.array(base)
    front = Frame(start, axes[:, 0], UP)
    left = Frame(start + depth * axes[:, 1], -axes[:, 1], UP)
    right = Frame(start + width * axes[:, 0], axes[:, 1], UP)
    top = Frame(start + height * UP, axes[:, 0], axes[:, 1])
    sizes = ((front, width, height), (left, depth, height), (right, depth, height), (top, width, depth))
    return [Surface(frame, (rectangle(0.0, 0.0, u, v),), side) for frame, u, v in sizes]


LEFT = wall((-2.0, 7.2), (2.6, 3.0))
BACK = wall((-2.0, 7.2), (1.0, 0.0))
RIGHT = wall((2.2, 7.2), (2.6, -3.4))

STONE = plain("#b9ad98", 0.12)
CREAM = plain("#efe6d2", 0.04)
OAK = planks("#8a5f3a", 0.14)


def shell() -> list[Surface]:
    """Ground, walls, copings and roof."""
    eaves = Frame(np.array([-2.35, 6.9, 3.36]), np.array([1.0, 0.0, 0.0]), np.array([0.0, np.cos(0.7), np.sin(0.7)]))
    return [
        Surface(floor((0.0, 0.0, 0.0), 9.0), (rectangle(-9.0, -7.0, 9.0, 9.0),), pavers("#a89c8b", "#5d564d")),
        Surface(LEFT, (rectangle(-6.5, 0.0, 0.0, 2.95),), plaster("#ebc48a", "#9a8f80", 0.42)),
        Surface(LEFT.lifted(0.07), (rectangle(-6.5, 2.88, 0.05, 3.04),), STONE),
        Surface(BACK, (rectangle(0.0, 0.0, 4.2, 3.55),), bricks("#a6553f", "#b8aa98")),
        Surface(RIGHT, (rectangle(0.0, 0.0, 6.5, 3.5),), planks("#86a193", 0.19)),
        Surface(RIGHT.lifted(0.05), (rectangle(-0.05, 3.4, 6.5, 3.56),), plain("#5b5048", 0.1)),
        Surface(RIGHT.lifted(0.03), (rectangle(0.0, 0.0, 6.5, 0.22),), plain("#5b5048", 0.1)),
        Surface(eaves, (np.array([(0.0, 0.0), (5.3, 0.0), (4.2, 2.7), (1.1, 2.7)]),), roof_tiles("#c4693f")),
        Surface(wall((-2.35, 6.9), (1.0, 0.0), 3.22), (rectangle(0.0, 0.0, 5.3, 0.16),), plain("#e9e0cf", 0.05)),
        *box((-1.15, 7.9, 3.9), (0.5, 0.45, 1.25), 0.0, bricks("#94503d", "#a99c8c")),
        *box((-1.21, 7.85, 5.1), (0.62, 0.55, 0.09), 0.0, STONE),
    ]


def door_and_window() -> list[Surface]:
    """What the back wall carries: the door in its stone arch, the window below its awning."""
    panels = strokes(((0.7, 0.24, 0.98, 0.9), (1.12, 0.24, 1.4, 0.9), (0.7, 1.05, 0.98, 1.6), (1.12, 1.05, 1.4, 1.6)))
    painted = marked(marked(plain("#1f6f78"), panels, 0.16), strokes(((1.046, 0.1, 1.054, 2.3),)), 0.3)
    window = BACK.lifted(0.02)
    glass = Frame(window.points(np.array([[2.42, 1.08]]))[0] + 0.01 * window.normal, window.right, window.up)
    slope = np.array([0.0, 0.62, 0.78]) / np.hypot(0.62, 0.78)
    hem = np.array([0.12, 6.56, 2.2])
    awning = Frame(hem, np.array([1.0, 0.0, 0.0]), slope)
    length = 0.62 / slope[1]
    cloth = np.array([(0.0, 0.0), (1.96, 0.0), (1.78, length), (0.18, length)])
    return [
        Surface(BACK.lifted(0.02), (arched(0.38, 0.0, 1.72, 2.52),), STONE),
        Surface(BACK.lifted(0.04), (arched(0.54, 0.1, 1.56, 2.36),), painted, "door"),
        *box((-1.7, 6.86), (1.5, 0.34, 0.1), 0.0, plain("#9f9586", 0.12)),
        Surface(window, (rectangle(2.32, 0.98, 3.88, 2.2),), CREAM),
        Surface(glass, (rectangle(0.0, 0.0, 1.36, 1.02),), panes("#7f9db3", "#efe6d2", 3, 2, (1.36, 1.02))),
        Surface(BACK.lifted(0.12), (rectangle(2.24, 0.9, 3.96, 0.99),), STONE),
        Surface(awning, (cloth,), plain("#b5262b"), "awning"),
        Surface(Frame(hem, awning.right, UP), (scalloped(1.96, 0.07, 0.07, 10),), CREAM),
    ]


def signs() -> list[Surface]:
    """The notice board on the left wall, the arrow and the poster on the right wall, the chalkboard on the ground."""
    ell = np.array([(-2.15, 1.22), (-0.75, 1.22), (-0.75, 1.78), (-1.28, 1.78), (-1.28, 2.5), (-2.15, 2.5)])
    notes = strokes(((-2.0, 2.05, -1.72, 2.36), (-1.64, 2.1, -1.42, 2.36), (-1.15, 1.34, -0.9, 1.66)))
    arrow = np.array(
        [(0.3, 2.16), (1.32, 2.16), (1.32, 2.0), (1.86, 2.38), (1.32, 2.82), (1.32, 2.66), (0.3, 2.66), (0.52, 2.41)]
    )
    words = strokes(((0.68, 2.5, 1.2, 2.56), (0.68, 2.27, 1.05, 2.32)))
    sheet = np.array([(0.68, 0.8), (1.58, 0.8), (1.58, 1.6), (1.3, 1.88), (0.68, 1.88)])
    chalk = strokes(
        ((0.14, 0.88, 0.37, 0.93), (0.12, 0.6, 0.56, 0.63), (0.12, 0.5, 0.48, 0.53), (0.12, 0.4, 0.6, 0.43))
    )
    stand = leaning((0.95, 4.75, 0.03), 16.0, 15.0)
    slate = np.array([(0.0, 0.0), (0.78, 0.0), (0.72, 0.78), (0.5, 0.78), (0.44, 1.06), (0.06, 1.06)])
    rest = leaning((0.95 + 0.78 * np.cos(0.28), 5.47, 0.0), 196.0, 15.0)
    return [
        Surface(LEFT.lifted(0.03), (ell,), marked(plain("#2f62c4"), notes, 0.2), "notice-board"),
        Surface(RIGHT.lifted(0.03), (arrow,), marked(plain("#f0b41c"), words, 0.18), "arrow"),
        Surface(RIGHT.lifted(0.015), (sheet,), marked(plain("#f3eee2", 0.02), poster_picture, 0.14), "poster"),
        Surface(rest, (rectangle(0.06, 0.0, 0.72, 0.72),), OAK),
        Surface(stand, (slate,), marked(plain("#22332d"), chalk, -0.8), "chalkboard"),
    ]


def poster_picture(u: Array, v: Array) -> Array:
    """Marks of the poster: a sun over two hills."""
    sun = (u - 1.22) ** 2 + (v - 1.52) ** 2 < 0.13**2
    hills = (v > 0.88) & (v < 1.06 + 0.1 * np.sin(6.0 * u) + 0.05 * np.cos(11.0 * u)) & (u > 0.78) & (u < 1.48)
    return np.asarray(sun | hills, dtype=np.float64)


def greenery() -> list[Surface]:
    """Trees beyond the walls, planters, a crate."""
    leaves = foliage("#1f4a1c", "#7fae45")
    far = foliage("#24502a", "#6c9a4c")
    trees = [
        (-6.2, 10.5, 1.6, 3.0, 3.4, 1),
        (-4.4, 11.5, 1.4, 3.4, 3.9, 2),
        (-8.2, 9.5, 1.2, 3.0, 3.2, 3),
        (6.4, 11.0, 2.2, 3.6, 3.6, 4),
    ]
    bushes = [(-1.93, 6.52, 0.42, 0.62, 0.74, 5), (2.08, 6.32, 0.38, 0.6, 0.66, 6)]
    crowns = [Surface(wall((x, y), (1.0, 0.0), z), (leafy(w, h, seed),), far) for x, y, z, w, h, seed in trees]
    plants = [
        Surface(Frame(np.array([x, y + dy, z]), turned(turn, 0.0, 0.0)[:, 0], UP), (leafy(w, h, 10 * seed),), leaves)
        for x, y, z, w, h, seed in bushes
        for dy, turn in ((-0.04, 0.0), (0.0, 60.0), (0.03, -60.0))
    ]
    pots = [*box((-2.15, 6.35), (0.44, 0.34, 0.45), 0.0, plain("#c77d55", 0.1))]
    pots += box((1.84, 6.12), (0.48, 0.36, 0.4), 0.0, plain("#c77d55", 0.1))
    crate = box((2.95, 4.75), (0.62, 0.5, 0.5), -52.6, planks("#b98a55", 0.125, upright=False, gap=0.018))
    return [*crowns, *plants, *pots, *crate]


def surfaces() -> list[Surface]:
    """Every surface of the courtyard."""
    return [*shell(), *door_and_window(), *signs(), *greenery()]
