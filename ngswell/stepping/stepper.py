"""Time integration from kink to kink of the schedules, with fixed or error-controlled steps."""

from __future__ import annotations

from bisect import bisect_left
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import inf
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from ngswell import checks
from ngswell.analysis.diagnosis import UNDETERMINED, singular_mode
from ngswell.analysis.stability import Perturbations
from ngswell.baths.bath import Lagged
from ngswell.errors import REMEDY, InputError, NgswellError, StepError
from ngswell.problem.problem import Problem
from ngswell.solve.direct import LinearSolver
from ngswell.solve.newton import LOST, Newton, Outcome
from ngswell.stepping.schemes import BACKWARD_EULER, ESDIRK4, Scheme


@dataclass(frozen=True)
class StepReport:
    """An accepted step: its end [s], its size [s], Newton iterations, what was rejected on the way and why."""

    time: float
    dt: float
    iterations: int
    rejected: tuple[str, ...] = ()
    error: float | None = None


def why(rejected: Iterable[str]) -> str:
    """The reasons of rejected steps, the most frequent first."""
    reasons = (text.partition(": ")[2] for text in rejected)
    counts = Counter("error above the tolerance" if reason.startswith("error ") else reason for reason in reasons)
    return ", ".join(f"{count} × {reason}" for reason, count in counts.most_common())


@runtime_checkable
class Control(Protocol):
    """Chooses the scheme, how its equations are solved, and step sizes [s]."""

    @property
    def scheme(self) -> Scheme: ...

    @property
    def newton(self) -> Newton: ...

    def first(self, interval: float, last: float | None) -> float:
        """First step after a kink, when the next kink is `interval` away and `last` was the step before, if any."""
        ...

    def next(self, dt: float, error: float, power: float) -> float:
        """Next step after one of size `dt` with the estimated `error`, which goes with this `power` of the step."""
        ...

    def accepts(self, error: float) -> bool: ...


@dataclass(frozen=True)
class Fixed:
    """Steps of one size [s], shortened to land on kinks and where Newton's method fails."""

    step: float
    scheme: Scheme = BACKWARD_EULER

    def __post_init__(self) -> None:
        checks.settle(self, step=checks.positive("Fixed step", self.step, "s"))
        check_scheme("Fixed", self.scheme)

    @property
    def newton(self) -> Newton:
        return Newton()

    def first(self, interval: float, last: float | None) -> float:
        return self.step

    def next(self, dt: float, error: float, power: float) -> float:
        return self.step

    def accepts(self, error: float) -> bool:
        return True


@dataclass(frozen=True)
class Adaptive:
    """Steps whose estimated local error stays below `tolerance`.

    The error is that of the embedded solution; for backward Euler, the difference to the linear extrapolation, scaled. Root
    mean square per field, relative to the largest change that the field has undergone so far (or a small fraction of its
    natural size).
    """

    tolerance: float = 1e-3
    largest: float = inf  # [s]
    scheme: Scheme = ESDIRK4

    def __post_init__(self) -> None:
        tolerance = checks.positive("Adaptive tolerance", self.tolerance)
        if tolerance > 1:
            raise InputError(f"Adaptive tolerance = {tolerance:g} is above 1: errors are relative to the changes, take 1e-3")
        checks.settle(self, tolerance=tolerance)
        if not (checks.is_number(self.largest) and self.largest == inf):
            checks.settle(self, largest=checks.positive("Adaptive largest", self.largest, "s"))
        check_scheme("Adaptive", self.scheme)

    @property
    def newton(self) -> Newton:
        """Nonlinear solves that add a small part of the tolerance, with few new matrices."""
        if self.scheme.embedded is None:
            return Newton()
        return Newton(tolerance=NEWTON_SHARE * self.tolerance, slowest=SLOWEST)

    def first(self, interval: float, last: float | None) -> float:
        share = 1 / 100 if self.scheme.embedded is None else FIRST * self.tolerance ** (1 / self.scheme.order)
        start = share * interval
        return min(self.largest, start if last is None else min(last, 4 * start))

    def next(self, dt: float, error: float, power: float) -> float:
        safety = 0.8 if self.scheme.embedded else 0.9
        factor = safety * (self.tolerance / error) ** (1 / power) if error > 0 else inf
        if 1 <= factor < 1.2 and self.scheme.embedded:
            factor = 1.0  # keeps the matrix
        return float(min(self.largest, dt * np.clip(factor, 0.2, 3.0)))

    def accepts(self, error: float) -> bool:
        return error <= self.tolerance


def check_scheme(what: str, scheme: object) -> None:
    """Refuse what is no scheme."""
    checks.instance(f"{what}: scheme", scheme, Scheme, "BACKWARD_EULER or ESDIRK4")


