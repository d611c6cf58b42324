"""Time integration from kink to kink: attempts at a step until one is accepted."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf

import numpy as np
from numpy.typing import NDArray

from ngswell.errors import OF_IONS, UNCONVERGED, Failure, Reason, Rejection
from ngswell.files import Tree
from ngswell.problem.problem import Problem
from ngswell.solve.direct import LinearSolver
from ngswell.solve.factorisation import Factorisation
from ngswell.solve.newton import DampedNewton
from ngswell.stepping.attempts import Attempt, Attempts
from ngswell.stepping.schemes import BACKWARD_EULER, Scheme
from ngswell.stepping.sizes import Sizes, safety_of
from ngswell.stepping.steps import Control, Step
from ngswell.stepping.timetable import Timetable, landing, resolution, same_time

JUMP = 0.8
"""After a kink, a change that a five times smaller step leaves above this share does not come from the time
discretisation: what a history of one's own changes at once, pressure and displacement follow at once."""

STUCK = 0.25
"""A step whose stages of higher order are not found in two attempts, or whose error falls with no more than this power of
the step, is taken with backward Euler: where contents vanish or rates jump."""

CAREFUL = 10
"""So many steps after such a one are taken with backward Euler too; or with salt that is lumped, where integrals fail."""

BEFORE_LUMPING = 2
"""So many steps of backward Euler have to fail before salt is lumped for the first time in a run."""

INSTANT = 1e-9
"""Share of the time to the next kink in which nothing happens but what loads and baths change at once."""

PATIENCE = 6
"""Attempts at a first step after a kink that may be stuck, before it starts from an instant: errors fall only once the step
is short for the cells at the bath."""

AFTER_KINK = 1
"""Power of the step that errors fall with just after a kink, where layers are thinner than cells: measured 0.5 to 1.5."""

LEAST_POWER = 0.5
"""The least power that a retry reckons with."""


class Failed(Exception):
    """No attempt succeeded: from which time [s], with which last and first step [s], and why the last one failed."""

    def __init__(self, time: float, dt: float, tried: float, failure: Failure) -> None:
        super().__init__(failure.text)
        self.time, self.dt, self.tried, self.failure = time, dt, tried, failure


