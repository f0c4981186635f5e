"""Reading meshes, OBJ, STL and GLB, through trimesh (extra `mesh`)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from regionpose.io.clouds.cloud import Cloud, Scalars
from regionpose.io.clouds.errors import CloudError, cloud_error
from regionpose.io.json_text import json_value
from regionpose.io.reading import unfolding_error
from regionpose.validation.arrays import Array
from regionpose.validation.extras import load_extra

ELEMENT_BYTES = 12
"""Bytes of a vertex or a triangle, the elements that a mesh holds most of."""


def read_mesh(path: Path, kind: str) -> Cloud:
    """The vertices and triangles of a mesh of the format `kind`, with the colors of its vertices where all have one.

    The parts of a scene are placed by their transforms and joined; coinciding corners of an STL become one vertex.
    """
    trimesh = load_extra("trimesh", "mesh", f"{path}: {kind.upper()}")
    if kind == "glb":
        _check_accessors(path)
    options = {"skip_materials": True} if kind == "obj" else {}
    try:
        with path.open("rb") as file:
            scene = trimesh.load(file, file_type=kind, process=False, **options)
        parts = _parts(trimesh, scene, merge=kind == "stl")
    # Damage shows as errors of every type.
    except Exception as error:
        raise cloud_error(path, "mesh", f"{type(error).__name__}: {error}", f"a whole {kind.upper()} file") from error
    if not sum(len(vertices) for vertices, _, _ in parts):
        raise cloud_error(path, "vertices", "none", "at least 1")
    starts = np.cumsum([0] + [len(vertices) for vertices, _, _ in parts])
    colors = [shades for _, _, shades in parts]
    return Cloud.from_points(
        np.concatenate([vertices for vertices, _, _ in parts]),
        colors=None if any(shades is None for shades in colors) else np.concatenate(colors),
        triangles=np.concatenate([faces + start for (_, faces, _), start in zip(parts, starts, strict=False)]),
        source=path,
    )


def _check_accessors(path: Path) -> None:
    """CloudError where the arrays of a GLB file are larger than it makes likely: those without data are zeros.

    What else is wrong with the file is for its reader to find.
    """
    content = path.read_bytes()
    length = int.from_bytes(content[12:16], "little")
    try:
        header = json_value(content[20 : 20 + length].decode("utf-8"))
        counts = [int(accessor["count"]) for accessor in header.get("accessors", [])]
    except (ValueError, TypeError, KeyError, AttributeError, OverflowError):
        return
    wrong = unfolding_error(path, ELEMENT_BYTES * sum(count for count in counts if count > 0))
    if wrong is not None:
        raise CloudError(f"{path}: accessors: {wrong}")


def _parts(trimesh: Any, scene: Any, merge: bool) -> list[tuple[Array, Scalars, Scalars]]:
    """Vertices, triangles and colors (or None) of every part, in the frame of the whole."""
    if not isinstance(scene, trimesh.Scene):
        return [_part(scene, np.eye(4), merge)]
    placed = (scene.graph[node] for node in scene.graph.nodes_geometry)
    return [_part(scene.geometry[name], transform, merge) for transform, name in placed]


def _part(geometry: Any, transform: Array, merge: bool) -> tuple[Array, Scalars, Any]:
    """Vertices, triangles and colors (or None) of one part."""
    vertices = np.array(geometry.vertices, dtype=np.float64)
    faces = np.array(getattr(geometry, "faces", np.empty((0, 3))), dtype=np.int64)
    colors = _colors(geometry)
    if merge:
        vertices, numbers = np.unique(vertices, axis=0, return_inverse=True)
        faces, colors = numbers.reshape(-1)[faces], None
    return vertices @ transform[:3, :3].T + transform[:3, 3], faces, colors


def _colors(geometry: Any) -> Scalars | None:
    """The colors (n, 3) of the vertices; None where the file gives none."""
    visual = getattr(geometry, "visual", None)
    if visual is None:
        colors = getattr(geometry, "colors", None)
        return None if colors is None or not len(colors) else np.asarray(colors)[:, :3]
    return np.asarray(visual.vertex_colors)[:, :3] if visual.kind == "vertex" else None
