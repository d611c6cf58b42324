"""What arguments have to be. One function for each kind of thing; the messages name the thing, its value and the remedy."""

from __future__ import annotations

import os
from collections.abc import Iterable
from math import inf, isfinite
from pathlib import Path
from typing import Any, TypeAlias, TypeGuard, TypeVar

import numpy as np
from ngsolve import CoefficientFunction

from ngswell.errors import InputError

Field: TypeAlias = float | CoefficientFunction
"""A parameter: one number, or a CoefficientFunction of position in the reference configuration."""

Thing = TypeVar("Thing")

LONGEST = 80
"""Characters of a value in a message."""


def short(value: object) -> str:
    """A value on one line of a message, cut where it is long."""
    try:
        text = " ".join(repr(value).split())
    except ValueError:  # Python writes no integers of thousands of digits
        text = f"a huge {type(value).__name__}"
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 2]} …"


def is_number(value: object) -> TypeGuard[float]:
    """Whether a parameter is one real number, Python's or numpy's, and no truth value."""
    return isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)


def number(what: str, value: object, unit: str = "", low: float = -inf, high: float = inf, hint: str = "") -> float:
    """`value` as a float: one finite number within `low` … `high`, the ends included."""
    unit = f" {unit}" if unit else ""
    if not is_number(value):
        raise InputError(f"{what} has to be a number{f' [{unit[1:]}]' if unit else ''}, got {short(value)}")
    result = as_float(value)
    if not isfinite(result):
        raise InputError(f"{what} = {short(value)}{unit} is not finite{hint and f': {hint}'}")
    if not low <= result <= high:
        raise InputError(f"{what} = {result:.6g}{unit} is outside {low:g} … {high:g}{hint and f': {hint}'}")
    return result


def as_float(value: float) -> float:
    """A number as a float; integers beyond all floats become infinite."""
    try:
        return float(value)
    except OverflowError:
        return inf


def positive(what: str, value: object, unit: str = "") -> float:
    """`value` as a float: one number above zero, and finite."""
    if not (is_number(value) and 0 < (result := as_float(value)) < inf):
        raise InputError(f"{what} has to be positive and finite, got {short(value)} {unit}".rstrip())
    return result


def integer(what: str, value: object, low: int, high: int) -> int:
    """`value` as an int from `low` to `high`."""
    if not (isinstance(value, (int, np.integer)) and not isinstance(value, bool) and low <= value <= high):
        raise InputError(f"{what} {short(value)} is not a whole number from {low} to {high}")
    return int(value)


def flag(what: str, value: object) -> None:
    """Refuse what is neither True nor False."""
    if not isinstance(value, (bool, np.bool_)):
        raise InputError(f"{what} has to be True or False, got {short(value)}")


def vector(what: str, values: Any, limit: float, unit: str = "") -> tuple[float, ...]:
    """`values` as a tuple of finite numbers within ±`limit`."""
    unit = f" {unit}" if unit else ""
    components = as_tuple(values)
    if components is None:
        raise InputError(f"{what} has to be some numbers, such as (0.0, 1.0){unit}, got {short(values)}")
    for value in components:
        if not (is_number(value) and abs(as_float(value)) <= limit):
            raise InputError(
                f"{what} has a component {short(value)}{unit}: it has to be a number, finite and within ±{limit:g}"
            )
    return tuple(map(as_float, components))


def as_tuple(values: Any) -> tuple | None:
    """What a list, tuple, array or generator holds; None for anything else."""
    if isinstance(values, (str, bytes, dict)) or not isinstance(values, Iterable):
        return None
    try:
        return tuple(values)
    except TypeError:  # an array without dimensions
        return None


def scalar(what: str, field: CoefficientFunction) -> None:
    """Refuse fields of vectors and of complex numbers."""
    if field.dim != 1 or field.is_complex:
        kind = "complex values" if field.is_complex else f"{field.dim} components"
        raise InputError(f"{what} has to be scalar and real, got a CoefficientFunction of {kind}")


def name(what: str, value: object, example: str) -> None:
    """Refuse what is no string or an empty one."""
    if not (isinstance(value, str) and value):
        raise InputError(f"{what} has to be a name, such as {example!r}, got {short(value)}")


def path(what: str, value: object, example: str) -> Path:
    """`value` as a path; refuse what is none, or has no last part."""
    if not isinstance(value, (str, os.PathLike)) or not Path(value).name:
        raise InputError(f"{what}: path has to be a file's, such as {example!r}, got {short(value)}")
    return Path(value)


def choice(what: str, value: object, choices: Iterable[str]) -> None:
    """Refuse what is none of the words `choices`."""
    words = tuple(choices)
    if not (isinstance(value, str) and value in words):
        raise InputError(f"{what} {short(value)} is none of {', '.join(map(repr, words))}")


def is_a(value: object, kind: Any) -> bool:
    """Whether `value` is an instance of a class or protocol; a class itself, left uncalled, is none."""
    return not isinstance(value, type) and isinstance(value, kind)


def instance(what: str, value: object, kind: Any, choices: str) -> None:
    """Refuse what is not an instance of `kind`; `choices` says what is."""
    if not is_a(value, kind):
        given = f"the class {value.__name__}" if isinstance(value, type) else short(value)
        raise InputError(f"{what} has to be {choices}, got {given}")


def several(what: str, values: Any, kind: Any, choices: str) -> tuple:
    """`values` as a tuple of instances of `kind`."""
    if is_a(values, kind):
        raise InputError(f"{what} has to be a list, got one {type(values).__name__}: put it in brackets, [{short(values)}]")
    found = as_tuple(values)
    if found is None:
        raise InputError(f"{what} has to be a list of {choices}, got {short(values)}")
    for value in found:
        instance(f"an entry of {what}", value, kind, choices)
    return found


def set_fields(thing: object, **values: object) -> None:
    """Give fields of a frozen dataclass the form in which it uses them."""
    for field, value in values.items():
        object.__setattr__(thing, field, value)
