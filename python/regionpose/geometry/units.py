"""Lengths and angles as text, in a unit that fits and with significant digits only."""

from __future__ import annotations

import math

UNKNOWN = "unknown"
"""Text in place of a number that is missing or not finite."""

LENGTHS = ((0.1, 1000.0, "mm"), (1.0, 100.0, "cm"))
"""Lengths below which, in meters, a unit is taken, and how many of it are a meter; meters beyond. A convention."""

LEAST_M, LEAST_DEG = 1e-6, 1e-4
"""Smallest values that are written out; smaller ones are below what can be measured."""


def length_text(meters: float | None) -> str:
    """A length to two digits: 3.2 mm, 17 cm, 1.7 m; whole meters from 10 on."""
    if meters is None or not math.isfinite(meters):
        return UNKNOWN
    if abs(meters) < LEAST_M:
        return "0 mm" if meters == 0.0 else "under 0.001 mm"
    rounded = float(f"{meters:.2g}")
    factor, unit = next(((by, unit) for most, by, unit in LENGTHS if abs(rounded) < most), (1.0, "m"))
    return f"{_two_digits(factor * meters)} {unit}"


def angle_text(degrees: float | None, unit: str = " deg") -> str:
    """An angle to two digits: 0.032 deg, 3.2 deg; whole degrees from 10 on."""
    if degrees is None or not math.isfinite(degrees):
        return UNKNOWN
    if 0.0 < abs(degrees) < LEAST_DEG:
        return f"under {LEAST_DEG:.4f}{unit}"
    return f"{_two_digits(degrees)}{unit}"


def _two_digits(value: float) -> str:
    """A number to two digits, never with an exponent, and whole from 10 on."""
    if value == 0.0:
        return "0"
    first = math.floor(math.log10(abs(float(f"{value:.2g}"))))
    return f"{value:.{max(0, 1 - first)}f}"
