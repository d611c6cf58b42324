"""Smooth values over time: steps go over them as they go over what the body does by itself."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import pi, sin

import numpy as np

from ngswell import checks
from ngswell.errors import InputError
from ngswell.schedules import LARGEST, Number, through


@dataclass(frozen=True)
class Sine(Number):
    """mean + amplitude sin(2π (t − start)/period) for so many whole cycles; the mean before and after.

    `mean` and `amplitude` in the unit of what it is for, `period` and `start` in s. Kinks are its start and end, bends its
    extremes, so that no long step misses a cycle. Raises InputError for a period that is not positive, or too many cycles.
    """

    mean: float
    amplitude: float
    period: float
    cycles: int
    start: float = 0.0

    def __post_init__(self) -> None:
        checks.set_fields(
            self,
            mean=checks.number("Sine: mean", self.mean, low=-LARGEST, high=LARGEST),
            amplitude=checks.number("Sine: amplitude", self.amplitude, low=-LARGEST, high=LARGEST),
            period=checks.positive("Sine: period", self.period, "s"),
            cycles=checks.integer("Sine: cycles", self.cycles, 1, 10**6),
            start=checks.number("Sine: start", self.start, "s", -LARGEST, LARGEST),
        )
        if not self.start + self.period / 4 > self.start:
            raise InputError(f"Sine: period = {self.period:g} s is lost in round-off of start = {self.start:g} s")

    @property
    def end(self) -> float:
        """Time of the end of its last cycle [s]."""
        return self.start + self.cycles * self.period

    @property
    def kinks(self) -> tuple[float, ...]:
        return self.start, self.end

    @cached_property
    def bends(self) -> tuple[float, ...]:
        return tuple(self.start + self.period * (half / 2 + 1 / 4) for half in range(2 * self.cycles))

    @property
    def values(self) -> tuple[float, ...]:
        return self.mean, self.mean + self.amplitude, self.mean - self.amplitude

    def at(self, time: float) -> float:
        if not self.start < time < self.end:
            return self.mean
        return self.mean + self.amplitude * sin(2 * pi * ((time - self.start) / self.period % 1.0))


@dataclass(frozen=True, init=False)
class Spline(Number):
    """Smooth in time through (time [s], value) points, constant before the first and after the last.

    Cubic pieces with one slope at each point, by the rule of Fritsch and Butland (SIAM J. Sci. Stat. Comput. 5 (1984) 300):
    between two points it stays between their values, and at extremes and ends it is level. Kinks are the points at
    which it begins or ceases to be constant, bends its extremes. Raises InputError for times that do not increase.
    """

    times: tuple[float, ...]
    values: tuple[float, ...]

    def __init__(self, *points: tuple[float, float]) -> None:
        times, values = through("Spline", points)
        checks.set_fields(self, times=times, values=values)

    @cached_property
    def _chords(self) -> tuple[float, ...]:
        """Mean slopes before the first point, between points and after the last one [1/s]."""
        ends = pairwise(zip(self.times, self.values, strict=True))
        return (0.0, *((value - old) / (time - start) for (start, old), (time, value) in ends), 0.0)

    @cached_property
    def _slopes(self) -> tuple[float, ...]:
        """At the points [1/s]: harmonic means of the chords beside, weighted by their times; 0 where signs change."""
        durations = (1.0, *np.diff(self.times).tolist(), 1.0)
        slopes = []
        for (a, b), (before, after) in zip(pairwise(durations), pairwise(self._chords), strict=True):
            first, second = (a + 2 * b) / (3 * (a + b)), (2 * a + b) / (3 * (a + b))
            slopes.append(before * after / (second * before + first * after) if before * after > 0 else 0.0)
        return tuple(slopes)

    def _where(self, found: bool) -> tuple[float, ...]:
        """Times of level points [s], with a constant piece on one side or without."""
        beside = zip(self.times, pairwise(self._chords), strict=True)
        return tuple(t for t, (a, b) in beside if a * b <= 0 and (a or b) and (a * b == 0) is found)

    @property
    def kinks(self) -> tuple[float, ...]:
        return self._where(True)

    @property
    def bends(self) -> tuple[float, ...]:
        return self._where(False)

    def at(self, time: float) -> float:
        after = bisect_right(self.times, time)
        if after == 0 or after == len(self.times):
            return self.values[after - 1 if after else 0]
        start, duration = self.times[after - 1], self.times[after] - self.times[after - 1]
        s = (time - start) / duration
        rise = self.values[after] - self.values[after - 1]
        first, second = (duration * slope for slope in self._slopes[after - 1 : after + 1])
        # Hermite's piece: 3s² − 2s³ takes the rise, s(1 − s)² and −s²(1 − s) the slopes
        return self.values[after - 1] + s * s * (3 - 2 * s) * rise + s * (1 - s) * ((1 - s) * first - s * second)
