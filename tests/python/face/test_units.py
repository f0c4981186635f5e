"""Lengths and angles as people read them."""

from __future__ import annotations

import math
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st
from regionpose.geometry.units import angle_text, length_text

METERS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0}


@pytest.mark.parametrize(
    ("meters", "said"),
    [
        (0.17, "17 cm"),
        (0.0996, "10 cm"),
        (0.0994, "99 mm"),
        (0.0032, "3.2 mm"),
        (0.000041, "0.041 mm"),
        (0.998, "1.0 m"),
        (1.74, "1.7 m"),
        (123.4, "123 m"),
        (-0.5, "-50 cm"),
        (0.0, "0 mm"),
        (1e-9, "under 0.001 mm"),
        (math.inf, "unknown"),
        (None, "unknown"),
    ],
)
def test_lengths(meters: float | None, said: str) -> None:
    assert length_text(meters) == said


@pytest.mark.parametrize(
    ("degrees", "said"),
    [(0.583, "0.58 deg"), (0.0321, "0.032 deg"), (9.96, "10 deg"), (123.4, "123 deg"), (1e-6, "under 0.0001 deg")],
)
def test_angles(degrees: float, said: str) -> None:
    assert angle_text(degrees) == said
    assert angle_text(degrees, "°") == said.replace(" deg", "°")


@given(st.floats(1e-6, 1e5))
def test_what_is_read_is_within_five_percent(meters: float) -> None:
    found = re.fullmatch(r"([0-9.]+) (mm|cm|m)", length_text(meters))
    assert found is not None and len(found[1].replace(".", "").strip("0")) <= 6
    assert float(found[1]) * METERS[found[2]] == pytest.approx(meters, rel=0.051)
