"""The observers of one run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from types import TracebackType
from typing import Any

from ngswell import checks
from ngswell.errors import InputError, InstabilityError
from ngswell.files import Tree
from ngswell.observers.base import Observer
from ngswell.observers.call import Call
from ngswell.problem.problem import Problem
from ngswell.stepping.steps import Step


class Watch:
    """Starts observers, shows them accepted steps, and finishes those that were started, however a run ends."""

    def __init__(self, observers: Sequence[Observer | Callable[[float, Any], object]]) -> None:
        given = checks.several("observers", observers, (Observer, Callable), "observers, such as Probe(...), or functions")
        self.observers = [each if isinstance(each, Observer) else Call(each) for each in given]
        for number, observer in enumerate(self.observers):
            if observer.used or any(observer is other for other in self.observers[:number]):
                raise InputError(
                    f"observers: {checks.short(observer)} has records of a run already, or stands here twice; "
                    "make a new one for each run"
                )
        self._started: list[Observer] = []
        self._problem: Problem | None = None

    def plan(self, begin: float, until: float) -> list[float]:
        """Times on which steps have to land [s]."""
        return [time for observer in self.observers for time in observer.plan(begin, until)]

    def start(
        self, problem: Problem, begin: float, time: float, until: float, remembered: Sequence[tuple[str, Tree]] = ()
    ) -> None:
        """From the present fields at `time`; what was `remembered` of an earlier part goes back to those it came from."""
        self._problem = problem
        states = iter(remembered)
        for observer in self.observers:
            observer.team = problem.team
            if remembered and observer.remembers:
                observer.resume(problem, begin, until, next(states)[1])
            else:
                observer.start(problem, time, until)
            observer.used = True
            self._started.append(observer)

    def observe(self, step: Step) -> None:
        """Show every observer an accepted step; an unstable state is told when all have seen it, so that they agree."""
        assert self._problem is not None
        unstable: InstabilityError | None = None
        for observer in self.observers:
            try:
                observer.observe(self._problem, step)
            except InstabilityError as error:
                unstable = unstable or error
        if unstable is not None:
            raise unstable

    def state(self) -> tuple[tuple[str, Tree], ...]:
        """What observers that take part in checkpoints remember, by their settings."""
        return tuple((repr(o), o.kept()) for o in self.observers if o.remembers)

    def __enter__(self) -> Watch:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        assert self._problem is not None or not self._started
        for observer in self._started:
            observer.finish(self._problem)  # type: ignore[arg-type]
