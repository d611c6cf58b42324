"""The life of an observer."""

from __future__ import annotations

from collections.abc import Sequence
from math import isclose

import numpy as np
from numpy.typing import NDArray

from ngswell import checks
from ngswell.errors import InputError
from ngswell.problem.problem import Problem
from ngswell.schedules import LARGEST
from ngswell.stepping.stepper import StepReport

MOST_RECORDS = 10**6
"""Records that an interval may ask for."""


class Observer:
    """Base of all observers. `when` is None (every accepted step), an interval [s] or a list of times [s].

    Steps land on the times asked for. Raises InputError for times that the run does not pass.

    A class of one's own defines `record` (or `observe`), and `prepare` for what it needs before. One that also defines
    `memory` and `remember` goes on in a run resumed from a checkpoint as if nothing had been; others start anew there.
    `settings` and `when` tell observers of a class apart.
    """

    def __init__(self, when: float | Sequence[float] | None = None, *settings: object) -> None:
        what = type(self).__name__
        if checks.is_number(when):
            when = checks.positive(f"{what}: the interval", when, "s")
        elif when is not None:
            when = checks.vector(f"{what}: the times", when, LARGEST, "s")
            if not when:
                raise InputError(f"{what}: there are no times to record at; leave `when` out to record every step")
        self.when = when
        self._settings = settings
        self._times: list[float] = []
        self._recorded: list[float] = []

    @property
    def time(self) -> NDArray:
        """Times of the records [s]."""
        return np.array(self._recorded)

    def times(self, begin: float, until: float) -> list[float]:
        """Times [s] on which steps have to land."""
        if self.when is None:
            self._times = []
        elif isinstance(self.when, float):
            if (until - begin) / self.when > MOST_RECORDS:
                raise InputError(
                    f"{type(self).__name__}: an interval of {self.when:g} s makes more than {MOST_RECORDS} records from "
                    f"{begin:g} to {until:g} s; take a longer one"
                )
            self._times = [*np.arange(begin, until, self.when).tolist(), until]
        else:
            for time in self.when:
                if not begin <= time <= until:
                    raise InputError(f"{type(self).__name__}: {time:g} s is outside the run, {begin:g} to {until:g} s")
            self._times = list(self.when)
        return self._times

    def _due(self, time: float) -> bool:
        return self.when is None or any(isclose(time, t, rel_tol=1e-12, abs_tol=1e-12) for t in self._times)

    def __repr__(self) -> str:
        when = [] if self.when is None else [f"when={np.array(self.when).tolist()}"]
        return f"{type(self).__name__}({', '.join([*map(repr, self._settings), *when])})"

    def prepare(self, problem: Problem, begin: float, until: float) -> None:
        """Called once before the first record, also of a resumed run; refuses what cannot be meant."""

    def start(self, problem: Problem, begin: float, until: float) -> None:
        """Called once, with the initial state."""
        self.prepare(problem, begin, until)
        self._record_if_due(problem, begin)

    def resume(self, problem: Problem, begin: float, until: float, memory: dict[str, NDArray]) -> None:
        """Called instead of `start` in a run that began at `begin` and goes on from the present fields."""
        self.prepare(problem, begin, until)
        self._recorded = memory["time"].tolist()
        self.remember(memory)

    @property
    def remembers(self) -> bool:
        """Whether it takes part in checkpoints."""
        return type(self).memory is not Observer.memory

    def memory(self) -> dict[str, NDArray]:
        """What its records are made of, beside `time`."""
        return {}

    def remember(self, memory: dict[str, NDArray]) -> None:
        """Take back what `memory` gave."""

    def observe(self, problem: Problem, report: StepReport) -> None:
        """Called after every accepted step."""
        self._record_if_due(problem, report.time)

    def _record_if_due(self, problem: Problem, time: float) -> None:
        if self._due(time):
            self._recorded.append(time)
            self.record(problem, time)

    def record(self, problem: Problem, time: float) -> None:
        """Called at the start and after accepted steps, where due."""

    def finish(self, problem: Problem) -> None:
        """Called once at the end, also of a run that failed."""
