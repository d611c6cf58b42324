"""The times at which something is due during a run."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from math import isclose

import numpy as np

from ngswell import checks
from ngswell.errors import InputError
from ngswell.schedules import LARGEST

MOST_RECORDS = 10**6
"""Records that an interval may ask for."""


class When:
    """After every accepted step (None), at an interval [s], or at a list of times [s]. `what` is whose times they are."""

    def __init__(self, what: str, value: float | Sequence[float] | None) -> None:
        if checks.is_number(value):
            value = checks.positive(f"{what}: the interval", value, "s")
        elif value is not None:
            value = checks.vector(f"{what}: the times", value, LARGEST, "s")
            if not value:
                raise InputError(f"{what}: there are no times to record at; leave `when` out to record every step")
        self.what, self.value = what, value
        self._times: list[float] = []

    def plan(self, begin: float, until: float) -> list[float]:
        """Settle the times of a run from `begin` to `until` [s]; returns them, for steps to land on."""
        if self.value is None:
            self._times = []
        elif isinstance(self.value, float):
            if (until - begin) / self.value > MOST_RECORDS:
                raise InputError(
                    f"{self.what}: an interval of {self.value:g} s makes more than {MOST_RECORDS} records from "
                    f"{begin:g} to {until:g} s; take a longer one"
                )
            self._times = [*np.arange(begin, until, self.value).tolist(), until]
        else:
            for time in self.value:
                if not begin <= time <= until:
                    raise InputError(f"{self.what}: {time:g} s is outside the run, {begin:g} to {until:g} s")
            self._times = sorted(self.value)
        return self._times

    def due(self, time: float) -> bool:
        """Whether `time` [s] is one of them; every time is where none are named."""
        if self.value is None:
            return True
        after = bisect_left(self._times, time)
        return any(_same(time, t) for t in self._times[max(0, after - 1) : after + 1])

    def passed(self, start: float, end: float) -> list[float]:
        """Those of a step from `start` to `end` [s], the end included, the start not."""
        inside = self._times[bisect_left(self._times, start) : bisect_left(self._times, end)]
        between = [time for time in inside if not _same(time, start) and not _same(time, end)]
        return between + ([end] if self.due(end) else [])

    def __repr__(self) -> str:
        return "" if self.value is None else f"when={np.array(self.value).tolist()}"


def _same(a: float, b: float) -> bool:
    return isclose(a, b, rel_tol=1e-12, abs_tol=1e-12)
