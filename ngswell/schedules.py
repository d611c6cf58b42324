"""Values over time, and the times at which they bend.

A schedule is a plain value. A run turns it into a `Signal`: an NGSolve field whose Parameters follow the clock.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from math import inf
from typing import Protocol, cast, runtime_checkable

import numpy as np
from ngsolve import CoefficientFunction, Parameter
from numpy.typing import NDArray

from ngswell import checks
from ngswell.checks import Field
from ngswell.errors import InputError

LARGEST = 1e15
"""Times and values beyond this are none that a history can mean."""

BEND = 1e-2
"""A point off the line through its neighbours by at most this share of its history's range is a bend, beyond that a kink."""

STRAIGHT = 1e-9
"""A point off that line by at most this share lies on it: round-off of decimal times and values, and below any tolerance."""


CLOSEST = 1e-100
"""Times [s] that differ by no more are one time: slopes between them would be infinite."""


@dataclass(frozen=True)
class Signal:
    """A schedule in the forms: `field` enters them, `set(t)` moves it to time t [s]."""

    field: CoefficientFunction
    set: Callable[[float], None]


@runtime_checkable
class Schedule(Protocol):
    """A value over time. A history of one's own gives, numbered:

    1. `kinks`, the times at which its slope jumps [s]: steps land on them and start anew there;
    2. `bends`, times at which steps have to land but go on as before: small kinks, and what a long step could miss;
    3. `values`, all that it passes, for refusals and natural sizes;
    4. `at`, its value at a time, and `uniform`, whether that is one number for all places;
    5. `signal`, its form in a run;
    6. `check_on`, its refusals once the places are known.
    """

    @property
    def kinks(self) -> tuple[float, ...]: ...

    @property
    def bends(self) -> tuple[float, ...]: ...

    @property
    def values(self) -> tuple[float, ...]: ...

    @property
    def uniform(self) -> bool: ...

    def at(self, time: float) -> float | CoefficientFunction: ...

    def check_on(self, where: NDArray) -> None:
        """Refuse what the history cannot mean at the mesh points `where`."""
        ...

    def signal(self) -> Signal: ...


class Number:
    """One number over time, the same at all places."""

    uniform = True

    def at(self, time: float) -> float:
        """Value at `time` [s]."""
        raise NotImplementedError

    def check_on(self, where: NDArray) -> None:
        pass

    def signal(self) -> Signal:
        parameter = Parameter(0.0)
        return Signal(parameter, lambda time: parameter.Set(self.at(time)))


@dataclass(frozen=True, init=False)
class Ramp(Number):
    """Piecewise linear in time through (time [s], value) points, constant before the first and after the last.

    `Ramp((7000, 4.1), (7080, 2.7))`; one point is a constant. Points on a straight line are neither kinks nor bends. Raises
    InputError for times that do not increase.
    """

    times: tuple[float, ...]
    values: tuple[float, ...]

    def __init__(self, *points: tuple[float, float]) -> None:
        times, values = through("Ramp", points)
        checks.set_fields(self, times=times, values=values)

    @property
    def kinks(self) -> tuple[float, ...]:
        return self._points_off_line(BEND, inf)

    @property
    def bends(self) -> tuple[float, ...]:
        return self._points_off_line(STRAIGHT, BEND)

    def _points_off_line(self, least: float, most: float) -> tuple[float, ...]:
        """Times [s] of points that are off the line through their neighbours by `least` to `most` of the range of values.

        That is the jump of the slope times a b/(a + b), a and b the times to the neighbours; infinite beyond the ends.
        """
        span = max(self.values) - min(self.values)
        if span == 0:
            return ()
        durations = np.diff(self.times)
        jumps = np.diff([0.0, *np.diff(self.values) / durations, 0.0])
        frequencies = np.array([0.0, *1 / durations, 0.0])
        off = np.abs(jumps) / (frequencies[:-1] + frequencies[1:]) / span
        return tuple(time for time, share in zip(self.times, off, strict=True) if least < share <= most)

    def at(self, time: float) -> float:
        """Value at `time` [s]."""
        after = bisect_right(self.times, time)
        if after == 0 or after == len(self.times):
            return self.values[after - 1 if after else 0]
        before, start, end = self.values[after - 1], self.times[after - 1], self.times[after]
        return before + (self.values[after] - before) / (end - start) * (time - start)


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
    def bends(self) -> tuple[float, ...]:
        return tuple(sorted({*self.first.bends, *self.second.bends}))

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


def through(what: str, points: tuple[tuple[float, float], ...]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Times and values of (time [s], value) points. InputError for what are none, and for times that do not increase."""
    if not points:
        raise InputError(f"{what} needs at least one (time, value) point")
    pairs = [checks.vector(f"{what}: a (time, value) point", point, LARGEST) for point in points]
    for pair in pairs:
        if len(pair) != 2:
            raise InputError(f"{what} takes points (time, value), {what}((0, 1.0), (60, 2.0)), got {checks.short(pair)}")
    times, values = (tuple(column) for column in zip(*pairs, strict=True))
    for before, after in pairwise(times):
        if not after - before > CLOSEST:
            raise InputError(f"{what} times have to increase, but {after:g} s follows {before:g} s")
    return times, values


def schedule(what: str, value: float | Schedule) -> Schedule:
    """A number as a constant Ramp; schedules pass through. InputError for `what` is neither."""
    if checks.is_a(value, Schedule):
        return cast(Schedule, value)
    return Ramp((0.0, checks.number(what, value, hint="or a history, Ramp(...), Sine(...), Spline(...) or Blend(...)")))


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
