"""What a run gives back."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from ngswell.problem.discretisation import Discretisation
from ngswell.run.log import StepLog
from ngswell.setup.setup import Setup
from ngswell.setup.snapshot import Snapshot
from ngswell.stepping.steps import StepReport
from ngswell.units import readable


@dataclass(frozen=True)
class Result:
    """What a run did: its accepted steps, and the state it ended in. Numbers of interest are kept by the observers.

    `steps` are read from the file of the run that was given one, `log=`.
    """

    setup: Setup = field(repr=False)
    log: StepLog = field(repr=False)
    end: Snapshot
    seconds: float
    factorisations: int
    solves: int

    @property
    def state(self) -> Any:
        """The model's state at the end: fields and outputs, `result.state.at((1.1, 0.5), "J")`. No later run changes it.

        Raises InputError where the mesh has changed since the scene was made: fields do not follow it.
        """
        self.setup.mesh_shape.check(self.setup.mesh)
        return self._state

    @cached_property
    def _state(self) -> Any:
        return Discretisation(self.setup).state_at(self.end)

    @property
    def steps(self) -> tuple[StepReport, ...]:
        """The accepted steps."""
        return self.log.steps

    @property
    def iterations(self) -> int:
        """Newton iterations of all accepted steps."""
        return self.log.tally.iterations

    @property
    def rejections(self) -> int:
        """Rejected steps."""
        return self.log.tally.rejected

    def summary(self) -> str:
        """What the run took, and why steps were rejected."""
        tally = self.log.tally
        done = f"{tally.steps} steps, {tally.iterations} Newton iterations, {self.seconds:.1f} s"
        reasons = tally.why
        return f"t = {readable(self.end.time)} after {done}" + (f"; rejected: {reasons}" if reasons else "")
