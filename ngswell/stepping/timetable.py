"""When a run has to be where: its begin and end, kinks and bends of its histories, the times that observers ask for."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import inf

SMALLEST_STEP = 1e-12
"""Steps below this fraction of the interval between two kinks, of the time itself or of 1 s count as none."""


def resolution(*times: float) -> float:
    """What the clock tells apart at these times [s]."""
    return SMALLEST_STEP * max(1.0, *map(abs, times))


def same_time(a: float, b: float) -> bool:
    """Whether two times [s] differ by round-off only."""
    return abs(a - b) <= resolution(a, b)


@dataclass(frozen=True)
class Timetable:
    """Times of a run [s], each list sorted. Steps start anew at `kinks`; `stops` are only landed on."""

    begin: float
    end: float
    kinks: tuple[float, ...]
    stops: tuple[float, ...]

    @classmethod
    def of(cls, begin: float, end: float, kinks: Iterable[float], stops: Iterable[float]) -> Timetable:
        """Begin and end are kinks too; those of the histories count where the run passes them."""
        inside = {kink for kink in kinks if begin < kink < end}
        return cls(begin, end, tuple(sorted(inside | {begin, end})), tuple(sorted(set(stops))))

    @property
    def duration(self) -> float:
        return self.end - self.begin

    def is_kink(self, time: float) -> bool:
        """Whether `time` is a kink, to round-off."""
        return following(self.kinks, time)[0]

    def next_kink(self, time: float) -> float:
        """The kink after `time`; the end is one."""
        return following(self.kinks, time)[1]

    def next_stop(self, time: float) -> float:
        """Where the step from `time` has to land at the latest."""
        stop = min(self.next_kink(time), following(self.stops, time)[1])
        return self.end if same_time(stop, self.end) else stop  # else nothing would be left to step over


def landing(wanted: float, remaining: float) -> float:
    """The step to take: all that remains, half of it where that avoids a sliver, or what is wanted."""
    if wanted >= 0.9999 * remaining:
        return remaining
    return remaining / 2 if wanted > remaining / 2 else wanted


def following(times: Sequence[float], time: float) -> tuple[bool, float]:
    """Whether `time` is one of the sorted `times`, and the one that follows it."""
    first = last = bisect_left(times, time)
    while first > 0 and same_time(times[first - 1], time):
        first -= 1
    while last < len(times) and same_time(times[last], time):
        last += 1
    return first < last, times[last] if last < len(times) else inf
