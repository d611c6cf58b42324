"""How signals end a run that keeps checkpoints."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import FrameType, TracebackType
from typing import Any, TypeVar

from ngswell.team import ALONE, Team

Item = TypeVar("Item")


class Stopped(BaseException):
    """The second signal."""


class Signals:
    """SIGINT and SIGTERM of a run that is `guarded`: the first lets the present step finish, a second gives it up.

    What one rank of a `team` receives ends the run of all after the step; a second one does no more, as no rank can give up
    a step that others go on with.
    """

    def __init__(self, guarded: bool, team: Team = ALONE) -> None:
        self.received: signal.Signals | None = None
        """What all ranks know of."""
        self.stepping = False
        self._team = team
        self._mine: signal.Signals | None = None
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

    def until_received(self, steps: Iterable[Item]) -> Iterator[Item]:
        """The steps, as they are made, until a signal comes; `stepping` tells that one is under way."""
        remaining = iter(steps)
        while not self.came():
            self.stepping = True
            step = next(remaining, None)
            self.stepping = False
            if step is None:
                return
            yield step

    def came(self) -> bool:
        """Whether a signal has come, to any rank; now all know of it."""
        if self.received is None:
            self.received = next(filter(None, self._team.each(self._mine)), None)
        return self.received is not None

    def _receive(self, number: int, frame: FrameType | None) -> None:
        again, self._mine = self._mine is not None, signal.Signals(number)
        if again and self.stepping and self._team.alone:
            raise Stopped

    def end(self, time: float, file: Path | None) -> None:
        """End the program as the signal received asks for; nothing without one."""
        self.came()
        said = "" if file is None else f"stopped at t = {time:.10g} s; run again with checkpoint=Checkpoint({str(file)!r})"
        if self.received is signal.SIGTERM:
            if self._team.rank == 0:
                print(said, file=sys.stderr, flush=True)
            raise SystemExit(128 + signal.SIGTERM)
        if self.received is not None:
            raise KeyboardInterrupt(said)
