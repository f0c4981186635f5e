"""The small renderer that made the shipped image: rays cast on textured planes under a sun and a sky."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tools.demo_scene.courtyard import REGIONS, SUN, courtyard_from_camera
from tools.demo_scene.surfaces import Array, Surface, are_blocked, first_hits
from tools.demo_scene.textures import layered_noise, linear, mixed

SUPERSAMPLING = 4
"""Rays along each side of a pixel."""

SUN_RADIUS = 0.02
"""Half angle of the sun, rad, four times the real one, so that shadows end softly."""

BLOCK = 1 << 14
"""Rays traced together: a block's arrays stay in the processor's cache."""

Indices = NDArray[np.intp]


class Camera(Protocol):
    """What the renderer needs of a camera."""

    def bearings(self, pixels: Array) -> Array:
        """Unit bearings (n, 3) of pixels (n, 2)."""

    def project(self, points: Array) -> Array:
        """Pixels (n, 2) of camera-frame points (n, 3)."""


def pixel_grid(width: int, height: int) -> Array:
    """Pixel centers (height * width, 2), row after row; a whole number is a pixel's center."""
    u, v = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
    return np.stack([u.ravel(), v.ravel()], axis=1)


def rays(camera: Camera, pixels: Array) -> Array:
    """Unit directions (n, 3) in the courtyard of pixels (n, 2)."""
    return np.asarray(camera.bearings(pixels) @ courtyard_from_camera()[0].T)


def region_labels(scene: Sequence[Surface], camera: Camera, pixels: Array) -> NDArray[np.uint8]:
    """Label of the region seen at each pixel (n, 2), 0 where there is none."""
    numbers = {design.name: k for k, design in enumerate(REGIONS, start=1)}
    of_surface = np.array([*(numbers.get(s.region or "", 0) for s in scene), 0], dtype=np.uint8)
    hit = [first_hits(scene, courtyard_from_camera()[1], rays(camera, block))[0] for block in blocks(pixels)]
    return np.asarray(of_surface[np.concatenate(hit)])


def blocks(pixels: Array) -> list[Array]:
    """The pixels (n, 2) in pieces of at most `BLOCK`."""
    return np.array_split(pixels, max(1, -(-len(pixels) // BLOCK)))


def rendered(scene: Sequence[Surface], camera: Camera, pixels: Array, pitch: float = 1.0) -> Array:
    """Linear light (n, 3) of square pixels with side `pitch` around `pixels` (n, 2).

    The mean of `SUPERSAMPLING`^2 rays; each has its own place in the pixel, on the sun and on the sky's dome.
    """
    count = SUPERSAMPLING**2
    suns, domes = sun_directions(count), dome_directions(count)
    total = np.zeros((len(pixels), 3))
    for k in range(count):
        offset = (np.array(divmod(k, SUPERSAMPLING)) + 0.5) / SUPERSAMPLING - 0.5
        shifted = blocks(pixels + pitch * offset)
        total += np.concatenate([traced(scene, rays(camera, block), suns[k], domes[k]) for block in shifted])
    return np.asarray(total / count)


def sun_directions(count: int) -> Array:
    """Unit directions (count, 3) spread evenly over the sun's disc."""
    axis = SUN / np.linalg.norm(SUN)
    across = np.cross(axis, [0.0, 0.0, 1.0])
    across /= np.linalg.norm(across)
    radius, angle = SUN_RADIUS * np.sqrt((np.arange(count) + 0.5) / count), 2.399963 * np.arange(count)
    spread = np.outer(radius * np.cos(angle), across) + np.outer(radius * np.sin(angle), np.cross(axis, across))
    directions = axis + spread
    return np.asarray(directions / np.linalg.norm(directions, axis=1, keepdims=True))


def dome_directions(count: int) -> Array:
    """Unit directions (count, 3) spread evenly over the upper half of the sphere."""
    height, angle = (np.arange(count) + 0.5) / count, 2.399963 * np.arange(count)
    level = np.sqrt(1.0 - height**2)
    return np.stack([level * np.cos(angle), level * np.sin(angle), height], axis=1)


def traced(scene: Sequence[Surface], directions: Array, sun: Array, dome: Array) -> Array:
    """Linear light (n, 3) that arrives along the rays from the camera."""
    center = courtyard_from_camera()[1]
    index, distance = first_hits(scene, center, directions)
    light = sky(directions)
    hit = np.flatnonzero(index >= 0)
    points = center + distance[hit, None] * directions[hit]
    light[hit] = reflected(scene, index[hit], points, directions[hit], sun, dome)
    return light


def reflected(
    scene: Sequence[Surface], index: Indices, points: Array, incoming: Array, sun: Array, dome: Array
) -> Array:
    """Lambert's law (n, 3): sunlight and skylight where nothing hides them, and what the ground throws back."""
    normals = np.array([surface.frame.normal for surface in scene])[index]
    normals *= -np.sign(np.sum(normals * incoming, axis=1))[:, None]
    direct = received(scene, points, normals, sun)[:, None] * np.array([2.15, 1.95, 1.62])
    diffuse = received(scene, points, normals, dome)[:, None] * np.array([0.85, 1.0, 1.25])
    bounced = (0.2 - 0.07 * normals[:, 2])[:, None] * np.array([1.1, 1.0, 0.88])
    return np.asarray(albedo(scene, index, points) * (direct + diffuse + bounced))


def received(scene: Sequence[Surface], points: Array, normals: Array, light: Array) -> Array:
    """Cosine (n,) between the normal and the light's direction (3,), 0 in the shade."""
    cosine = np.maximum(normals @ light, 0.0)
    lit = np.flatnonzero(cosine > 0.0)
    cosine[lit] *= ~are_blocked(scene, points[lit], light)
    return cosine


def albedo(scene: Sequence[Surface], index: Indices, points: Array) -> Array:
    """Colors (n, 3) of the surfaces at the points (n, 3) on them."""
    colors = np.zeros((len(points), 3))
    for number in np.unique(index):
        held = np.flatnonzero(index == number)
        u, v = scene[number].coordinates(points[held]).T
        colors[held] = scene[number].texture(u, v)
    return colors


def sky(directions: Array) -> Array:
    """Linear light (n, 3) of a sky that pales towards the horizon, with a few thin clouds."""
    height = np.clip(directions[:, 2], 0.0, 1.0)
    blue = mixed(linear("#d5e6f2"), linear("#66abea"), np.clip(height / 0.55, 0.0, 1.0) ** 0.8)
    u, v = (directions[:, :2] / (height + 0.12)[:, None]).T
    cloud = layered_noise(0.9 * u + 2.0, 1.9 * v + 5.0, 97, layers=5)
    return np.asarray(1.15 * mixed(blue, np.ones(3), 0.85 * np.clip((cloud - 0.5) / 0.22, 0.0, 1.0)))


def developed(light: Array) -> Array:
    """Levels (n, 3) from 0 to 255 of linear light: a soft shoulder, then the display's gamma."""
    exposed = 0.7 * light
    shoulder = exposed * (1.0 + exposed / 2.2**2) / (1.0 + 0.55 * exposed)
    return np.asarray(255.0 * np.clip(shoulder, 0.0, 1.0) ** (1.0 / 2.2))
