"""Where a run starts."""

from __future__ import annotations

from dataclasses import dataclass

from ngswell import checks
from ngswell.errors import InputError
from ngswell.files import Tree
from ngswell.problem.problem import Problem
from ngswell.problem.vessels import among_themselves, together
from ngswell.run.checkpoint import Checkpoint
from ngswell.run.restart import Restart
from ngswell.run.watch import Watch
from ngswell.schedules import LARGEST
from ngswell.setup.setup import Setup
from ngswell.setup.snapshot import Snapshot
from ngswell.stepping.steps import StepReport
from ngswell.stepping.timetable import Timetable, same_time


@dataclass(frozen=True)
class Start:
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
    ) -> Start:
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
        stops += [bend for history in setup.schedules for bend in history.bends]
        return Timetable.of(*span, [kink for history in setup.schedules for kink in history.kinks], stops)

    @property
    def remembered(self) -> tuple:
        return () if self.restart is None else self.restart.observers

    @property
    def logged(self) -> tuple[tuple[StepReport, ...], Tree]:
        """The steps of the earlier part, and where those in a file stand."""
        return ((), {}) if self.restart is None else (self.restart.steps, self.restart.log)

    def apply(self, problem: Problem) -> None:
        """Put the fields where the run starts. Refuses a vessel that runs dry whatever the body does."""
        if self.snapshot is not None:
            problem.check("resume", self.snapshot)
        problem.initialise()
        if self.snapshot is not None:
            problem.restore(self.snapshot)
            for load in problem.setup.loads:
                load.check_start(problem.state, problem.time)
        self._check_vessels(problem)

    def _check_vessels(self, problem: Problem) -> None:
        """A bath that is the only one cannot lose more than it and the body hold."""
        setup = problem.setup
        for bath in setup.baths:
            if bath.vessel is None or not among_themselves(problem):
                continue
            name = bath.numbers(problem.concentration)["fluid"].name
            left = together(problem)[name] + bath.vessel.let_in(self.time, self.until)
            if not left > 0:
                raise InputError(
                    f"vessel on {bath.boundary!r}: until {self.until:g} s more is let out than bath and body hold at the "
                    f"start and what is let in, by {-left:g} of its volume's unit: less outflow, or a shorter run"
                )
