"""The life of an observer."""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ngswell.errors import InputError
from ngswell.files import Tree
from ngswell.observers.when import When
from ngswell.problem.problem import Problem
from ngswell.stepping.steps import Step
from ngswell.streams import CSV
from ngswell.team import ALONE


class Observer:
    """Base of all observers. `when` is None (every accepted step), an interval [s] or a list of times [s].

    Steps land on the times asked for. Raises InputError for times that the run does not pass. A class of one's own gives,
    numbered:

    1. `record`, called with the initial state and after accepted steps where due (or `observe`, after every one);
    2. `prepare`, if it needs something before, or refuses what cannot be meant;
    3. `state` and `restore`, if it shall go on in a run resumed from a checkpoint as if nothing had been; without them it
       starts anew there;
    4. `settings` for the base class, which with `when` tell observers of a class apart;
    5. `finish`, if something is left to do at the end;
    6. `table`, if `to_csv` shall write its records.

    An observer records one run; a second one refuses it. A function of time [s] and state is an observer too:
    `observers=[lambda time, state: ...]`, see `Call`.
    """

    watches_stability = False
    """Whether it tells itself that a state is unstable; a run then does not look."""
    used = False
    """Whether a run has started with it."""
    team = ALONE
    """The ranks that run it; the first writes its files."""

    def __init__(self, when: float | Sequence[float] | None = None, *settings: object) -> None:
        self._when = When(type(self).__name__, when)
        self._settings = settings
        self._recorded = array("d")

    @property
    def when(self) -> float | tuple[float, ...] | None:
        """Interval [s] or times [s] of the records; None for every accepted step."""
        return self._when.value

    @property
    def time(self) -> NDArray:
        """Times of the records [s]."""
        return np.array(self._recorded)

    def table(self) -> dict[str, NDArray]:
        """Its records for `to_csv`, one row a time, by name and unit, "J [-]"; those of vectors have several columns."""
        return {}

    def to_csv(self, path: str | Path, overwrite: bool = False) -> None:
        """Write the records as a table: `time [s]`, then a column for each number, with its unit in the header.

        Raises InputError without records, and OutputError for a file that exists (unless `overwrite`) or cannot be written.
        Of several ranks the first writes, whether all call or it alone.
        """
        what, file = f"{type(self).__name__}.to_csv", CSV(path, overwrite)
        if self.team.rank > 0:
            return
        time = self.time  # which may be read from a file
        columns = self.table() if len(time) else {}
        if not columns:
            raise InputError(
                f"{what}: there are no records of numbers; Probe, Integral, Outflow, Reaction, Ledger have some after a run"
            )
        file.write(what, {"time [s]": time, **columns})

    def plan(self, begin: float, until: float) -> list[float]:
        """Settle the times of the records [s]; returns them, for steps to land on."""
        return self._when.plan(begin, until)

    def __repr__(self) -> str:
        settings = [*map(repr, self._settings), *filter(None, [repr(self._when)])]
        return f"{type(self).__name__}({', '.join(settings)})"

    def prepare(self, problem: Problem, begin: float, until: float) -> None:
        """Called once before the first record, also of a resumed run; refuses what cannot be meant."""

    def start(self, problem: Problem, begin: float, until: float) -> None:
        """Called once, with the initial state."""
        self.prepare(problem, begin, until)
        self._record_if_due(problem, begin)

    def resume(self, problem: Problem, begin: float, until: float, state: Tree) -> None:
        """Called instead of `start` in a run that began at `begin` and goes on from the present fields."""
        self.prepare(problem, begin, until)
        self._recorded = array("d", state["time"].tolist())
        self.restore(state)

    @property
    def remembers(self) -> bool:
        """Whether it takes part in checkpoints."""
        return type(self).state is not Observer.state

    def state(self) -> Tree:
        """What its records are made of, beside `time`."""
        return {}

    def restore(self, state: Tree) -> None:
        """Take back what `state` gave."""

    def kept(self) -> Tree:
        """What a checkpoint keeps: that, and the times of the records."""
        return {**self.state(), "time": self.time}

    def observe(self, problem: Problem, step: Step) -> None:
        """Called after every accepted step."""
        self._record_if_due(problem, step.time)

    def _record_if_due(self, problem: Problem, time: float) -> None:
        if self._when.due(time):
            self._recorded.append(time)
            self.record(problem, time)

    def record(self, problem: Problem, time: float) -> None:
        """Called at the start and after accepted steps, where due."""

    def finish(self, problem: Problem) -> None:
        """Called once at the end, also of a run that failed."""
