"""A function as an observer."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from ngswell import checks
from ngswell.errors import InputError
from ngswell.observers.base import Observer
from ngswell.problem.problem import Problem


class Call(Observer):
    """Calls a function of time [s] and state with the initial state and after accepted steps.

    `state.outputs()` are the model's quantities, `state.at(point, "J")` is one at a point. A run makes one of every plain
    function among its observers; `when` is for those that are not called after each step.
    """

    def __init__(self, function: Callable[[float, Any], object], when: float | Sequence[float] | None = None) -> None:
        if not callable(function):
            raise InputError(f"Call has to be given a function of time and state, got {checks.short(function)}")
        super().__init__(when, getattr(function, "__qualname__", type(function).__name__))
        self.function = function

    def record(self, problem: Problem, time: float) -> None:
        self.function(time, problem.state)
