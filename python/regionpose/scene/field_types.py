"""What items of a scene file are made of: numbers, points, names of keys, and choices between kinds of values."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Discriminator, Field, model_validator
from pydantic_core import PydanticCustomError

from regionpose.scene.document import described


def _numbers(count: int, needed: str) -> Callable[[object], object]:
    """A check that a value is a list of `count` finite numbers."""

    def check(value: object) -> object:
        if not isinstance(value, list):
            raise PydanticCustomError(
                "numbers", "found {found}; needed {needed}", {"found": described(value), "needed": needed}
            )
        odd = next((item for item in value if not _is_number(item)), None)
        if odd is not None or len(value) != count:
            found = described(odd) if odd is not None else f"{len(value)} numbers"
            raise PydanticCustomError("numbers", "found {found}; needed {needed}", {"found": found, "needed": needed})
        return value

    return check


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= sys.float_info.max


Number = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
FileName = Annotated[str, Field(min_length=1, description="a path, relative to the scene file")]
Pixel = Annotated[
    list[Number],
    BeforeValidator(_numbers(2, "[x, y]")),
    Field(min_length=2, max_length=2, description="[x, y], pixels"),
]
Point = Annotated[
    list[Number],
    BeforeValidator(_numbers(3, "[x, y, z]")),
    Field(min_length=3, max_length=3, description="[x, y, z], meters, world frame"),
]
Quaternion = Annotated[
    list[Number],
    BeforeValidator(_numbers(4, "[x, y, z, w]")),
    Field(min_length=4, max_length=4, description="[x, y, z, w]"),
]
Row = Annotated[list[Number], BeforeValidator(_numbers(4, "4 numbers")), Field(min_length=4, max_length=4)]
Coefficients4 = Annotated[list[Number], BeforeValidator(_numbers(4, "4 numbers")), Field(min_length=4, max_length=4)]
Pair = Annotated[list[Number], BeforeValidator(_numbers(2, "2 numbers")), Field(min_length=2, max_length=2)]


HIDDEN = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069]")
"""Control characters, breaks of lines, and turns of the direction of writing."""

LONGEST_NAME = 200
"""Characters of a region's name: what a line and a table hold."""


class Item(BaseModel):
    """A mapping of the scene file: unknown keys are errors, and nothing is converted."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    @model_validator(mode="before")
    @classmethod
    def _check_keys(cls, value: Any) -> Any:
        if not isinstance(value, dict):
            return value
        for key in value:
            if key not in cls.model_fields:
                known = ", ".join(cls.model_fields)
                raise PydanticCustomError(
                    "unknown_key", "found an unknown key; needed one of {known}", {"known": known, "key": str(key)}
                )
        return value


def key_among(*keys: str) -> Callable[[object], str | None]:
    """The tag of the first of `keys` that a mapping holds."""

    def kind(value: object) -> str | None:
        if not isinstance(value, dict):
            return None
        return next((f"<{key}>" for key in keys if key in value), None)

    return kind


def choice(kind: Callable[[Any], str | None], needed: str) -> Discriminator:
    """A choice between kinds of values by the tag that `kind` gives a value, and what is needed where it gives none."""
    return Discriminator(kind, custom_error_type="choice", custom_error_message=needed)


def _visible(name: str) -> str:
    """A check that a name has no characters that break lines or turn the direction of what follows."""
    hidden = HIDDEN.search(name)
    if hidden is not None:
        message = "found the character U+{code}; needed a name without control characters"
        raise PydanticCustomError("numbers", message, {"code": f"{ord(hidden.group()):04X}"})
    return name


Name = Annotated[str, Field(min_length=1, max_length=LONGEST_NAME), AfterValidator(_visible)]
