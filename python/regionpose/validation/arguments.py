"""Arguments of public functions, compared with the package's own classes that their hints name."""

from __future__ import annotations

import sys
import typing
from collections.abc import Callable, Iterable, Sequence
from functools import cache, wraps
from inspect import signature
from types import NoneType, SimpleNamespace, UnionType
from typing import Any, NamedTuple, ParamSpec, TypeVar

Given = ParamSpec("Given")
Returned = TypeVar("Returned")

PACKAGE = __name__.partition(".")[0]


class Parameter(NamedTuple):
    """A parameter's type by its hint: a class of the package, or a list of its objects; or None as well."""

    position: int
    name: str
    kind: type
    is_list: bool
    or_none: bool


def checked_arguments(function: Callable[Given, Returned]) -> Callable[Given, Returned]:
    """The function, with a ValueError for arguments that are not of the package's classes that their hints name.

    It names the parameter, what was found and what is needed. Hints that also allow other classes are left alone.
    """

    @wraps(function)
    def checked(*given: Given.args, **named: Given.kwargs) -> Returned:
        for parameter in _parameters(function):
            if parameter.position < len(given):
                _check(parameter, given[parameter.position])
            elif parameter.name in named:
                _check(parameter, named[parameter.name])
        return function(*given, **named)

    return checked


def check_fields(instance: object) -> None:
    """Check that an object's fields are of the package's classes that their hints name; ValueError as of arguments."""
    made: Callable[..., object] = type(instance)
    for parameter in _parameters(made):
        _check(parameter, getattr(instance, parameter.name))


def _check(parameter: Parameter, value: object) -> None:
    if value is None and parameter.or_none:
        return
    if not parameter.is_list:
        if not isinstance(value, parameter.kind):
            needed = f"a {parameter.kind.__name__}" + " or None" * parameter.or_none
            raise ValueError(f"{parameter.name} is a {type(value).__name__}; needed {needed}")
        return
    for index, item in enumerate(_items(parameter, value)):
        if not isinstance(item, parameter.kind):
            found = f"{parameter.name}[{index}] is a {type(item).__name__}"
            raise ValueError(f"{found}; needed a {parameter.kind.__name__}")


def _items(parameter: Parameter, value: Any) -> Iterable[object]:
    """What a list holds; nothing of an iterator, whose items would be gone."""
    try:
        return () if iter(value) is value else value
    except TypeError as error:
        needed = f"a list of {parameter.kind.__name__}s" + " or None" * parameter.or_none
        raise ValueError(f"{parameter.name} is a {type(value).__name__}; needed {needed}") from error


@cache
def _parameters(function: Callable[..., object]) -> tuple[Parameter, ...]:
    found = []
    for position, name in enumerate(signature(function).parameters):
        hint = _hint(function, name)
        alternatives = typing.get_args(hint) if isinstance(hint, UnionType) else (hint,)
        kinds = [each for each in alternatives if each is not NoneType]
        if len(kinds) != 1:
            continue
        is_list = typing.get_origin(kinds[0]) is Sequence
        kind = typing.get_args(kinds[0])[0] if is_list else kinds[0]
        if _is_own(kind):
            found.append(Parameter(position, name, kind, is_list, NoneType in alternatives))
    return tuple(found)


def _hint(function: Callable[..., object], name: str) -> Any:
    """The hint of a parameter or field; None where it has none, or one that only type checkers know."""
    instance = SimpleNamespace(__annotations__={name: function.__annotations__.get(name)})
    try:
        return typing.get_type_hints(instance, globalns=vars(sys.modules[function.__module__]))[name]
    except NameError:
        return None


def _is_own(kind: object) -> bool:
    own = isinstance(kind, type) and kind.__module__.partition(".")[0] == PACKAGE
    return own and not getattr(kind, "_is_protocol", False)
