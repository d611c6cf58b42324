"""Calls from outside: wrong arguments, refused like every other bad input, and warnings that name the caller's line."""

from __future__ import annotations

import inspect
import sys
import warnings
from collections.abc import Callable
from difflib import get_close_matches
from functools import wraps
from threading import RLock
from typing import Any, TypeVar

from ngswell.errors import InputError
from ngswell.team import Team, speaks

Thing = TypeVar("Thing")

Function = TypeVar("Function", bound=Callable[..., Any])

_PACKAGE = __name__.partition(".")[0]


def warn(warning: Warning, team: Team | None = None) -> None:
    """Warn at the line outside the package from which it was called; of a `team` the first rank does, for all.

    Without one, that is the first of all that compute together in this process.
    """
    if not (speaks() if team is None else team.rank == 0):
        return
    frame, level = sys._getframe(1), 2
    # By module, not by file: the constructor of a dataclass has none.
    while frame.f_back is not None and frame.f_globals.get("__name__", "").partition(".")[0] == _PACKAGE:
        frame, level = frame.f_back, level + 1
    warnings.warn(warning, stacklevel=level)


_TURN = RLock()


def in_turn(function: Function) -> Function:
    """A function that computes in one thread at a time, as NGSolve's calls share memory and settings within a process."""

    @wraps(function)
    def call(*arguments: Any, **named: Any) -> Any:
        with _TURN:
            return function(*arguments, **named)

    return call  # type: ignore[return-value]


def refusing(thing: Thing) -> Thing:
    """A public function, or a class with its constructor and public methods, that refuses calls which do not fit it.

    Raises InputError where Python's own error would not say what the call takes.
    """
    if not inspect.isclass(thing):
        return _refusing(thing, thing.__name__, inspect.signature(thing))  # type: ignore[attr-defined,arg-type,return-value]
    for name, member in list(vars(thing).items()):
        if inspect.isfunction(member) and (name == "__init__" or not name.startswith("_")):
            what = thing.__name__ if name == "__init__" else f"{thing.__name__}.{name}"
            setattr(thing, name, _refusing(member, what, inspect.signature(member)))
    return thing


def _refusing(function: Callable, what: str, signature: inspect.Signature) -> Callable:
    takes = [name for name in signature.parameters if name != "self"]
    any_name = any(parameter.kind is inspect.Parameter.VAR_KEYWORD for parameter in signature.parameters.values())
    by_name = all(signature.parameters[name].kind is inspect.Parameter.KEYWORD_ONLY for name in takes)

    @wraps(function)
    def call(*arguments: Any, **named: Any) -> Any:
        try:
            return function(*arguments, **named)
        except TypeError:
            try:
                signature.bind(*arguments, **named)
            except TypeError as misfit:
                fault = next((_unknown(name, takes) for name in named if not any_name and name not in takes), str(misfit))
                raise InputError(f"{what}: {fault}; it takes {'by name: ' if by_name else ''}{', '.join(takes)}") from None
            raise

    return call


def _unknown(name: str, takes: list[str]) -> str:
    meant = get_close_matches(name, takes, 1)
    return f"there is no argument {name!r}" + (f"; {meant[0]!r} may be meant" if meant else "")
