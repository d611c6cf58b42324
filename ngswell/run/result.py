"""What a run gives back."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from ngswell.problem.discretisation import Discretisation
from ngswell.setup.setup import Setup
from ngswell.setup.snapshot import Snapshot
from ngswell.stepping.steps import StepReport, why


@dataclass(frozen=True)
class Result:
    """What a run did: its accepted steps, and the state it ended in. Numbers of interest are kept by the observers."""

    setup: Setup = field(repr=False)
    steps: tuple[StepReport, ...]
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
    def iterations(self) -> int:
        """Newton iterations of all accepted steps."""
        return sum(step.iterations for step in self.steps)

    @property
    def rejections(self) -> int:
        """Rejected steps."""
        return sum(len(step.rejected) for step in self.steps)

    def summary(self) -> str:
        """What the run took, and why steps were rejected."""
        done = f"{len(self.steps)} steps, {self.iterations} Newton iterations, {self.seconds:.1f} s"
        reasons = why(rejection for step in self.steps for rejection in step.rejected)
        return f"t = {self.end.time:.10g} s after {done}" + (f"; rejected: {reasons}" if reasons else "")
