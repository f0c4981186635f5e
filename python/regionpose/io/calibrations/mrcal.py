"""mrcal's .cameramodel, which is written as a literal of Python."""

from __future__ import annotations

import ast
import re
from collections.abc import Sequence
from functools import partial

from regionpose.cameras import Camera, PinholeCamera
from regionpose.io.calibrations.text import CalibrationText

LENS = re.compile(r"['\"]lensmodel['\"]\s*:")
PREFIX = "LENSMODEL_"
COUNTS = {"PINHOLE": 0, "OPENCV4": 4, "OPENCV5": 5, "OPENCV8": 8, "OPENCV12": 12}
"""Coefficients after fx, fy, cx, cy, by model; others have no counterpart here."""


def describes(source: CalibrationText) -> bool:
    """Whether a lens model is named as mrcal does."""
    return LENS.search(source.text) is not None and PREFIX in source.text


def read_camera(source: CalibrationText, name: str | None) -> Camera:
    """The camera of the file, called `camera`."""
    return source.camera({"camera": partial(_camera, source)}, name)


def _camera(source: CalibrationText) -> Camera:
    literal = _literal(source)
    model = str(literal.get("lensmodel"))
    count = COUNTS.get(model.removeprefix(PREFIX))
    if count is None:
        supported = ", ".join(PREFIX + one for one in COUNTS)
        raise source.error("lensmodel", model, f"one of {supported} (mrcal-convert-lensmodel makes one)")
    fx, fy, cx, cy, *coefficients = _numbers(source, literal, "intrinsics", 4 + count)
    width, height = _numbers(source, literal, "imagersize", 2)
    return PinholeCamera(fx, fy, cx, cy, distortion=tuple(coefficients), width=int(width), height=int(height))


def _literal(source: CalibrationText) -> dict[object, object]:
    """The mapping of the file, of plain values; `np.float64(1.5)` and the like are their one argument."""
    try:
        value = _value(source, ast.parse(source.text.strip(), mode="eval").body)
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        if isinstance(error, SyntaxError):
            raise source.error("cameramodel", "what is no literal of Python", "one", error.lineno) from error
        raise source.error("cameramodel", str(error) or "brackets nested too deep", "a literal of Python") from error
    if not isinstance(value, dict):
        raise source.error("cameramodel", "no mapping", "{'lensmodel': ..., 'intrinsics': ..., 'imagersize': ...}")
    return value


def _value(source: CalibrationText, node: ast.expr) -> object:
    match node:
        case ast.Constant(value=value):
            return value
        case ast.UnaryOp(op=ast.USub(), operand=ast.Constant(value=int() | float() as value)):
            return -value
        case ast.List(elts=items) | ast.Tuple(elts=items):
            return [_value(source, item) for item in items]
        case ast.Dict(keys=keys, values=values) if None not in keys:
            return {
                str(_value(source, key)): _value(source, item) for key, item in zip(keys, values, strict=True) if key
            }
        case ast.Call(args=[argument], keywords=[]):
            return _value(source, argument)
    raise source.error("cameramodel", type(node).__name__, "numbers, texts, lists and mappings", node.lineno)


def _numbers(source: CalibrationText, literal: dict[object, object], key: str, count: int) -> list[float]:
    values = literal.get(key)
    if not isinstance(values, Sequence) or isinstance(values, str):
        raise source.error(key, repr(values), f"a list of {count} numbers")
    return source.numbers(key, [str(value) for value in values], count, None)
