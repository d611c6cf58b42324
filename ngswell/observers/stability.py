"""Whether the states of a run are stable, and whether its steps follow what grows."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf

import numpy as np
from numpy.typing import NDArray

from ngswell.analysis.perturbations import Instability, Perturbations
from ngswell.baths.treatment import Charge
from ngswell.calls import warn
from ngswell.errors import REMEDIES, InputError, InstabilityError, InstabilityWarning, Reason
from ngswell.files import Tree
from ngswell.observers.base import Observer
from ngswell.problem.problem import Problem

FOLLOWED = 0.5
"""Largest growth s Δt within a stage of size Δt that counts as followed: backward Euler then multiplies by 2, not by 1.65.
At 1 its factor 1/(1 − s Δt) is infinite, beyond it changes its sign, and from 2 on the step damps what grows."""


class Stability(Observer):
    """Stops a run with InstabilityError in the first unstable state: where a surface wrinkles, a body buckles.

        scene.run(until=8000, observers=[Stability(when=100.0)])

    A run does not notice by itself. Without an imperfection its state stays as it is, and steps longer than twice the time
    scale of growth damp every perturbation, so that it may end, converged and smooth, where nothing real would stay.

    With `follow`, states may be unstable as long as the steps follow the growth (s Δt at most 1/2 in a stage of size Δt); a
    run whose steps do not stops, one that ends in an unstable state warns. Growth by less than a factor e within `over` [s],
    the length of the run unless given, does not count. `rates` [1/s] are those of the fastest perturbation at each `time`, 0
    where none grows; `last` is the latest unstable one, with its mode. What is found, and when it is exact: `Perturbations`.

    A check of a stable state costs as much as two Newton iterations, of an unstable one some ten to thirteen.
    Raises InputError for `Lagged` baths, whose own instability is one of steps (`growth_factor`).
    """

    watches_stability = True

    def __init__(self, when: float | Sequence[float] | None = None, follow: bool = False, over: float | None = None) -> None:
        super().__init__(when, follow, over)
        if over is not None and not over > 0:
            raise InputError(f"Stability: over = {over!r} s has to be positive")
        self.follow, self.over = follow, over
        self.last: Instability | None = None
        self._rates: list[float] = []

    @property
    def rates(self) -> NDArray:
        """Rate of the fastest growing perturbation at each `time` [1/s]; 0 where none grows, infinite where without flow."""
        return np.array(self._rates)

    def table(self) -> dict[str, NDArray]:
        return {"rate [1/s]": self.rates}

    def prepare(self, problem: Problem, begin: float, until: float) -> None:
        for bath, treatment in problem.setup.prescribed_baths:
            if treatment.charge_of is Charge.LAST_STEP:
                raise InputError(
                    f"Stability: the bath on {bath.boundary!r} looks back one step ({treatment}); "
                    "scene.growth_factor(dt) tells what a step does to a perturbation"
                )
        if self.over is None and not begin < until:
            raise InputError(
                "Stability: a state of rest has no duration; say over how long growth counts, Stability(over=1e6)"
            )
        self._slowest = 1 / (until - begin if self.over is None else self.over)
        self._perturbations = Perturbations(problem)
        self._begin, self._stopped = begin, False

    def state(self) -> Tree:
        return {"rates": self.rates}

    def restore(self, state: Tree) -> None:
        self._rates = state["rates"].tolist()

    def record(self, problem: Problem, time: float) -> None:
        before = self._rates[-1] if self._rates else 0.0
        found = self._perturbations.fastest(self._slowest, before if 0 < before < inf else None)
        self._rates.append(found.rate if found else 0.0)
        if found is None:
            return
        self.last = found
        stage = problem.dt.Get() if time > self._begin else 0.0
        lost = stage > 0 and found.rate * stage > FOLLOWED
        if lost or not self.follow:
            self._stopped = True
            raise InstabilityError(time, stage, found.where, found.rate, found.wavelength, str(found), lost)

    def finish(self, problem: Problem) -> None:
        if self._rates and self._rates[-1] > 0 and not self._stopped and self.last:
            at = f"t = {self._recorded[-1]:.10g} s"
            text = f"Stability: the last state looked at, {at}, is unstable: {self.last}. {REMEDIES[Reason.UNSTABLE]}"
            warn(InstabilityWarning(text), problem.team)