NEWTON_SHARE = 3e-3
"""What the nonlinear solves may leave of a time error."""

SLOWEST = 0.3
"""Contraction of the Newton iteration from which on a new matrix is cheaper than more iterations with the old one."""

FIRST = 0.1
"""Measured start after a kink: this share of the interval to the next for a tolerance of one, less by the scheme's order."""

JUMP = 0.8
"""After a kink, a change that a five times smaller step leaves above this share does not come from the time
discretisation: pressure and displacement follow a sudden load at once."""

STUCK, CAREFUL = 0.25, 10
"""A step whose stages of higher order are not found in two attempts, or whose error falls with no more than this power of
the step, is taken with backward Euler, as are so many after it: where contents vanish or rates jump."""

SMALLEST_STEP = 1e-12
"""Steps below this fraction of the interval between two kinks, of the time itself or of 1 s count as none."""


@dataclass
class _History:
    """Largest change of each field so far, and times and states of the last step unless a kink lies between."""

    changes: dict[str, float]
    points: list[tuple[float, NDArray]]

    def forget(self) -> None:
        self.points = []


class Stepper:
    """Time integration of one run: call `advance` until the end; it lands on every time of `stops`."""

    def __init__(self, problem: Problem, control: Control, newton: Newton, solver: LinearSolver) -> None:
        self.problem, self.control, self.newton = problem, control, newton
        self.scheme = control.scheme
        self.solver = solver
        self.history = _History({name: self._change(name) for name in problem.model.evolving}, [])
        self.wanted: float | None = None
        self._careful = 0
        self._work = [problem.fields.vec.CreateVector() for _ in range(2)]
        self._balances = np.zeros(problem.vector.size, dtype=bool)
        for name in problem.model.held.values():
            self._balances[problem.ranges[name]] = True
        self._slope = self._next_slope = self._outflow() if self.scheme.explicit_start else np.zeros(0)

    def memory(self) -> dict[str, NDArray]:
        """All that the next step depends on beside the fields and the scene. Arrays that no step changes, not copies."""
        kept = {f"solver {name}": value for name, value in self.solver.memory().items()}
        kept |= {f"field {number}": values for number, (_, values) in enumerate(self.history.points)}
        if self.wanted is not None:
            kept["wanted"] = np.array(self.wanted)
        return kept | {
            "times": np.array([time for time, _ in self.history.points]),
            "changes": np.array([self.history.changes[name] for name in self.problem.model.evolving]),
            "careful": np.array(self._careful),
            "slope": self._slope,
        }

    def remember(self, memory: dict[str, NDArray], same: bool) -> None:
        """Go on as the stepper that gave `memory`; without `same` method, with what does not depend on it.

        Factorising moves the fields and the clock of the problem, which are put back.
        """
        self.history.changes = dict(zip(self.problem.model.evolving, memory["changes"].tolist(), strict=True))
        if not same:
            return
        self.history.points = [(time, memory[f"field {number}"]) for number, time in enumerate(memory["times"].tolist())]
        self.wanted = float(memory["wanted"]) if "wanted" in memory else None
        self._careful, self._slope = int(memory["careful"]), memory["slope"]
        present = self.problem.snapshot(self.problem.time)
        prefix = "solver "
        of_solver = {name.removeprefix(prefix): value for name, value in memory.items() if name.startswith(prefix)}
        self.solver.remember(self.problem, of_solver)
        self.problem.restore(present)

    def _outflow(self) -> NDArray:
        """R of the balances of contents, at the present fields and time."""
        self.problem.dt.Set(1.0)  # to the last digit, R depends on the step that is divided out
        self.problem.outflow(self._work[0])
        return np.where(self._balances, self._work[0].FV().NumPy(), 0.0)

    def _contents(self) -> NDArray:
        self.problem.contents(self._work[0])
        return self._work[0].FV().NumPy().copy()

    def advance(self, time: float, kinks: list[float], stops: list[float]) -> StepReport:
        """One accepted step from `time`. Raises StepError, with the fields restored, when none succeeds.

        The error estimate forgets its past at `kinks`; `stops` are only landed on. Both are sorted, the end is a kink.
        """
        problem, history = self.problem, self.history
        at_kink, kink = _following(kinks, time)
        to_kink = kink - time
        stop = min(kink, _following(stops, time)[1])
        if same_time(stop, kinks[-1]):  # else nothing would be left to step over
            stop = kinks[-1]
        to_stop = stop - time
        if at_kink or self.wanted is None:
            history.forget()
            self.wanted = self.control.first(to_kink, self.wanted)
        old = problem.vector.copy()
        rejected: list[str] = []
        last: tuple[float, float] | None = None  # step and error of the attempt before
        scheme = BACKWARD_EULER if self._careful else self.scheme
        while True:
            dt = _landing(self.wanted, to_stop)
            if same_time(time + dt, stop):  # what would be left is round-off
                dt = to_stop
            end = stop if dt == to_stop else time + dt
            if scheme.embedded:
                outcome, error = self._runge_kutta(scheme, time, end, old)
            else:
                outcome, error = self._backward_euler(time, end, old)
            if outcome.reason is None:
                jumps = not scheme.embedded and not history.points and last is not None and error > JUMP * last[1]
                if self.control.accepts(error) or jumps:
                    break
                reason, (field, where) = f"error {error:.2g}", problem.worst(problem.vector - old)
                remedy = "Remedies: a larger tolerance, a gentler ramp, a finer mesh where the field is worst."
                power = scheme.power if last is None else np.log(last[1] / error) / np.log(last[0] / dt)
                stuck = power < STUCK
                last = dt, error
                self.wanted = self.control.next(dt, error, np.clip(power, 1, scheme.power))
            else:
                reason, field, where, remedy = outcome.reason, outcome.field, outcome.where, outcome.remedy
                stuck = bool(rejected)
                self.wanted = dt / 4
            rejected.append(f"dt = {dt:.3g} s: {reason}")
            if len(rejected) == 1:
                tried = dt
            elif scheme.embedded and stuck:
                scheme, last, self.wanted, self._careful = BACKWARD_EULER, None, tried, CAREFUL
            problem.vector[:] = old
            problem.set_time(time)
            if self.wanted < resolution(to_kink, time):
                reason, remedy = self._explained(reason, remedy, time, tried, kinks[-1] - kinks[0])
                raise StepError(time, dt, field, where, reason, remedy)
        self._slope = self._next_slope
        self._careful = max(0, self._careful - 1)
        history.points = [(at, values) for _, at, values in self.problem.stages]
        if not scheme.explicit_start:
            history.points.insert(0, (time, old))
        for name in problem.model.evolving:
            history.changes[name] = max(self._change(name), self._change_so_far(name))
        landed_short = dt < 0.999 * self.wanted
        proposed = self.control.next(dt, error, scheme.power)
        self.wanted = max(self.wanted, proposed) if landed_short else proposed
        return StepReport(end, dt, outcome.iterations, tuple(rejected), error)

    def _explained(self, reason: str, remedy: str, time: float, dt: float, duration: float) -> tuple[str, str]:
        """Reason and remedy of a failure, with what the state itself says: singular, or unstable within the `duration`."""
        problem = self.problem
        lagged = any(isinstance(problem.scene.treatment(bath), Lagged) for bath in problem.scene.baths)
        if lagged or not self.solver.direct:
            return reason, remedy  # such a state has its own map, or is too large for a factorisation
        old = problem.vector.copy()
        problem.begin_step(time + dt, dt)
        found = singular_mode(problem)
        problem.vector[:] = old
        problem.set_time(time)
        if found and (remedy == LOST or "in a mode" not in found):  # without fluid, a cell's ions are undetermined too
            return f"the linear system is singular: {found}", UNDETERMINED
        try:
            unstable = Perturbations(problem).fastest(1 / duration)
        except NgswellError:
            return reason, remedy
        return (f"{reason}; the state is unstable: {unstable}", REMEDY) if unstable else (reason, remedy)

    def _solve(self, dt: float) -> Outcome:
        """The nonlinear system of a stage whose step of backward Euler is `dt`."""
        change = abs(1 - dt / self.solver.factorised.dt) if self.solver.factorised else inf
        if change > SLOWEST:
            self.solver.ready = False
        elif self.solver.contraction is not None:
            self.solver.contraction = max(self.solver.contraction, change)
        return self.newton.solve(self.problem, self.solver)

    def _backward_euler(self, time: float, end: float, old: NDArray) -> tuple[Outcome, float]:
        """One step and its error, by extrapolation from the step before: see `_error`."""
        problem, dt = self.problem, end - time
        contents = self._contents() if self.scheme.explicit_start else None
        guess = polynomial_at(self.history.points[-2:], end) if self.history.points else None
        problem.begin_step(end, dt, guess)
        outcome = self._solve(dt)
        if outcome.reason and guess is not None:  # the extrapolation may be what is inadmissible
            problem.vector[:] = old
            problem.set_time(time)  # the old contents are those of the old charge
            problem.begin_step(end, dt)
            outcome = self._solve(dt)
        problem.stages = [(dt, end, problem.vector.copy())]
        if contents is not None:
            self._next_slope = (contents - self._contents()) / dt
        return outcome, self._error(old, guess, dt) if outcome.reason is None else inf

    def _runge_kutta(self, scheme: Scheme, time: float, end: float, old: NDArray) -> tuple[Outcome, float]:
        """The stages of one step, and its error by the embedded solution.

        Stage i solves S(x_i) + γ Δt R(x_i) = S(x_old) − Δt Σ_{j<i} a_ij R_j; R_j is what that stage's contents tell.
        The estimate, a defect of contents, becomes one of the fields by the stages' matrix, which damps what is stiff.
        """
        problem, dt = self.problem, end - time
        inner = scheme.diagonal * dt
        contents = self._contents()
        slopes: list[NDArray] = [self._slope]
        problem.stages = [(scheme.weights[0] * dt, time, old)]
        points = [*self.history.points[:-1], (time, old)]
        iterations = 0
        for row, share, weight in list(zip(scheme.rows, scheme.times, scheme.weights, strict=True))[1:]:
            at = end if share == 1.0 else time + share * dt
            start = contents - dt * (np.array(row[:-1]) @ np.array(slopes))
            guess = polynomial_at(sorted(points, key=lambda point: abs(point[0] - at))[:3], at)
            problem.begin_stage(at, inner, start, guess)
            outcome = self._solve(inner)
            if outcome.reason:
                problem.begin_stage(at, inner, start, old)
                outcome = self._solve(inner)
            iterations += outcome.iterations
            if outcome.reason:
                return outcome, inf
            slopes.append((start - self._contents()) / inner)
            points.append((at, problem.vector.copy()))
            problem.stages.append((weight * dt, at, points[-1][1]))
        self._next_slope = slopes[-1]
        right, error = self._work
        right.FV().NumPy()[:] = scheme.difference @ np.array(slopes) / scheme.diagonal
        if not self.solver.solve(right, error):
            return Outcome(iterations, "the estimated error is not finite", *problem.worst(problem.vector - old), LOST), inf
        return Outcome(iterations), self._relative(error.FV().NumPy())

    def _relative(self, difference: NDArray) -> float:
        return max(_rms(difference[self.problem.ranges[n]]) / self._change_so_far(n) for n in self.problem.model.evolving)

    def _error(self, old: NDArray, guess: NDArray | None, dt: float) -> float:
        """Local error of the step, relative to the largest change of each field so far.

        With x″ from the extrapolation over the step before, x_new − x_guess = Δt (2Δt + Δt_old)/2 x″ while the
        error is Δt²/2 x″. Without a step before, the guess is the old state (x′ = 0 before a kink).
        """
        predicted = old if guess is None else guess
        past = self.history.points[-1][0] - self.history.points[-2][0] if guess is not None else 0.0
        return dt / (2 * dt + past) * self._relative(self.problem.vector - predicted)

    def _change(self, name: str) -> float:
        part = self.problem.ranges[name]
        return _rms(self.problem.vector[part] - self.problem.initial[part])

    def _change_so_far(self, name: str) -> float:
        floor = self.problem.model.evolving[name] * self.problem.references[name]
        return max(floor, self.history.changes[name])


