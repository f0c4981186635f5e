"""The crate's constants are known by kind; those of the model are few, and explained in `docs/math.md`, section 21."""

from __future__ import annotations

from tools.crate_constants import KINDS, constants, kinds, table

MOST = 60
"""Numbers that answers depend on."""


def test_every_constant_has_a_kind() -> None:
    assert constants().keys() == kinds().keys()
    assert set(kinds().values()) <= KINDS.keys()


def test_the_numbers_of_the_model_are_few_and_in_the_document() -> None:
    model = {name for name, kind in kinds().items() if kind == "model"}
    assert len(model) <= MOST
    assert table() == {name: constants()[name] for name in model}
