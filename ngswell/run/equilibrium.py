"""The state of rest, without the transient that leads to it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from numpy.typing import NDArray

from ngswell import checks
from ngswell.analysis.diagnosis import folded, singular_mode
from ngswell.analysis.overlap import warn_of_overlap
from ngswell.baths.treatment import Charge
from ngswell.calls import in_turn
from ngswell.errors import UNCONVERGED, Failure, InputError, Reason, StepError
from ngswell.observers.base import Observer
from ngswell.problem.problem import Problem
from ngswell.problem.vessels import among_themselves, together
from ngswell.run.guard import Guard
from ngswell.run.watch import Watch
from ngswell.schedules import LARGEST
from ngswell.setup.setup import Setup
from ngswell.setup.snapshot import Snapshot
from ngswell.solve.choice import solver_of
from ngswell.solve.direct import LinearSolver, checked_solver
from ngswell.solve.factorisation import Factorisation
from ngswell.solve.newton import DampedNewton, Outcome

SMALLEST_SHARE = 1e-4
"""Continuation gives up below this share of the charge."""

STATIONARY = 1e30
"""A time step [s] beyond which contents do not change any more."""

LONGEST, SHORTEST = 1e12, 1e-12
"""Steps [s] that relaxation tries where the stationary balances are not solved at once."""

SHRUNK = 1e-6
"""Relaxation gives up when its steps have fallen below this share of the longest that succeeded."""

DRY = 1e-6
"""Fluid volume per reference volume below which nothing flows any more: every pressure would be at rest there."""

MOST_STEPS = 300
"""Steps that relaxation tries. To rest it takes some 30 to 60; without a state of rest it might creep on for ever."""


@in_turn
def equilibrate(
    setup: Setup,
    time: float | None = None,
    newton: DampedNewton | None = None,
    solver: Callable[[Problem], LinearSolver] = solver_of,
    observers: Sequence[Observer | Callable[[float, Any], object]] = (),
    unstable: str = "warn",
) -> Snapshot:
    """The state in which the setup comes to rest when its charge and baths stay as they are at `time` [s] (its start).

    The stationary balances are solved by continuation: from the uncharged body, already loaded, the charge is raised as
    fast as Newton's method follows. Where that ends early, as under a load that only the charged body can bear, the body
    relaxes from its initial state instead, in steps of backward Euler that grow as fast as Newton's method follows. Works
    for fields of position and constrained bodies. A bath in a vessel comes to rest with what it and the body hold
    together at the start. A body squeezed dry, where nothing flows any more, is not at rest.
    `observers` record the state of rest. Raises InputError for a sealed body
    (what it holds is not determined by balances) and for treatments that remember the past, and StepError when neither way
    reaches the state of rest; `end` of the error is the initial state.
    """
    Guard.check("equilibrate", unstable)
    time = setup.start if time is None else checks.number("equilibrate: time", time, "s", -LARGEST, LARGEST)
    if not setup.baths:
        raise InputError("equilibrate: the body is sealed, so its content at rest is not determined; give it a bath")
    for bath, treatment in setup.prescribed_baths:
        if treatment.charge_of is not Charge.PRESENT:
            raise InputError(f"equilibrate: the bath on {bath.boundary!r} remembers the past ({treatment})")
    setup.check_unchanged()
    watch, problem, method = Watch(observers), Problem(setup), newton or DampedNewton()
    watch.plan(time, time)
    solved = _with_sums(problem)
    rest = _Rest(solved, time, method, Factorisation(checked_solver(solver, solved), method.slowest))
    failed = rest.raise_charge()
    if failed is not None and not rest.relax():
        raise failed
    problem.restore(solved.snapshot(time))
    with watch:
        watch.start(problem, time, time, time)
    solved.set_time(time)
    Guard(unstable, watch, solved, rest.factorisation.solver, LONGEST).at_end(time)
    rested = problem.snapshot(time)
    warn_of_overlap(problem, rested)
    return rested


def _with_sums(problem: Problem) -> Problem:
    """The problem, or where a bath is in a vessel one in which gel and bath hold together what they hold at the start.

    Refuses vessels whose state of rest more decides than these sums.
    """
    setup = problem.setup
    vessels = [bath for bath in setup.baths if bath.vessel is not None]
    if not vessels:
        return problem
    if not among_themselves(problem) or any(bath.vessel.fed for bath in vessels if bath.vessel):
        raise InputError(
            f"equilibrate: the bath on {vessels[0].boundary!r} is in a vessel, and other baths, what is let in or out or a "
            "load that drives flow change what it ends with on the way: run until it rests"
        )
    problem.initialise()
    if setup.origin is not None:
        problem.restore(setup.origin)
    return Problem(setup, together(problem))


class _Rest:
    """The two ways to the state of rest at a time."""

    def __init__(self, problem: Problem, time: float, newton: DampedNewton, factorisation: Factorisation) -> None:
        self.problem, self.time, self.newton, self.factorisation = problem, time, newton, factorisation

    def raise_charge(self) -> StepError | None:
        """Continuation from the uncharged body. The fields then hold the state of rest; otherwise, why they do not."""
        problem = self.problem
        problem.initialise(charge_share=0.0)
        outcome = self._at_share(0.0, problem.vector.copy())
        if outcome.failure is not None:
            return self._failed(0.0, outcome.failure)
        step, reached = 1.0, [(0.0, problem.vector.copy())]
        while reached[-1][0] < 1.0:
            share, state = reached[-1]
            target = min(1.0, share + step)
            guess = state
            if len(reached) > 1:
                earlier, old = reached[-2]
                guess = state + (target - share) / (share - earlier) * (state - old)
            outcome = self._at_share(target, guess, state)
            if outcome.failure is None:
                reached = [(share, state), (target, problem.vector.copy())]
                step *= 2
                continue
            problem.vector[:] = state
            step /= 4
            if step < SMALLEST_SHARE:
                return self._failed(share, outcome.failure)
        return None

    def relax(self) -> bool:
        """From the initial state to rest under what holds at the time; whether it is reached."""
        problem = self.problem
        problem.initialise()
        step, state, longest = STATIONARY, problem.vector.copy(), 0.0
        for _ in range(MOST_STEPS):
            if step < max(SHORTEST, SHRUNK * longest):
                break
            problem.begin_step(self.time, step)
            if self.newton.solve(problem, self.factorisation).failure is None:
                if step == STATIONARY:
                    return problem.admissible.least_content() > DRY
                longest, state = max(longest, step), problem.vector.copy()
                step = 10 * step if step < LONGEST else STATIONARY
            else:
                problem.vector[:] = state
                step = min(LONGEST, step / (20 if longest else 1e3))  # 20 undoes the last growth and halves
        return False

    def _at_share(self, share: float, *guesses: NDArray) -> Outcome:
        """The state of rest at a share of the charge, from the first of the guesses that is admissible."""
        for guess in guesses:
            self.problem.begin_step(self.time, STATIONARY, guess, charge_share=share)
            outcome = self.newton.solve(self.problem, self.factorisation)
            if outcome.failure is None or outcome.failure.reason is not Reason.NOT_ADMISSIBLE_AT_START:
                break
        return outcome

    def _failed(self, share: float, failure: Failure) -> StepError:
        found = singular_mode(self.problem) if failure.reason in UNCONVERGED else None
        cause = folded(self.problem) if found is None else found.failure
        self.problem.initialise()
        start = self.problem.setup.start
        opening = f"equilibrate finds no state of rest, at {share:.3g} of the charge"
        return StepError(start, STATIONARY, failure, cause, opening, end=self.problem.snapshot(start))