def polynomial_at(points: Sequence[tuple[float, NDArray]], time: float) -> NDArray:
    """The polynomial through (time, value) points, at `time`; values are numbers or arrays."""
    times = np.array([at for at, _ in points])
    weights = [np.prod([(time - other) / (at - other) for other in times if other != at]) for at in times]
    return np.array(weights) @ np.array([values for _, values in points])


def _rms(values: NDArray) -> float:
    return float(np.sqrt(np.mean(values * values)))


def resolution(*times: float) -> float:
    """What the clock tells apart at these times [s]."""
    return SMALLEST_STEP * max(1.0, *map(abs, times))


def same_time(a: float, b: float) -> bool:
    """Whether two times [s] differ by round-off only."""
    return abs(a - b) <= resolution(a, b)


def _following(times: Sequence[float], time: float) -> tuple[bool, float]:
    """Whether `time` is one of the sorted `times`, and the one that follows it."""
    first = last = bisect_left(times, time)
    while first > 0 and same_time(times[first - 1], time):
        first -= 1
    while last < len(times) and same_time(times[last], time):
        last += 1
    return first < last, times[last] if last < len(times) else inf


def _landing(wanted: float, remaining: float) -> float:
    """The step to take: all that remains, half of it where that avoids a sliver, or what is wanted."""
    if wanted >= 0.9999 * remaining:
        return remaining
    return remaining / 2 if wanted > remaining / 2 else wanted
