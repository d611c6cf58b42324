"""Backward Euler from kink to kink of the schedules, with fixed or error-controlled steps."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ngswell.errors import InputError, StepError
from ngswell.newton import Newton
from ngswell.problem import Problem
from ngswell.solvers import LinearSolver


@dataclass(frozen=True)
class StepReport:
    """An accepted step: its end [s], its size [s], Newton iterations, what was rejected on the way and why."""

    time: float
    dt: float
    iterations: int
    rejected: tuple[str, ...] = ()
    error: float | None = None


class Control(Protocol):
    """Chooses step sizes [s]."""

    def first(self, interval: float, last: float | None) -> float:
        """First step after a kink, when the next kink is `interval` away and `last` was the step before, if any."""
        ...

    def next(self, dt: float, error: float) -> float:
        """Next step after one of size `dt` with the estimated `error`."""
        ...

    def accepts(self, error: float) -> bool: ...


@dataclass(frozen=True)
class Fixed:
    """Steps of one size [s], shortened to land on kinks and where Newton's method fails."""

    step: float

    def __post_init__(self) -> None:
        _positive("Fixed step", self.step, "s")

    def first(self, interval: float, last: float | None) -> float:
        return self.step

    def next(self, dt: float, error: float) -> float:
        return self.step

    def accepts(self, error: float) -> bool:
        return True


@dataclass(frozen=True)
class Adaptive:
    """Steps whose estimated local error stays below `tolerance`.

    The error is the difference to the linear extrapolation, scaled to backward Euler's; root mean square per field,
    relative to the largest change that the field has undergone so far (or a small fraction of its natural size).
    """

    tolerance: float = 1e-3
    largest: float = inf  # [s]

    def __post_init__(self) -> None:
        _positive("Adaptive tolerance", self.tolerance, "")
        _positive("Adaptive largest", self.largest, "s")

    def first(self, interval: float, last: float | None) -> float:
        start = interval / 100
        return min(self.largest, start if last is None else min(last, 4 * start))

    def next(self, dt: float, error: float) -> float:
        factor = 0.9 * np.sqrt(self.tolerance / error) if error > 0 else inf
        return float(min(self.largest, dt * np.clip(factor, 0.2, 3.0)))

    def accepts(self, error: float) -> bool:
        return error <= self.tolerance


def _positive(name: str, value: float, unit: str) -> None:
    if not value > 0:
        raise InputError(f"{name} has to be positive, got {value!r} {unit}".rstrip())


JUMP = 0.8
"""After a kink, a change that a five times smaller step leaves above this share does not come from the time
discretisation: pressure and displacement follow a sudden load at once."""

SMALLEST_STEP = 1e-10
"""Steps below this fraction of the interval between two kinks count as none."""


@dataclass
class _History:
    """Largest change of each field so far, and the state and step before the present one unless a kink lies between."""

    changes: dict[str, float]
    previous: NDArray | None = None
    dt: float = 0.0

    def forget(self) -> None:
        self.previous, self.dt = None, 0.0


class BackwardEuler:
    """Time integration of one run: call `advance` until the end; it lands on every time of `stops`."""

    def __init__(self, problem: Problem, control: Control, newton: Newton) -> None:
        self.problem, self.control, self.newton = problem, control, newton
        self.solver = LinearSolver(problem.free)
        self.history = _History({name: self._change(name) for name in problem.model.evolving})
        self.wanted: float | None = None

    def advance(self, time: float, kinks: list[float], stops: list[float]) -> StepReport:
        """One accepted step from `time`. Raises StepError, with the fields restored, when none succeeds.

        The error estimate forgets its past at `kinks`; `stops` are only landed on.
        """
        problem, history = self.problem, self.history
        at_kink = any(_same(time, kink) for kink in kinks)
        to_kink = min(kink for kink in kinks if kink > time and not _same(kink, time)) - time
        stop = min(stop for stop in [*stops, *kinks] if stop > time and not _same(stop, time))
        to_stop = stop - time
        if at_kink or self.wanted is None:
            history.forget()
            self.wanted = self.control.first(to_kink, self.wanted)
        old = problem.vector.copy()
        rejected: list[str] = []
        last_error = inf
        while True:
            dt = _landing(self.wanted, to_stop)
            end = stop if dt == to_stop else time + dt
            guess = None if history.previous is None else old + dt / history.dt * (old - history.previous)
            problem.begin_step(end, dt, guess)
            outcome = self.newton.solve(problem, self.solver)
            if outcome.reason and guess is not None:  # the extrapolation may be what is inadmissible
                problem.vector[:] = old
                problem.begin_step(end, dt)
                outcome = self.newton.solve(problem, self.solver)
            if outcome.reason is None:
                error = self._error(old, guess, dt)
                jumps = guess is None and error > JUMP * last_error
                if self.control.accepts(error) or jumps:
                    break
                last_error = error
                reason, (field, where) = f"error {error:.2g}", problem.worst(problem.vector - old)
                self.wanted = self.control.next(dt, error)
            else:
                reason, field, where = outcome.reason, outcome.field, outcome.where
                self.wanted = dt / 4
            rejected.append(f"dt = {dt:.3g} s: {reason}")
            problem.vector[:] = old
            problem.set_time(time)
            if self.wanted < SMALLEST_STEP * to_kink:
                remedy = "Remedies: a gentler ramp, a finer mesh where the field is worst, a weaker penalty."
                raise StepError(time, dt, field, where, reason, remedy)
        history.previous, history.dt = old, dt
        for name in problem.model.evolving:
            history.changes[name] = max(self._change(name), self._change_so_far(name))
        landed_short = dt < 0.999 * self.wanted
        proposed = self.control.next(dt, error)
        self.wanted = max(self.wanted, proposed) if landed_short else proposed
        return StepReport(end, dt, outcome.iterations, tuple(rejected), error)

    def _error(self, old: NDArray, guess: NDArray | None, dt: float) -> float:
        """Local error of the step, relative to the largest change of each field so far.

        With x″ from the extrapolation over the step before, x_new − x_guess = Δt (2Δt + Δt_old)/2 x″ while the
        error is Δt²/2 x″. Without a step before, the guess is the old state (x′ = 0 before a kink).
        """
        predicted = old if guess is None else guess
        share = dt / (2 * dt + (self.history.dt if guess is not None else 0.0))
        difference = self.problem.vector - predicted
        return max(
            share * _rms(difference[self.problem.ranges[name]]) / self._change_so_far(name)
            for name in self.problem.model.evolving
        )

    def _change(self, name: str) -> float:
        part = self.problem.ranges[name]
        return _rms(self.problem.vector[part] - self.problem.initial[part])

    def _change_so_far(self, name: str) -> float:
        floor = self.problem.model.evolving[name] * self.problem.references[name]
        return max(floor, self.history.changes[name])


def _rms(values: NDArray) -> float:
    return float(np.sqrt(np.mean(values * values)))


def _same(a: float, b: float) -> bool:
    return abs(a - b) <= 1e-12 * max(1.0, abs(a), abs(b))


def _landing(wanted: float, remaining: float) -> float:
    """The step to take: all that remains, half of it where that avoids a sliver, or what is wanted."""
    if wanted >= 0.9999 * remaining:
        return remaining
    return remaining / 2 if wanted > remaining / 2 else wanted
