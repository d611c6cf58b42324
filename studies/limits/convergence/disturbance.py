"""A disturbed state of rest: how fast it leaves it, with small steps and with large ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ngswell import TABLE_2, DampedNewton, Fixed, Probe, Scene, StepError
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from ngswell.setup.snapshot import Snapshot
from studies.limits.convergence.spectra import CELL, held_sideways, swell
from studies.scenes import with_noise

RUN_AWAY = 0.1  # mol/l, J = 2.69: beyond what any variant holds flat
DISTURBANCE = 1e-8  # mm
STEPS = {"ms": 1e-3, "s": 1.0}  # s


@dataclass(frozen=True)
class Departure:
    """A variant leaving rest in steps of `STEPS[label]`: times [s], sideways displacement [mm] of a point of the surface."""

    variant: str
    label: str
    time: NDArray
    size: NDArray
    scene: Scene
    end: Snapshot

    @property
    def step(self) -> float:
        return STEPS[self.label]

    @property
    def rate(self) -> float:
        """s of the growth 1/(1 − s Δt) a step where the amplitude is between 1e-6 and 1e-4 mm; 0 if it never is."""
        clean = np.flatnonzero((self.size > 1e-6) & (self.size < 1e-4))
        if len(clean) < 3:
            return 0.0
        first, last = clean[0], clean[-1]
        factor = (self.size[last] / self.size[first]) ** (self.step / (self.time[last] - self.time[first]))
        return float((1 - 1 / factor) / self.step)


def departure(variant: str, label: str) -> Departure:
    """60 steps after a random disturbance of rest, fewer where a cell folds before."""
    scene, step = held_sideways(variant, 4, RUN_AWAY), STEPS[label]
    problem = scene.problem
    state = swell(problem, homogeneous_equilibrium(TABLE_2, RUN_AWAY, "confined").J, RUN_AWAY)
    probe = Probe((2 * CELL, 4 * CELL), "displacement")
    # The disturbance is far below Newton's usual tolerance.
    start = with_noise(problem, Snapshot(0.0, state), DISTURBANCE)
    try:
        exact = DampedNewton(tolerance=1e-13)
        end = scene.run(60 * step, Fixed(step), [probe], newton=exact, resume=start, unstable="off").end  # it is meant to be
    except StepError as stopped:
        end = stopped.end
    return Departure(variant, label, probe.time, np.abs(probe.values["displacement"][:, 0]), scene, end)
