"""calibrated_camera_parameters.txt of Pix4D: a camera for each photo."""

from __future__ import annotations

from functools import partial

import numpy as np

from regionpose.cameras import Camera, PinholeCamera
from regionpose.io.calibrations.text import CalibrationText

HEADER = "fileName imageWidth imageHeight"
ROWS = {"camera matrix K": 3, "radial distortion": 1, "tangential distortion": 1, "camera position t": 1}
ROWS |= {"camera rotation R": 3, "camera model m": 1}
"""Lines of each part of a photo's block, by how the header calls it."""

Block = tuple[int, list[str]]


def describes(source: CalibrationText) -> bool:
    """Whether the header names the contents of the blocks."""
    return source.text.lstrip().startswith(HEADER)


def read_camera(source: CalibrationText, name: str | None) -> Camera:
    """The camera of the photo called `name`."""
    parts, blocks = _blocks(source)
    return source.camera({key: partial(_camera, source, parts, block) for key, block in blocks.items()}, name)


def _blocks(source: CalibrationText) -> tuple[list[str], dict[str, Block]]:
    """The parts of each block after its first line, and the blocks: line (from 1) and lines of each photo."""
    lines = [(number, text.strip()) for number, text in enumerate(source.lines, start=1)]
    lines = [(number, text) for number, text in lines if text]
    parts, at = [], 1
    while at < len(lines):
        part = next((part for part in ROWS if lines[at][1].startswith(part)), None)
        if part is None:
            break
        parts.append(part)
        at += 1
    for needed in ("camera matrix K", "radial distortion", "tangential distortion"):
        if needed not in parts:
            raise source.error("header", "no " + needed, "the header that Pix4D writes", 1)
    count = 1 + sum(ROWS[part] for part in parts)
    blocks: dict[str, Block] = {}
    for start in range(at, len(lines), count):
        block = lines[start : start + count]
        if len(block) < count:
            raise source.error("last photo", f"{len(block)} lines", f"{count} lines", block[0][0])
        blocks[" ".join(block[0][1].split()[:-2])] = (block[0][0], [text for _, text in block])
    if not blocks:
        raise source.error("photos", "none", "one or more", 1)
    return parts, blocks


def _camera(source: CalibrationText, parts: list[str], block: Block) -> Camera:
    line, rows = block
    width, height = (source.whole_number("size", word, line) for word in rows[0].split()[-2:])
    sections, at = {}, 1
    for part in parts:
        words = " ".join(rows[at : at + ROWS[part]]).split()
        sections[part] = (line + at, words)
        at += ROWS[part]

    def numbers(part: str, count: int) -> list[float]:
        return source.numbers(part, sections[part][1], count, sections[part][0])

    k1, k2, k3 = numbers("radial distortion", 3)
    p1, p2 = numbers("tangential distortion", 2)
    matrix = np.reshape(numbers("camera matrix K", 9), (3, 3))
    return PinholeCamera.from_matrix(matrix, distortion=(k1, k2, p1, p2, k3), width=width, height=height)
