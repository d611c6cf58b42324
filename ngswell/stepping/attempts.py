"""One attempt at a step: the stages of a scheme, and the difference that its error is the size of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ngswell.errors import Failure, Reason
from ngswell.problem.problem import Problem
from ngswell.setup.snapshot import Snapshot
from ngswell.solve.factorisation import Factorisation
from ngswell.solve.newton import DampedNewton, Outcome
from ngswell.stepping.schemes import Scheme
from ngswell.stepping.sizes import Sizes
from ngswell.stepping.steps import Stage

SETTLING = DampedNewton(tolerance=1e-10)
"""For what happens at once."""

ROUGH = DampedNewton(tolerance=0.1, most_iterations=8, slowest=0.5)
"""For what is only to be known by its size."""

NEAREST = 5
"""Points that a stage starts from: with a parabola near five of them, solves take 7 % less iterations than through three."""

Points = list[tuple[float, NDArray]]
"""Times [s] and states."""


@dataclass(frozen=True)
class Attempt:
    """What an attempt gave: its stages and `factor` times a `difference` of states as its error, or why it failed.

    `slope` is what the contents fall by in unit time at the end of the step, where the scheme needs it.
    """

    iterations: int
    failure: Failure | None = None
    stages: tuple[Stage, ...] = ()
    difference: NDArray | None = None
    factor: float = 1.0
    slope: NDArray | None = None


class Attempts:
    """Takes steps of a problem from an accepted state. With `with_slopes`, also those of backward Euler tell the slope that
    the next step of a scheme with an explicit start begins with."""

    def __init__(
        self, problem: Problem, newton: DampedNewton, factorisation: Factorisation, with_slopes: bool, sizes: Sizes | None
    ) -> None:
        self.problem, self.newton, self.factorisation, self.with_slopes = problem, newton, factorisation, with_slopes
        self.sizes = sizes  # None: Newton's method takes natural ones
        self._work = [problem.fields.vec.CreateVector() for _ in range(2)]

    def first_slope(self) -> NDArray:
        """R of the balances of contents, at the present fields and time; empty if it is not needed."""
        if not self.with_slopes:
            return np.zeros(0)
        problem = self.problem
        problem.dt.Set(1.0)  # to the last digit, R depends on the step that is divided out
        problem.outflow(self._work[0])
        slope = np.zeros(problem.vector.size)
        for name in (*problem.model.balanced.values(), *problem.numbers):
            slope[problem.ranges[name]] = self._work[0].FV().NumPy()[problem.ranges[name]]
        return slope

    def take(self, scheme: Scheme, start: Snapshot, past: Points, slope: NDArray, end: float, lumped: bool) -> Attempt:
        """From `start`, which the fields hold, to `end` [s], with contents `lumped` or not.

        `past` are the points of the step before, if any.
        """
        contents = self.problem.carried(lumped)
        if scheme.embedded:
            slope = self.problem.held(slope)
            return self._runge_kutta(scheme, start, past, contents, slope, end)
        return self._backward_euler(start, past, contents, end)

    def settle(self, start: Snapshot, dt: float) -> Attempt:
        """A step of backward Euler `dt` so short that it only takes what loads and baths change at once.

        Solved to round-off: contents differ by little, and their balance is to close. The slope is R itself.
        """
        self.problem.begin_step(start.time + dt, dt)
        outcome = SETTLING.solve(self.problem, self.factorisation)
        if outcome.failure:
            return Attempt(outcome.iterations, outcome.failure)
        values = self.problem.vector.copy()
        stages = (Stage(0.0, start.time, start.values), Stage(dt, start.time + dt, values))
        return Attempt(outcome.iterations, None, stages, values - start.values, 1.0, self.first_slope())

    def expected(self, start: Snapshot, end: float) -> NDArray | None:
        """About the state at `end` [s], by one step of backward Euler, or none; the fields are left as they were."""
        self.problem.begin_step(end, end - start.time)
        self.factorisation.prepare(self.problem, end - start.time)
        outcome = ROUGH.solve(self.problem, self.factorisation, dict.fromkeys(self.problem.names, 1.0))
        values = None if outcome.failure else self.problem.vector.copy()
        self.problem.restore(start)
        return values

    def _solve(self, dt: float) -> Outcome:
        """The nonlinear system of a stage whose step of backward Euler is `dt`."""
        self.factorisation.prepare(self.problem, dt)
        return self.newton.solve(self.problem, self.factorisation, self._shares())

    def _shares(self) -> dict[str, float] | None:
        return self.sizes.shares() if self.sizes else None

    @property
    def _from_above(self) -> bool:
        """Whether a third start may help."""
        return self.problem.storage.is_lumped and bool(self.problem.model.positive)

    def _solve_from_above(self, dt: float, old: NDArray) -> Outcome:
        """The same from the `old` state with the salt of the baths, which finds what comes after next to nothing."""
        self.problem.vector[:] = self.problem.from_above(old)
        self.factorisation.prepare(self.problem, dt)
        return self.newton.solve_from_above(self.problem, self.factorisation, self._shares())

    def _contents(self) -> NDArray:
        self.problem.contents(self._work[0])
        return self._work[0].FV().NumPy().copy()

    def _backward_euler(self, start: Snapshot, past: Points, contents: NDArray, end: float) -> Attempt:
        """One step and its local error, by extrapolation from the step before.

        With x″ from the extrapolation over the step before, x_new − x_guess = Δt (2Δt + Δt_old)/2 x″ while the
        error is Δt²/2 x″. Without a step before, the guess is the old state (x′ = 0 before a kink).
        """
        problem, dt = self.problem, end - start.time
        guess = polynomial_at(past[-2:], end) if past else None
        problem.begin_step(end, dt, guess, old_contents=contents)
        outcome = self._solve(dt)
        if outcome.failure and guess is not None:  # the extrapolation may be what is inadmissible
            problem.restore(start)
            problem.begin_step(end, dt, old_contents=contents)
            outcome = self._solve(dt)
        if outcome.failure and self._from_above:
            outcome = self._solve_from_above(dt, start.values)
        if outcome.failure:
            return Attempt(outcome.iterations, outcome.failure)
        slope = (contents - self._contents()) / dt if self.with_slopes or problem.storage.is_lumped else None
        before = past[-1][0] - past[-2][0] if guess is not None else 0.0
        difference = problem.vector - (start.values if guess is None else guess)
        stages = (Stage(0.0, start.time, start.values), Stage(dt, end, problem.vector.copy()))
        return Attempt(outcome.iterations, None, stages, difference, dt / (2 * dt + before), slope)

    def _runge_kutta(
        self, scheme: Scheme, start: Snapshot, past: Points, contents: NDArray, slope: NDArray, end: float
    ) -> Attempt:
        """The stages of one step, and its error by the embedded solution.

        Stage i solves S(x_i) + γ Δt R(x_i) = S(x_old) − Δt Σ_{j<i} a_ij R_j; R_j is what that stage's contents tell.
        The estimate, a defect of contents, becomes one of the fields by the stages' matrix, which damps what is stiff.
        """
        problem, (time, old) = self.problem, (start.time, start.values)
        dt = end - time
        slopes: list[NDArray] = [slope]
        stages = [Stage(scheme.weights[0] * dt, time, old)]
        points = [*past[:-1], (time, old)]
        iterations = 0
        for row, share, weight in list(zip(scheme.rows, scheme.times, scheme.weights, strict=True))[1:]:
            at = end if share == 1.0 else time + share * dt
            right = contents - dt * (np.array(row[:-1]) @ np.array(slopes))
            outcome = self._stage(at, scheme.diagonal * dt, right, points, old)
            iterations += outcome.iterations
            if outcome.failure:
                return Attempt(outcome.iterations, outcome.failure)
            slopes.append((right - self._contents()) / (scheme.diagonal * dt))
            points.append((at, problem.vector.copy()))
            stages.append(Stage(weight * dt, at, points[-1][1]))
        defect, error = self._work
        defect.FV().NumPy()[:] = scheme.difference @ np.array(slopes) / scheme.diagonal
        if not self.factorisation.solve(defect, error):
            failure = Failure(Reason.ESTIMATE_NOT_FINITE, *problem.worst(problem.vector - old))
            return Attempt(iterations, failure)
        return Attempt(iterations, None, tuple(stages), error.FV().NumPy().copy(), slope=slopes[-1])

    def _stage(self, at: float, inner: float, right: NDArray, points: Points, old: NDArray) -> Outcome:
        """Solve one stage, from the extrapolation of the nearest points or else from the old state."""
        guess = parabola_at(sorted(points, key=lambda point: abs(point[0] - at))[:NEAREST], at)
        self.problem.begin_stage(at, inner, right, guess)
        outcome = self._solve(inner)
        if outcome.failure and len(points) > 1:  # else the old state is what it started from
            self.problem.begin_stage(at, inner, right, old)
            outcome = self._solve(inner)
        if outcome.failure and self._from_above:
            outcome = self._solve_from_above(inner, old)
        return outcome


def polynomial_at(points: Sequence[tuple[float, NDArray]], time: float) -> NDArray:
    """The polynomial through (time, value) points, at `time`; values are numbers or arrays."""
    times = np.array([at for at, _ in points])
    weights = [np.prod([(time - other) / (at - other) for other in times if other != at]) for at in times]
    return np.array(weights) @ np.array([values for _, values in points])


def parabola_at(points: Sequence[tuple[float, NDArray]], time: float) -> NDArray:
    """The parabola of least squares near (time, value) points, at `time`; through one or two, the constant or the line."""
    distances = np.array([at for at, _ in points]) - time
    powers = np.arange(min(3, len(points)))[:, None]
    weights = np.linalg.lstsq((distances / np.abs(distances).max()) ** powers, np.eye(len(powers))[0], rcond=None)[0]
    return weights @ np.array([values for _, values in points])
