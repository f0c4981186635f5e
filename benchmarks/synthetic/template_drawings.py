"""Drawings of the template shapes; `python -m benchmarks.synthetic.template_drawings` writes the data file.

Polygons are drawn on a free grid with y up, as on paper. `drawn_templates` brings them to the stored form: y down as in
an image, longer side of the bounding box 1 m, area centroid at the origin, outer rings counter-clockwise in (x, y),
holes clockwise.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Rings = list[NDArray[np.float64]]
Grid = tuple[tuple[float, float], ...]

BLOB_VERTICES = 40

# fmt: off
# name: (rings on the drawing grid, outer ring first)
ASYMMETRIC_POLYGONS: dict[str, tuple[Grid, ...]] = {
    "letter_f": (((0, 0), (2, 0), (2, 4), (5, 4), (5, 6), (2, 6), (2, 8), (6, 8), (6, 10), (0, 10)),),
    "letter_g": (
        ((9, 10), (2, 10), (0, 8), (0, 2), (2, 0), (7, 0), (9, 2), (9, 5), (5, 5), (5, 3.5), (7, 3.5), (7, 2.5),
         (6.3, 1.8), (2.7, 1.8), (2, 2.5), (2, 7.5), (2.7, 8.2), (9, 8.2)),
    ),
    "letter_l": (((0, 0), (6, 0), (6, 3), (2, 3), (2, 10), (0, 10)),),
    "letter_r": (
        ((0, 0), (2, 0), (2, 4), (3, 4), (5.5, 0), (8, 0), (5.2, 4.4), (7, 6), (7, 8.5), (5.5, 10), (0, 10)),
        ((2, 5.5), (2, 8.5), (4.7, 8.5), (5.2, 8), (5.2, 6.3), (4.5, 5.5)),
    ),
    "hook": (
        ((3.5, 10), (3.5, 3), (3, 2), (2, 2), (1.5, 3), (1.5, 4), (0, 4), (0, 2.4), (1.6, 0.4), (3.6, 0.4), (5, 2.4),
         (5, 8.8), (6.5, 8.8), (6.5, 10)),
    ),
    "key": (
        ((0, 2), (1, 0.4), (3, 0), (4.6, 1), (5, 2.2), (13, 2.2), (13, 0), (14, 0), (14, 2.2), (15, 2.2), (15, 0.7),
         (16, 0.7), (16, 3.4), (5, 3.4), (4.4, 4.8), (2.8, 5.6), (0.8, 4.6)),
    ),
    "bolt": (((3, 0), (7, 5.5), (4.8, 6), (8, 10), (2.5, 7), (4.2, 6.2), (0, 4), (3.6, 4.4)),),
    "stairs": (((0, 0), (10, 0), (10, 1.5), (7.5, 1.5), (7.5, 3), (6, 3), (6, 5.5), (2.5, 5.5), (2.5, 7), (0, 7)),),
    "shard": (((0, 1.5), (4, 0), (10, 3), (7, 4.2), (6.2, 8), (2.2, 6)),),
    "house": (
        ((0, 0), (8, 0), (8, 5), (9, 5), (4.5, 9), (2.8, 7.5), (2.8, 9.2), (1.4, 9.2), (1.4, 6.2), (-1, 5), (0, 5)),
    ),
    "bent_arrow": (((0, 0), (1.6, 0), (1.6, 5), (6, 5), (6, 3), (10, 6), (6, 9), (6, 7), (0, 7)),),
    "uneven_window": (
        ((0, 0), (8, 0), (8, 10), (0, 10)),
        ((1, 1), (1, 6), (4.5, 6), (4.5, 1)),
        ((5.5, 3), (5.5, 9), (7, 9), (7, 3)),
    ),
}

# name: (rotation order, mirror symmetric, rings on the drawing grid)
SYMMETRIC_POLYGONS: dict[str, tuple[int, bool, tuple[Grid, ...]]] = {
    "rectangle": (2, True, (((0, 0), (10, 0), (10, 6), (0, 6)),)),
    "square": (4, True, (((0, 0), (10, 0), (10, 10), (0, 10)),)),
    "thin_cross": (
        4, True,
        (((4.5, 0), (5.5, 0), (5.5, 4.5), (10, 4.5), (10, 5.5), (5.5, 5.5), (5.5, 10), (4.5, 10), (4.5, 5.5), (0, 5.5),
          (0, 4.5), (4.5, 4.5)),),
    ),
    "arrow": (1, True, (((0, 3), (6, 3), (6, 0), (11, 4.5), (6, 9), (6, 6), (0, 6)),)),
    "letter_z": (
        2, False,
        (((0, 0), (8, 0), (8, 2), (3, 2), (8, 8), (8, 10), (0, 10), (0, 8), (5, 8), (0, 2)),),
    ),
}

# fmt: on

# name: relative amplitude and phase (rad) of the harmonics 1, 2, 3, ... of the radius
BLOBS: dict[str, tuple[tuple[float, float], ...]] = {
    "bean_blob": ((0.10, 0.4), (0.22, 1.1), (0.12, 2.9), (0.03, 0.2)),
    "cloud_blob": ((0.05, 2.0), (0.08, 0.3), (0.13, 1.7), (0.10, 2.6), (0.07, 0.9)),
    "drop_blob": ((0.25, 0.2), (0.14, 1.9), (0.13, 0.1), (0.05, 2.2)),
}


def polar_ring(radius: Callable[[NDArray[np.float64]], NDArray[np.float64]], count: int) -> NDArray[np.float64]:
    """(count, 2) counter-clockwise ring of the curve `radius(angle)`, sampled at even angles from 0."""
    angles = 2.0 * np.pi * np.arange(count) / count
    ring: NDArray[np.float64] = radius(angles)[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    return ring


def blob_ring(harmonics: tuple[tuple[float, float], ...]) -> NDArray[np.float64]:
    """(40, 2) ring of the smooth curve `1 + sum a_k cos(k angle + phase_k)`."""

    def radius(angle: NDArray[np.float64]) -> NDArray[np.float64]:
        waves = [amplitude * np.cos(k * angle + phase) for k, (amplitude, phase) in enumerate(harmonics, start=1)]
        return np.asarray(1.0 + np.sum(waves, axis=0), dtype=np.float64)

    return polar_ring(radius, BLOB_VERTICES)


def regular_ring(sides: int, size: float = 1.0) -> NDArray[np.float64]:
    """(sides, 2) regular polygon with circumradius `size`."""
    return polar_ring(lambda angle: np.full_like(angle, size), sides)


def star_ring(points: int, inner: float) -> NDArray[np.float64]:
    """(2 points, 2) star with circumradius 1 and inner radius `inner`."""
    return polar_ring(lambda angle: np.where(np.arange(len(angle)) % 2 == 0, 1.0, inner), 2 * points)


def gear_ring(teeth: int, root: float) -> NDArray[np.float64]:
    """(4 teeth, 2) toothed wheel: tip radius 1, root radius `root`, flanks along even angles."""
    return polar_ring(lambda angle: np.where(np.arange(len(angle)) % 4 < 2, 1.0, root), 4 * teeth)


def round_drawings() -> dict[str, tuple[int, bool, Rings]]:
    """Name -> (rotation order, mirror symmetric, rings) of the shapes with a rotation center drawn by formula."""
    return {
        "triangle": (3, True, [regular_ring(3)]),
        "hexagon": (6, True, [regular_ring(6)]),
        "star": (5, True, [star_ring(5, 0.45)]),
        "gear": (8, True, [gear_ring(8, 0.75)]),
        "nut": (6, True, [regular_ring(6), regular_ring(24, 0.5)]),
    }


def signed_area(ring: NDArray[np.float64]) -> float:
    """Signed area of an (n, 2) ring, positive when counter-clockwise in (x, y)."""
    x, y = ring.T
    return float(0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


def ring_centroid(ring: NDArray[np.float64]) -> NDArray[np.float64]:
    """(2,) area centroid of one simple (n, 2) ring."""
    start, end = ring, np.roll(ring, -1, axis=0)
    cross = start[:, 0] * end[:, 1] - start[:, 1] * end[:, 0]
    centroid: NDArray[np.float64] = ((start + end) * cross[:, None]).sum(axis=0) / (3.0 * cross.sum())
    return centroid


def stored_form(rings: Rings) -> Rings:
    """Rings with y down, the outer one first and counter-clockwise, longer side 1 m, centroid at the origin."""
    flipped = [np.asarray(ring, dtype=np.float64) * (1.0, -1.0) for ring in rings]
    scale = 1.0 / float(np.ptp(flipped[0], axis=0).max())
    turned = [ring if (signed_area(ring) > 0.0) == (i == 0) else ring[::-1] for i, ring in enumerate(flipped)]
    scaled = [ring * scale for ring in turned]
    areas = np.array([signed_area(ring) for ring in scaled])
    center = areas @ np.array([ring_centroid(ring) for ring in scaled]) / areas.sum()
    return [ring - center for ring in scaled]


def template_record(name: str, symmetry_order: int, mirror: bool, rings: Rings) -> dict[str, Any]:
    """JSON record of one template."""
    return {
        "name": name,
        "symmetry_order": symmetry_order,
        "mirror": mirror,
        "rings": [ring.tolist() for ring in stored_form(rings)],
    }


def drawn_templates() -> list[dict[str, Any]]:
    """Records of all 25 templates, as the data file holds them."""
    records = [
        template_record(name, 1, False, [np.array(ring, dtype=np.float64) for ring in rings])
        for name, rings in ASYMMETRIC_POLYGONS.items()
    ]
    records += [template_record(name, 1, False, [blob_ring(harmonics)]) for name, harmonics in BLOBS.items()]
    for name, (order, mirror, grids) in SYMMETRIC_POLYGONS.items():
        records.append(template_record(name, order, mirror, [np.array(grid, dtype=np.float64) for grid in grids]))
    records += [template_record(name, *drawing) for name, drawing in round_drawings().items()]
    return records


def main() -> None:
    """Rewrite `templates.json` beside this file, one template a line."""
    lines = ",\n".join(json.dumps(record) for record in drawn_templates())
    Path(__file__).with_name("templates.json").write_text(f"[\n{lines}\n]\n", encoding="utf-8")


if __name__ == "__main__":
    main()
