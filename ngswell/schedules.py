"""Values over time, and the times at which they bend.

A schedule is a plain value. A run turns it into a `Signal`: an NGSolve field whose Parameters follow the clock.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol, cast, runtime_checkable

import numpy as np
from ngsolve import CoefficientFunction, Parameter
from numpy.typing import NDArray

from ngswell import checks
from ngswell.checks import Field
from ngswell.errors import InputError

LARGEST = 1e15
"""Times and values beyond this are none that a history can mean."""


@dataclass(frozen=True)
class Signal:
    """A schedule in the forms: `field` enters them, `set(t)` moves it to time t [s]."""

    field: CoefficientFunction
    set: Callable[[float], None]


@runtime_checkable
class Schedule(Protocol):
    """A value over time. A history of one's own gives, numbered:

    1. `kinks`, the times at which it bends [s]: steps land on them and forget their past there;
    2. `values`, all that it passes, for refusals and natural sizes;
    3. `at`, its value at a time, and `uniform`, whether that is one number for all places;
    4. `signal`, its form in a run;
    5. `check_on`, its refusals once the places are known.
    """

    @property
    def kinks(self) -> tuple[float, ...]: ...

    @property
    def values(self) -> tuple[float, ...]: ...

    @property
    def uniform(self) -> bool: ...

    def at(self, time: float) -> float | CoefficientFunction: ...

    def check_on(self, where: NDArray) -> None:
        """Refuse what the history cannot mean at the mesh points `where`."""
        ...

    def signal(self) -> Signal: ...


@dataclass(frozen=True, init=False)
class Ramp:
    """Piecewise linear in time through (time [s], value) points, constant before the first and after the last.

    `Ramp((7000, 4.1), (7080, 2.7))`; one point is a constant. Raises InputError for times that do not increase.
    """

    times: tuple[float, ...]
    values: tuple[float, ...]

    def __init__(self, *points: tuple[float, float]) -> None:
        if not points:
            raise InputError("Ramp needs at least one (time, value) point")
        pairs = [checks.vector("Ramp: a (time, value) point", point, LARGEST) for point in points]
        for pair in pairs:
            if len(pair) != 2:
                raise InputError(f"Ramp takes points (time, value), Ramp((0, 1.0), (60, 2.0)), got {checks.short(pair)}")
        times, values = (tuple(column) for column in zip(*pairs, strict=True))
        for before, after in pairwise(times):
            if after <= before:
                raise InputError(f"Ramp times have to increase, but {after:g} s follows {before:g} s")
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "values", values)

    uniform = True

    def check_on(self, where: NDArray) -> None:
        pass

    @property
    def kinks(self) -> tuple[float, ...]:
        return self.times if len(self.times) > 1 else ()

    def at(self, time: float) -> float:
        """Value at `time` [s]."""
        after = bisect_right(self.times, time)
        if after == 0 or after == len(self.times):
            return self.values[after - 1 if after else 0]
        before, start, end = self.values[after - 1], self.times[after - 1], self.times[after]
        return before + (self.values[after] - before) / (end - start) * (time - start)

    def signal(self) -> Signal:
        parameter = Parameter(self.values[0])
        return Signal(parameter, lambda time: parameter.Set(self.at(time)))


@dataclass(frozen=True)
class Blend:
    """A history that varies in space: (1 − weight)·first + weight·second, `weight` a field of position in [0, 1]."""

    first: Ramp
    second: Ramp
    weight: Field

    uniform = False

    def __post_init__(self) -> None:
        for history in (self.first, self.second):
            checks.instance("Blend: a history", history, Ramp, "a Ramp, such as Ramp((0, 0.15))")
        if isinstance(self.weight, CoefficientFunction):
            checks.scalar("Blend: weight", self.weight)
        else:
            checks.set_fields(self, weight=checks.number("Blend: weight", self.weight, low=0.0, high=1.0))

    def check_on(self, where: NDArray) -> None:
        """Refuse a weight that leaves [0, 1] at the mesh points `where`, by more than round-off."""
        if isinstance(self.weight, CoefficientFunction):
            weights = np.asarray(self.weight(where)).ravel()
            for weight in (weights.min(), weights.max()):
                checks.number("Blend: weight", float(weight), low=-1e-9, high=1 + 1e-9)

    @property
    def kinks(self) -> tuple[float, ...]:
        return tuple(sorted({*self.first.kinks, *self.second.kinks}))

    @property
    def values(self) -> tuple[float, ...]:
        return self.first.values + self.second.values

    def at(self, time: float) -> float | CoefficientFunction:
        """Value at `time` [s]: a number where both histories agree, else a field."""
        first, second = self.first.at(time), self.second.at(time)
        return first if first == second else (1 - self.weight) * first + self.weight * second

    def signal(self) -> Signal:
        first, second = self.first.signal(), self.second.signal()

        def move(time: float) -> None:
            first.set(time)
            second.set(time)

        return Signal((1 - self.weight) * first.field + self.weight * second.field, move)


def schedule(what: str, value: float | Schedule) -> Schedule:
    """A number as a constant Ramp; schedules pass through. InputError for `what` is neither."""
    if checks.is_a(value, Schedule):
        return cast(Schedule, value)
    return Ramp((0.0, checks.number(what, value, hint="or a history, Ramp(...) or Blend(...)")))


class Clock:
    """The time of a discrete problem [s], and the fields that follow it."""

    def __init__(self, time: float) -> None:
        self.time = time
        self._signals: list[Signal] = []

    def follow(self, history: Schedule) -> CoefficientFunction:
        """A field that has the history's value at the clock's time."""
        signal = history.signal()
        signal.set(self.time)
        self._signals.append(signal)
        return signal.field

    def set(self, time: float) -> None:
        """Move all fields to `time` [s]."""
        self.time = time
        for signal in self._signals:
            signal.set(time)
