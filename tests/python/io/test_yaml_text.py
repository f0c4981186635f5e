"""YAML as the package writes and reads it."""

from __future__ import annotations

import math
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
from regionpose.io.yaml_text import plain_value, to_yaml, yaml_node

NUMBERS = st.integers(-(10**9), 10**9) | st.floats(allow_nan=False)
VALUES = st.recursive(
    st.booleans() | NUMBERS | st.text(st.characters(codec="utf-8", categories=["L", "N", "P", "S", "Zs"]), max_size=20),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text("abc_", min_size=1, max_size=6), inner),
    max_leaves=12,
)


@given(VALUES)
def test_what_is_written_is_read_back(value: Any) -> None:
    again = plain_value(yaml_node(to_yaml({"value": value})))
    assert again == {"value": value}


def test_one_list_in_two_places_is_written_twice() -> None:
    origin = [0.0, math.pi, -1e-300]
    assert plain_value(yaml_node(to_yaml({"a": origin, "b": [origin]}))) == {"a": origin, "b": [origin]}
