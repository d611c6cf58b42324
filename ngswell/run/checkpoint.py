"""What a run goes on from after a kill."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from time import perf_counter

from ngswell import checks
from ngswell.errors import OutputError
from ngswell.files import alone, check_folder
from ngswell.observers.when import When
from ngswell.run.restart import Restart, read_checkpoint
from ngswell.team import ALONE, Team


class Checkpoint:
    """Keeps in the file `path` all that the rest of a run depends on.

        scene.run(until=8000, observers=[core], checkpoint=Checkpoint("run.checkpoint"))

    is a script that can be killed at any moment and started again: it goes on from the file if there is one. Written when
    the run starts, then after a step: `every` so many seconds of the clock (0: each step), at the simulated times `when` (an
    interval or times [s], on which steps land), on `request()`; and when the run ends, no step succeeds or it is
    interrupted, with the last accepted state. The file is replaced as a whole.

    Ctrl-C lets the present step finish and ends with KeyboardInterrupt, SIGTERM with exit status 143; a second one gives
    the step up. With `overwrite` an existing file is replaced and the run starts anew. A checkpoint that cannot be
    written stops the run (OutputError; the file of before stays): whoever asks for checkpoints relies on them.
    """

    def __init__(
        self, path: str | Path, every: float = 600.0, when: float | Sequence[float] | None = None, overwrite: bool = False
    ) -> None:
        self.every = checks.number("Checkpoint: every", every, "s", low=0.0)
        checks.flag("Checkpoint: overwrite", overwrite)
        self.path, self.overwrite = checks.path("Checkpoint", path, "run.checkpoint"), overwrite
        self._when = When("Checkpoint", when)
        self._requested = False
        self._saved: float | None = None
        self._clock = 0.0
        self._team = ALONE

    @contextmanager
    def alone(self, team: Team = ALONE) -> Iterator[None]:
        """No other run keeps its checkpoint there meanwhile. Raises OutputError for one that does, and for a folder that
        cannot be written to. Until the end, the first rank of the `team` reads and writes for all."""
        self._team = team
        team.of_first(self._check_place)
        with alone(self.path, "Checkpoint", team=team):
            yield

    def _check_place(self) -> None:
        check_folder(self.path.resolve().parent, "Checkpoint")
        if self.path.is_dir():
            raise OutputError(f"Checkpoint: {self.path} is a folder; choose another name")

    def read(self) -> Restart | None:
        """What the run is to go on from; None if there is no file yet, or if it is to be replaced.

        Raises InputError for a file that is no checkpoint.
        """
        return self._team.of_first(lambda: read_checkpoint(self.path) if self.path.exists() and not self.overwrite else None)

    def request(self) -> None:
        """Write after the present step. For signal handlers and other threads."""
        self._requested = True

    def plan(self, begin: float, until: float) -> list[float]:
        """Settle the simulated times at which to write [s]; returns them, for steps to land on."""
        return self._when.plan(begin, until)

    def check(self, resumed: Restart | None) -> None:
        """Refuse a file that the run does not go on from."""
        file = None if resumed is None else resumed.file
        exists = self._team.of_first(self.path.exists)
        own = exists and file is not None and self._team.of_first(lambda: self.path.samefile(file))
        if exists and not (own or self.overwrite):
            raise OutputError(
                f"Checkpoint: {self.path} exists, but the run is to go on from something else; leave resume out to go on "
                "from the file, choose another name or pass overwrite=True"
            )
        self._saved = resumed.snapshot.time if resumed is not None and own else None

    def after(self, time: float, write: Callable[[], Restart]) -> None:
        """Called after the accepted step to `time` [s]; `write` tells what to write."""
        at_time = self._when.value is not None and self._when.due(time)
        late = self._team.rank == 0 and perf_counter() - self._clock >= self.every  # clocks of ranks differ
        if at_time or self._team.any(self._requested or late):
            self.save(write)

    def save(self, write: Callable[[], Restart]) -> None:
        """Write the run as it is after its last accepted step, unless the file already has that."""
        self._requested = False
        restart = write()
        if restart.snapshot.time != self._saved:
            self._team.of_first(lambda: restart.write(self.path))
            self._saved = restart.snapshot.time
        self._clock = perf_counter()
