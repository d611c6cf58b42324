"""A run: the loop over accepted steps, what goes into it and what comes out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from time import perf_counter
from typing import Any

from ngsolve import TaskManager
from threadpoolctl import threadpool_limits

from ngswell import checks
from ngswell.analysis.diagnosis import explain
from ngswell.analysis.overlap import warn_of_overlap
from ngswell.baths.treatment import Charge
from ngswell.errors import InputError, InstabilityError, StepError
from ngswell.observers.base import Observer
from ngswell.problem.problem import Problem
from ngswell.run.checkpoint import Checkpoint
from ngswell.run.digest import canonical_text, setup_digest
from ngswell.run.guard import Guard
from ngswell.run.restart import Restart, versions
from ngswell.run.result import Result
from ngswell.run.signals import Signals, Stopped
from ngswell.run.watch import Watch
from ngswell.schedules import LARGEST
from ngswell.setup.setup import Setup
from ngswell.setup.snapshot import Snapshot
from ngswell.solve.direct import LinearSolver, solver_of
from ngswell.solve.newton import DampedNewton
from ngswell.stepping.schemes import BACKWARD_EULER
from ngswell.stepping.stepper import Failed, Stepper
from ngswell.stepping.steps import Adaptive, Control, StepReport
from ngswell.stepping.timetable import Timetable, resolution, same_time


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
) -> Result:
    """The run that `Scene.run` describes."""
    method = _Method.checked(setup, steps, newton, solver, unstable)
    watch = Watch(observers)
    setup.check_unchanged()
    if checkpoint is not None:
        checks.instance("checkpoint", checkpoint, Checkpoint, "a Checkpoint(path)")
    with nullcontext() if checkpoint is None else checkpoint.alone():
        return _run(setup, until, method, watch, resume, checkpoint)


def _run(
    setup: Setup,
    until: float,
    method: _Method,
    watch: Watch,
    resume: Snapshot | Restart | None,
    checkpoint: Checkpoint | None,
) -> Result:
    start = _Start.checked(setup, until, resume, checkpoint, watch)
    method.check_first_step(start.begin, start.until)
    timetable, problem = start.timetable(setup, watch, checkpoint), Problem(setup)
    start.apply(problem)
    with TaskManager(), threadpool_limits(1, user_api="blas"), Signals(checkpoint is not None) as signals, watch:
        watch.start(problem, start.begin, start.time, start.until, start.remembered)
        stepper = method.stepper(problem, timetable, start.restart)
        guard = Guard(unstable, watch, problem, stepper.factorisation.solver, timetable.duration)
        log = _Log(start, method, stepper, watch, setup_digest(setup) if checkpoint else {})
        if checkpoint:
            checkpoint.save(log.restart)
        try:
            for step in signals.until_received(stepper):
                log.reports.append(step.report())
                watch.observe(step)
                guard.after_step(step.time)
                if checkpoint:
                    checkpoint.after(step.time, log.restart)
        except BaseException as error:
            problem.restore(stepper.accepted)
            if checkpoint and (signals.stepping or isinstance(error, InstabilityError)):  # observers agree on the last step
                checkpoint.save(log.restart)
            if isinstance(error, Failed):
                raise _step_error(error, problem, stepper) from None
            if isinstance(error, StepError):
                error.end = stepper.accepted
            if not isinstance(error, Stopped):
                raise
        else:
            if checkpoint:
                checkpoint.save(log.restart)
            if signals.received is None:
                guard.at_end(stepper.accepted.time)
    warn_of_overlap(problem, stepper.accepted)
    signals.end(stepper.accepted.time, checkpoint.path if checkpoint else None)
    return log.result(setup)


def _step_error(failed: Failed, problem: Problem, stepper: Stepper) -> StepError:
    """A failed step with what the last accepted state says of it."""
    cause = None
    if stepper.factorisation.solver.direct:  # else too large for a factorisation
        cause = explain(problem, stepper.accepted, failed.tried, failed.failure, stepper.timetable.duration)
    return StepError(failed.time, failed.dt, failed.failure, cause, end=stepper.accepted)


@dataclass(frozen=True)
class _Method:
    """How a run is computed."""

    control: Control
    newton: DampedNewton
    make_solver: Callable[[Problem], LinearSolver]

    @classmethod
    def checked(
        cls,
        setup: Setup,
        steps: Control | None,
        newton: DampedNewton | None,
        solver: Callable[[Problem], LinearSolver],
        unstable: str,
    ) -> _Method:
        Guard.check("run", unstable)
        control = Adaptive() if steps is None else steps
        checks.instance("steps", control, Control, "Adaptive(tolerance) or Fixed(step)")
        if newton is not None:
            checks.instance("newton", newton, DampedNewton, "a DampedNewton(...) of ngswell")
        if not callable(solver):
            made = "make a linear solver of a problem, such as TwoLevelSolver"
            raise InputError(f"solver has to {made}, got {checks.short(solver)}")
        for bath, treatment in setup.prescribed_baths:
            if treatment.charge_of is Charge.LAST_STEP and control.scheme is not BACKWARD_EULER:
                raise InputError(
                    f"bath on {bath.boundary!r}, {treatment}: that is a condition of backward Euler, not of "
                    f"{control.scheme}; run with steps={type(control).__name__}(..., scheme=BACKWARD_EULER)"
                )
        return cls(control, newton or control.newton, solver)

    def check_first_step(self, begin: float, until: float) -> None:
        """Refuse a control whose first step the clock does not tell apart."""
        first = self.control.first(until - begin, None)
        if first < resolution(until - begin, begin, until):
            raise InputError(
                f"steps: {self.control} starts with {first:g} s, which is lost in the round-off of a run from {begin:g} to "
                f"{until:g} s; take longer steps or a larger tolerance"
            )

    def stepper(self, problem: Problem, timetable: Timetable, earlier: Restart | None) -> Stepper:
        """The steps from the present fields, as those of the `earlier` part go on."""
        solver = self.make_solver(problem)
        checks.instance("what solver makes", solver, LinearSolver, "a LinearSolver, as TwoLevelSolver")
        stepper = Stepper(problem, timetable, self.control, solver, self.newton)
        if earlier is not None:
            stepper.restore(earlier.stepper, same=earlier.method == self.text(solver))
        return stepper

    def text(self, solver: LinearSolver) -> str:
        """What tells it from another method, in every process."""
        return canonical_text((self.control, self.newton, type(solver).__name__, solver.name))


@dataclass(frozen=True)
class _Start:
    """Where a run starts: at the setup's start, from a snapshot, or in the midst of an earlier run."""

    begin: float  # of the whole run [s]
    time: float  # from where it is computed now [s]
    until: float
    snapshot: Snapshot | None
    restart: Restart | None

    @classmethod
    def checked(
        cls,
        setup: Setup,
        until: float,
        resume: Snapshot | Restart | None,
        checkpoint: Checkpoint | None,
        watch: Watch,
    ) -> _Start:
        if resume is not None:
            what = "a snapshot, such as `end` of an earlier result, or what read_checkpoint gives"
            checks.instance("resume", resume, (Snapshot, Restart), what)
        if checkpoint is not None:
            kept = checkpoint.read()
            resume = kept if resume is None else resume
        restart = resume if isinstance(resume, Restart) else None
        snapshot = resume.snapshot if isinstance(resume, Restart) else resume or setup.origin
        time = setup.start if snapshot is None else snapshot.time
        begin = time if restart is None else restart.begin
        until = checks.number("until", until, "s", -LARGEST, LARGEST)
        if not begin < until or same_time(begin, until):
            raise InputError(f"until = {until:.17g} s is not a time after the start at {begin:.17g} s")
        if not time <= until:
            raise InputError(f"until = {until:g} s is before the checkpoint, {time:g} s")
        if checkpoint is not None:
            checkpoint.check(restart)
        if restart is not None:
            restart.check(setup, watch.observers)
        return cls(begin, time, until, snapshot, restart)

    def timetable(self, setup: Setup, watch: Watch, checkpoint: Checkpoint | None) -> Timetable:
        """What the steps have to land on."""
        span = self.begin, self.until
        stops = [*watch.plan(*span), *(checkpoint.plan(*span) if checkpoint else ())]
        return Timetable.of(*span, [kink for history in setup.schedules for kink in history.kinks], stops)

    @property
    def remembered(self) -> tuple:
        return () if self.restart is None else self.restart.observers

    def apply(self, problem: Problem) -> None:
        """Put the fields where the run starts."""
        if self.snapshot is not None:
            problem.check("resume", self.snapshot)
        problem.initialise()
        if self.snapshot is not None:
            problem.restore(self.snapshot)


class _Log:
    """The work of a run so far: what checkpoints write and the result tells."""

    def __init__(self, start: _Start, method: _Method, stepper: Stepper, watch: Watch, digest: dict[str, str]) -> None:
        earlier = start.restart
        self._start, self._stepper, self._watch, self._digest = start, stepper, watch, digest
        self._method = method.text(stepper.factorisation.solver)
        self._clock = perf_counter() - (0.0 if earlier is None else earlier.seconds)
        self.reports: list[StepReport] = [] if earlier is None else list(earlier.steps)

    def restart(self) -> Restart:
        """The run after its last accepted step."""
        stepper, seconds = self._stepper, perf_counter() - self._clock
        return Restart(
            snapshot=stepper.accepted, begin=self._start.begin, steps=tuple(self.reports), seconds=seconds,
            stepper=stepper.state(), observers=self._watch.state(), method=self._method, digest=self._digest,
            versions=versions(),
        )  # fmt: skip

    def result(self, setup: Setup) -> Result:
        stepper, solver = self._stepper, self._stepper.factorisation.solver
        seconds = perf_counter() - self._clock
        return Result(setup, tuple(self.reports), stepper.accepted, seconds, solver.factorisations, solver.solves)
