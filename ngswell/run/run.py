"""A run: the loop over accepted steps, what goes into it and what comes out."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager, nullcontext
from pathlib import Path
from time import perf_counter
from typing import Any

from threadpoolctl import threadpool_limits

from ngswell import checks
from ngswell.analysis.diagnosis import explain
from ngswell.analysis.overlap import OverlapWatch
from ngswell.calls import in_turn
from ngswell.errors import InstabilityError, StepError
from ngswell.observers.base import Observer
from ngswell.problem.problem import Problem
from ngswell.run.checkpoint import Checkpoint
from ngswell.run.digest import setup_digest
from ngswell.run.guard import Guard
from ngswell.run.log import StepLog
from ngswell.run.method import Method
from ngswell.run.restart import Restart, versions
from ngswell.run.result import Result
from ngswell.run.signals import Signals, Stopped
from ngswell.run.start import Start
from ngswell.run.threads import threads_for
from ngswell.run.watch import Watch
from ngswell.setup.setup import Setup
from ngswell.setup.snapshot import Snapshot
from ngswell.solve.choice import solver_of
from ngswell.solve.direct import LinearSolver
from ngswell.solve.newton import DampedNewton
from ngswell.stepping.stepper import Failed, Stepper
from ngswell.stepping.steps import Control
from ngswell.streams import CSV
from ngswell.team import team_of


@in_turn
def run(
    setup: Setup,
    until: float,
    steps: Control | None = None,
    observers: Sequence[Observer | Callable[[float, Any], object]] = (),
    newton: DampedNewton | None = None,
    resume: Snapshot | Restart | None = None,
    solver: Callable[[Problem], LinearSolver] = solver_of,
    checkpoint: Checkpoint | None = None,
    unstable: str = "warn",
    log: str | Path | CSV | None = None,
) -> Result:
    """The run that `Scene.run` describes."""
    method = Method.checked(setup, steps, newton, solver, unstable)
    watch = Watch(observers)
    setup.check_unchanged()
    if checkpoint is not None:
        checks.instance("checkpoint", checkpoint, Checkpoint, "a Checkpoint(path)")
    steps_taken = StepLog(log)
    team = team_of(setup.ranks)
    with nullcontext() if checkpoint is None else checkpoint.alone(team), closing(steps_taken), team.settled():
        return _run(setup, until, method, watch, resume, checkpoint, steps_taken)


def _run(
    setup: Setup,
    until: float,
    method: Method,
    watch: Watch,
    resume: Snapshot | Restart | None,
    checkpoint: Checkpoint | None,
    steps: StepLog,
) -> Result:
    start = Start.checked(setup, until, resume, checkpoint, watch)
    method.check_first_step(start.begin, start.until)
    timetable, problem = start.timetable(setup, watch, checkpoint), Problem(setup)
    start.apply(problem)
    with _settings(problem), Signals(checkpoint is not None, problem.team) as signals, watch:
        watch.start(problem, start.begin, start.time, start.until, start.remembered)
        steps.begin(*start.logged, problem.team)
        stepper = method.stepper(problem, timetable, start.restart)
        guard = Guard(method.unstable, watch, problem, stepper.factorisation.solver, timetable.duration)
        overlaps = OverlapWatch(problem)
        log = _Log(start, method, stepper, watch, setup_digest(setup) if checkpoint else {}, steps)
        if checkpoint:
            checkpoint.save(log.restart)
        try:
            with problem.team.settled():
                for step in signals.until_received(stepper):
                    steps.append(step.report())
                    watch.observe(step)
                    guard.after_step(step.time, timetable.is_kink(step.time) and step.time < timetable.end)
                    overlaps.after_step(stepper.accepted, stepper.factorisation.solver.solves)
                    if checkpoint:
                        checkpoint.after(step.time, log.restart)
        except BaseException as error:
            problem.restore(stepper.accepted)
            if checkpoint and (signals.stepping or isinstance(error, InstabilityError)):  # observers agree on the last step
                checkpoint.save(log.restart)
            if isinstance(error, Failed):
                overlaps.look(stepper.accepted)
                raise _step_error(error, problem, stepper, start) from None
            if isinstance(error, StepError):
                error.end = stepper.accepted
            if not isinstance(error, Stopped):
                raise
        else:
            if checkpoint:
                checkpoint.save(log.restart)
            if not signals.came():
                guard.at_end(stepper.accepted.time)
    overlaps.look(stepper.accepted)
    signals.end(stepper.accepted.time, checkpoint.path if checkpoint else None)
    return log.result(setup)


@contextmanager
def _settings(problem: Problem) -> Iterator[None]:
    """The threads that suit a problem; BLAS, which NGSolve calls from them, takes one."""
    with threads_for(problem), threadpool_limits(1, user_api="blas"):
        yield


def _step_error(failed: Failed, problem: Problem, stepper: Stepper, start: Start) -> StepError:
    """A failed step with what the last accepted state says of it, of a run from `start`."""
    cause, first, from_start = None, stepper.accepted.time == start.time, start.snapshot is None
    if stepper.factorisation.solver.direct:  # else too large for a factorisation
        duration = stepper.timetable.duration
        cause = explain(problem, stepper.accepted, failed.tried, failed.failure, duration, first, from_start)
    return StepError(failed.time, failed.dt, failed.failure, cause, end=stepper.accepted)


class _Log:
    """The work of a run so far: what checkpoints write and the result tells."""

    def __init__(
        self, start: Start, method: Method, stepper: Stepper, watch: Watch, digest: dict[str, str], steps: StepLog
    ) -> None:
        earlier = start.restart
        self._start, self._stepper, self._watch, self._digest = start, stepper, watch, digest
        self._method = method.text(stepper.factorisation.solver)
        self._clock = perf_counter() - (0.0 if earlier is None else earlier.seconds)
        self._steps = steps

    def restart(self) -> Restart:
        """The run after its last accepted step."""
        stepper, seconds = self._stepper, perf_counter() - self._clock
        return Restart(
            snapshot=stepper.accepted, begin=self._start.begin, steps=self._steps.kept, log=self._steps.state(),
            seconds=seconds, stepper=stepper.state(), observers=self._watch.state(), method=self._method,
            digest=self._digest, versions=versions(),
        )  # fmt: skip

    def result(self, setup: Setup) -> Result:
        stepper, solver = self._stepper, self._stepper.factorisation.solver
        seconds = perf_counter() - self._clock
        return Result(setup, self._steps, stepper.accepted, seconds, solver.factorisations, solver.solves)
