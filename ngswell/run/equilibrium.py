"""The state of rest, without the transient that leads to it."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from numpy.typing import NDArray

from ngswell import checks
from ngswell.analysis.diagnosis import UNDETERMINED, singular_mode
from ngswell.baths.bath import Frozen, Lagged
from ngswell.errors import InputError, StepError
from ngswell.problem.problem import Problem, Snapshot
from ngswell.schedules import LARGEST
from ngswell.solve.direct import LinearSolver, solver_of
from ngswell.solve.newton import LOST, Newton, Outcome

if TYPE_CHECKING:
    from ngswell.scene import Scene

SMALLEST_SHARE = 1e-4
"""Continuation gives up below this share of the charge."""

STATIONARY = 1e30
"""A time step [s] beyond which contents do not change any more."""

SHORTEST = 1e-12
"""Relaxation gives up below this step [s]."""


def equilibrate(
    scene: Scene,
    time: float | None = None,
    newton: Newton | None = None,
    make_solver: Callable[[Problem], LinearSolver] = solver_of,
) -> Snapshot:
    """The state in which the scene comes to rest when its charge and baths stay as they are at `time` [s] (its start).

    The stationary balances are solved by continuation: from the uncharged body, already loaded, the charge is raised as
    fast as Newton's method follows. Where that ends early, as under a load that only the charged body can bear, the body
    relaxes from its initial state instead, in steps of backward Euler that grow as fast as Newton's method follows. Works
    for fields of position and constrained bodies. Raises InputError for a sealed body (what it holds is not determined by
    balances) and for treatments that remember the past, and StepError when neither way reaches the state of rest; the fields
    then hold the scene's initial state.
    """
    time = scene.start if time is None else checks.number("equilibrate: time", time, "s", -LARGEST, LARGEST)
    if not scene.baths:
        raise InputError("equilibrate: the body is sealed, so its content at rest is not determined; give it a bath")
    for bath in scene.baths:
        if isinstance(scene.treatment(bath), (Lagged, Frozen)):
            raise InputError(f"equilibrate: the bath on {bath.boundary!r} remembers the past ({scene.treatment(bath)})")
    problem, method = scene.problem, newton or Newton()
    solver = make_solver(problem)
    failure = _raise_charge(problem, time, method, solver)
    if failure and _relax(problem, time, method, solver):
        problem.initialise()
        raise failure
    problem.set_time(time)
    return problem.snapshot(time)


def _raise_charge(problem: Problem, time: float, newton: Newton, solver: LinearSolver) -> StepError | None:
    """Continuation from the uncharged body; the fields hold the state of rest unless there is something to raise."""
    problem.initialise(charge_share=0.0)

    def solve(share: float, guess: NDArray) -> Outcome:
        problem.begin_step(time, STATIONARY, guess, charge_share=share)
        return newton.solve(problem, solver)

    outcome = solve(0.0, problem.vector.copy())
    if outcome.reason is not None:
        return _give_up(problem, 0.0, outcome)
    step, reached = 1.0, [(0.0, problem.vector.copy())]
    while reached[-1][0] < 1.0:
        share, state = reached[-1]
        target = min(1.0, share + step)
        guess = state
        if len(reached) > 1:
            earlier, old = reached[-2]
            guess = state + (target - share) / (share - earlier) * (state - old)
        outcome = solve(target, guess)
        if outcome.reason is None:
            reached = [(share, state), (target, problem.vector.copy())]
            step *= 2
            continue
        problem.vector[:] = state
        step /= 4
        if step < SMALLEST_SHARE:
            return _give_up(problem, share, outcome)
    return None


def _relax(problem: Problem, time: float, newton: Newton, solver: LinearSolver) -> bool:
    """From the initial state to rest under what holds at `time`; whether it gives up."""
    problem.initialise()
    step, state = STATIONARY, problem.vector.copy()
    started = False
    while step >= SHORTEST:
        problem.begin_step(time, step)
        if newton.solve(problem, solver).reason is None:
            if step == STATIONARY:
                return False
            started, state = True, problem.vector.copy()
            step = min(10 * step, STATIONARY)
        else:
            problem.vector[:] = state
            step /= 20 if started else 1e3  # 20 undoes the last growth and halves
    return True


def _give_up(problem: Problem, share: float, outcome: Outcome) -> StepError:
    reason, remedy = outcome.reason, outcome.remedy
    found = singular_mode(problem) if remedy == LOST else ""
    if found:
        reason, remedy = f"the linear system is singular: {found}", UNDETERMINED
    reason = f"equilibrate, at {share:.3g} of the charge: {reason}"
    return StepError(problem.scene.start, STATIONARY, outcome.field, outcome.where, reason, remedy)
