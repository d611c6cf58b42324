"""What a run goes on from after a kill, and how signals end it."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from time import perf_counter
from types import FrameType, TracebackType
from typing import Any

from ngswell.errors import InputError, OutputError
from ngswell.files import check_folder
from ngswell.observers.base import Observer
from ngswell.problem.problem import Problem
from ngswell.run.restart import Restart, read_checkpoint
from ngswell.stepping.stepper import StepReport


class Checkpoint(Observer):
    """Keeps in the file `path` all that the rest of the run depends on.

        checkpoint = Checkpoint("run.checkpoint")
        scene.run(until=8000, observers=[core, checkpoint], resume=checkpoint.read())

    is a script that can be killed at any moment and started again. Written when the run starts, then after a step: `every`
    so many seconds of the clock (0: each step), at the simulated times `when` (on which steps land), on `request()`; and
    when the run ends, fails with StepError or is interrupted, with the last accepted state. The file is replaced as a whole.

    Ctrl-C lets the present step finish and ends with KeyboardInterrupt, SIGTERM with exit status 143; a second one gives
    the step up. An existing file is refused unless `overwrite` or the run resumes from it. A checkpoint that cannot be
    written stops the run (OutputError; the file of before stays): whoever asks for checkpoints relies on them.
    """

    def __init__(
        self, path: str | Path, every: float = 600.0, when: float | Sequence[float] | None = None, overwrite: bool = False
    ) -> None:
        super().__init__(when)
        if not every >= 0:
            raise InputError(f"Checkpoint: every has to be 0 s or more, got {every!r}")
        self.path, self.every, self.overwrite = Path(path), every, overwrite
        self._requested = False
        self._saved: float | None = None

    def read(self) -> Restart | None:
        """What the file holds; None if there is none yet."""
        return read_checkpoint(self.path) if self.path.exists() else None

    def request(self) -> None:
        """Write after the present step. For signal handlers and other threads."""
        self._requested = True

    def follow(self, run: Callable[[], Restart], resumed: Restart | None) -> None:
        """Called before `start`: `run` tells what to write, `resumed` what the run resumes from."""
        file = None if resumed is None else resumed.file
        self._own = file is not None and self.path.exists() and self.path.samefile(file)
        self._run, self._saved = run, resumed.snapshot.time if resumed is not None and self._own else None

    def start(self, problem: Problem, begin: float, until: float) -> None:
        check_folder(self.path.parent, "Checkpoint")
        if self.path.exists() and not (self.overwrite or self._own):
            raise OutputError(
                f"Checkpoint: {self.path} exists; go on from it with resume=checkpoint.read(), choose another name or pass "
                "overwrite=True"
            )
        if self.path.is_dir():
            raise OutputError(f"Checkpoint: {self.path} is a folder; choose another name")

    def observe(self, problem: Problem, report: StepReport) -> None:
        at_time = self.when is not None and self._due(report.time)
        if self._requested or at_time or perf_counter() - self._clock >= self.every:
            self.save()

    def save(self) -> None:
        """Write the run as it is after its last accepted step, unless the file already has that."""
        self._requested = False
        restart = self._run()
        if restart.snapshot.time != self._saved:
            restart.write(self.path)
            self._saved = restart.snapshot.time
        self._clock = perf_counter()


class Stopped(BaseException):
    """The second signal."""


class Signals:
    """SIGINT and SIGTERM of a run that is `guarded`: `received` tells the loop, `Stopped` ends a step that is under way."""

    def __init__(self, guarded: bool) -> None:
        self.received: signal.Signals | None = None
        self.stepping = False
        self._guarded = guarded and threading.current_thread() is threading.main_thread()
        self._before: dict[signal.Signals, Any] = {}

    def __enter__(self) -> Signals:
        for number in (signal.SIGINT, signal.SIGTERM) if self._guarded else ():
            before = signal.getsignal(number)
            if before not in (signal.SIG_IGN, None):  # ignored, as under nohup, or not Python's to restore
                self._before[number] = before
                signal.signal(number, self._receive)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        for number, before in self._before.items():
            signal.signal(number, before)

    def _receive(self, number: int, frame: FrameType | None) -> None:
        again, self.received = self.received is not None, signal.Signals(number)
        if again and self.stepping:
            raise Stopped

    def end(self, time: float, files: Sequence[Path]) -> None:
        """End the program as the signal received asks for; nothing without one."""
        said = f"stopped at t = {time:.10g} s; go on with resume=read_checkpoint({str(files[0])!r})" if files else ""
        if self.received is signal.SIGTERM:
            print(said, file=sys.stderr, flush=True)
            raise SystemExit(128 + signal.SIGTERM)
        if self.received is not None:
            raise KeyboardInterrupt(said)