class Stepper:
    """The accepted steps of one run: iterate over it. It lands on every time of the timetable.

    A step that fails raises `Failed`; the fields of the problem and `accepted` are then those of the last accepted one.
    What the next step depends on, beside the fields, is here and nowhere else: `state` and `restore`.
    """

    def __init__(
        self,
        problem: Problem,
        timetable: Timetable,
        control: Control,
        solver: LinearSolver,
        newton: DampedNewton | None = None,
    ) -> None:
        self.problem, self.timetable, self.control = problem, timetable, control
        self.newton = newton or control.newton
        self.factorisation = Factorisation(solver, self.newton.slowest)
        self._scheme = control.scheme
        self._sizes = Sizes(problem)
        self._watches = not control.accepts(inf)  # whether errors count
        self._points: list[tuple[float, NDArray]] = []  # times and states of the last step, unless a kink lies between
        self._wanted: float | None = None
        self._careful = self._lumping = 0
        self._lumped = self._lumping_helps = False  # whether the last accepted step was lumped, or any was
        of_run = self._sizes if self._watches and self.newton == control.newton else None
        self._attempts = Attempts(problem, self.newton, self.factorisation, self._scheme.explicit_start, of_run)
        self._slope = self._attempts.first_slope()
        self._keep(problem.time)

    def __iter__(self) -> Iterator[Step]:
        while self.accepted.time < self.timetable.end:
            yield self._advance()

    def _keep(self, time: float) -> None:
        """Take what is there as the last accepted step. Arrays that no step changes, not copies."""
        self.accepted = self.problem.snapshot(time)
        kept: Tree = {
            "points": {str(number): values for number, (_, values) in enumerate(self._points)},
            "times": np.array([at for at, _ in self._points]),
            "sizes": self._sizes.state(),
            "careful": np.array([self._careful, self._lumping]),
            "lumped": np.array([self._lumped, self._lumping_helps]),
            "slope": self._slope,
            "factorisation": self.factorisation.state(),
        }
        if self._wanted is not None:
            kept["wanted"] = np.array(self._wanted)
        self._kept = kept

    def state(self) -> Tree:
        """All that the step after the last accepted one depends on, beside the fields and the setup."""
        return self._kept

    def restore(self, state: Tree, same: bool) -> None:
        """Go on as the stepper that gave `state`; without the `same` method, with what does not depend on it."""
        self._sizes.restore(state["sizes"])
        if same:
            self._points = [(at, state["points"][str(number)]) for number, at in enumerate(state["times"].tolist())]
            self._wanted = float(state["wanted"]) if "wanted" in state else None
            self._careful, self._lumping = state["careful"].tolist()
            self._lumped, self._lumping_helps = state["lumped"].tolist()
            self._slope = state["slope"]
            present = self.problem.snapshot(self.problem.time)
            self.factorisation.restore(self.problem, state["factorisation"])  # moves the fields and the clock
            self.problem.restore(present)
            self.problem.storage.lump(self._lumped)
        self._keep(self.problem.time)

    # -- one step ------------------------------------------------------------------------------------------------------

    def _advance(self) -> Step:
        """Attempts from the last accepted state until one is accepted."""
        time = self.accepted.time
        kink, stop = self.timetable.next_kink(time), self.timetable.next_stop(time)
        if self._watches and self.timetable.is_kink(time):
            self._sizes.expects(self._attempts.expected(self.accepted, kink))
            if time == self.timetable.begin and (settled := self._settle(kink - time)):
                return settled
        if self.timetable.is_kink(time) or self._wanted is None:
            self._points = []
            self._wanted = self.control.first(kink - time, self._wanted)
        safety = safety_of(self._scheme, not self._points)
        shortest = 0.0 if self._points else 3 * self._instant(kink - time)
        rejected: list[Rejection] = []
        last: Rejection | None = None  # the attempt before, if its error was too large
        scheme = BACKWARD_EULER if self._careful else self._scheme
        lumped = self._lumping > 0
        integrals: list[Failure] = []  # failures of backward Euler with them
        while True:
            dt = landing(self._wanted, stop - time)
            if same_time(time + dt, stop):  # what would be left is round-off
                dt = stop - time
            end = stop if dt == stop - time else time + dt
            points = self._points if lumped == self._lumped else []  # salt that is stored otherwise moves at once
            attempt = self._attempts.take(scheme, self.accepted, points, self._slope, end, lumped)
            error = self._error(attempt, safety)
            if attempt.failure is None and self._accepts(error, scheme, last, bool(points)):
                return self._accept(attempt, error, scheme, dt, tuple(rejected))
            rejection, failure = self._reject(attempt, error, dt)
            rejected.append(rejection)
            self.problem.restore(self.accepted)
            self.problem.storage.lump(self._lumped)
            if attempt.failure:
                if not lumped and not scheme.embedded:
                    integrals.append(failure)
                lumped = not lumped and self._may_lump(failure, len(integrals), end)
                if lumped:
                    continue
            last, stuck = self._retry(rejection, scheme, dt, last, len(rejected) > 1)
            if stuck and shortest and scheme.embedded:
                if len(rejected) >= PATIENCE:
                    last, self._wanted, shortest = None, shortest, 0.0
            elif len(rejected) > 1 and scheme.embedded and stuck:
                scheme, last, self._wanted, self._careful = BACKWARD_EULER, None, rejected[0].dt, CAREFUL
            if self._wanted < resolution(kink - time, time):
                raise Failed(time, dt, rejected[0].dt, integrals[-1] if integrals else failure)

    def _may_lump(self, failure: Failure, times: int, end: float) -> bool:
        """Whether the step to `end` [s] is tried with lumped salt, after backward Euler has failed so many `times`.

        Where ions run out, or nothing is known yet; but not while the charge changes, which uses them up wherever they are.
        """
        charge = self.problem.setup.charge
        may_be_ions = failure.reason in OF_IONS | UNCONVERGED and charge.at(end) == charge.at(self.accepted.time)
        return may_be_ions and self.problem.lumps and (times >= BEFORE_LUMPING or self._lumping_helps)

    def _settle(self, interval: float) -> Step | None:
        """A first step that takes what loads and baths change at once, unless that is nothing or not found."""
        dt = self._instant(interval)
        if not dt:
            return None
        attempt = self._attempts.settle(self.accepted, dt)
        if attempt.failure or self.control.accepts(100 * self._error(attempt)):
            self.problem.restore(self.accepted)
            return None
        return self._accept(attempt, 0.0, BACKWARD_EULER, dt, ())

    def _instant(self, interval: float) -> float:
        """A step [s] in which nothing happens but what changes at once; 0 where the clock cannot tell it."""
        dt = INSTANT * interval
        return dt if dt >= 10 * resolution(interval, self.accepted.time) else 0.0

    def _error(self, attempt: Attempt, safety: tuple[float, float] = (1.0, 1.0)) -> float:
        return inf if attempt.difference is None else attempt.factor * self._sizes.relative(attempt.difference, safety)

    def _accepts(self, error: float, scheme: Scheme, last: Rejection | None, smooth: bool) -> bool:
        jumps = not scheme.embedded and not smooth and last is not None and error > JUMP * last.error
        return self.control.accepts(error) or jumps

    def _reject(self, attempt: Attempt, error: float, dt: float) -> tuple[Rejection, Failure]:
        """Why an attempt is not accepted, for the report and in full."""
        failure = attempt.failure
        if failure is None:
            field, where = self.problem.worst(self.problem.vector - self.accepted.values)
            failure = Failure(Reason.ERROR_ABOVE_TOLERANCE, field, where)
        return Rejection(dt, failure.reason, failure.what, error), failure

    def _retry(
        self, rejection: Rejection, scheme: Scheme, dt: float, last: Rejection | None, again: bool
    ) -> tuple[Rejection | None, bool]:
        """Choose the next attempt's step; what it is to be compared with, and whether smaller steps do not help."""
        if rejection.reason is not Reason.ERROR_ABOVE_TOLERANCE:
            self._wanted = dt / 4
            return last, again
        error = rejection.error
        usual = AFTER_KINK if scheme.embedded and not self._points else scheme.power
        power = usual if last is None else np.log(last.error / error) / np.log(last.dt / dt)
        self._wanted = self.control.next(dt, error, np.clip(power, LEAST_POWER, scheme.power))
        return rejection, bool(power < STUCK)

    def _accept(self, attempt: Attempt, error: float, scheme: Scheme, dt: float, rejected: tuple[Rejection, ...]) -> Step:
        end = attempt.stages[-1].time
        if attempt.slope is not None:
            self._slope = attempt.slope
        self._careful = max(0, self._careful - 1)
        self._lumped = self.problem.storage.is_lumped
        self._lumping = (self._lumping or CAREFUL) - 1 if self._lumped else 0
        self._lumping_helps |= self._lumped
        self._points = [(stage.time, stage.values) for stage in attempt.stages]
        self._sizes.passes(attempt.stages[-1].values)
        if self._wanted is not None:
            landed_short = dt < 0.999 * self._wanted
            proposed = self.control.next(dt, error, scheme.power)
            self._wanted = max(self._wanted, proposed) if landed_short else proposed
        self._keep(end)
        return Step(end, dt, attempt.iterations, rejected, error, attempt.stages, attempt.slope, scheme)
