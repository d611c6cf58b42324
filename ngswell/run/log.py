"""The accepted steps of a run, in the memory or in a file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from ngswell.errors import InputError, Reason, Rejection
from ngswell.files import Tree
from ngswell.stepping.steps import StepReport
from ngswell.stepping.tally import Tally
from ngswell.streams import CSV, Stream
from ngswell.team import ALONE, Team

HEADER = ("time [s]", "dt [s]", "iterations [-]", "error [-]", "rejected")


class StepLog:
    """Every accepted step, and the `tally` of all; with `to` the steps are in its file, and only the tally in the memory."""

    def __init__(self, to: str | Path | CSV | None) -> None:
        file = CSV.of("run: log", to)
        self.tally = Tally()
        self._stream = None if file is None else Stream(file, "run: log")
        self._steps: list[StepReport] = []

    def begin(self, earlier: tuple[StepReport, ...], state: Tree, team: Team = ALONE) -> None:
        """Start with the `earlier` steps of the run, or from the `state` in which a checkpoint found the file."""
        if self._stream is None:
            if state:
                raise InputError("resume: the run before kept its steps in a file; give it as log= again")
        elif state:
            self.tally.restore(state["tally"])
            self._stream.resume(state, team)
        else:
            self._stream.begin(team)
            self._stream.write(HEADER)
        for step in earlier:
            self.append(step)

    def append(self, step: StepReport) -> None:
        self.tally.add(step)
        if self._stream is None:
            self._steps.append(step)
        else:
            time, dt, iterations, rejected, error = as_list(step)
            self._stream.write([repr(time), repr(dt), iterations, repr(error), json.dumps(rejected)])

    @property
    def steps(self) -> tuple[StepReport, ...]:
        """All accepted steps, read from the file if they are there. Raises InputError where that was lost or damaged."""
        return tuple(self._steps) if self._stream is None else tuple(map(_from_row, list(self._stream.there().rows())[1:]))

    @property
    def kept(self) -> tuple[StepReport, ...]:
        """The steps in the memory."""
        return tuple(self._steps)

    def state(self) -> Tree:
        """What a checkpoint keeps of the file; nothing without one."""
        return {} if self._stream is None else {**self._stream.state(), "tally": self.tally.state()}

    def close(self) -> None:
        if self._stream is not None:
            self._stream.close()


def as_list(step: StepReport) -> list[Any]:
    """A step in JSON's values."""
    rejected = [[r.dt, r.reason.name, r.what, r.error] for r in step.rejected]
    return [step.time, step.dt, step.iterations, rejected, step.error]


def from_list(entry: list[Any]) -> StepReport:
    """The step that `as_list` gave."""
    time, dt, iterations, rejected, error = entry
    return StepReport(
        time, dt, iterations, tuple(Rejection(size, Reason[name], what, e) for size, name, what, e in rejected), error
    )


def _from_row(row: list[str]) -> StepReport:
    time, dt, iterations, error, rejected = row
    return from_list([float(time), float(dt), int(iterations), json.loads(rejected), float(error)])
