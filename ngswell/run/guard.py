"""Whether a run, or a state of rest, is past the limit of stability: a look that costs little."""

from __future__ import annotations

from ngswell import checks
from ngswell.analysis.perturbations import Instability, Perturbations
from ngswell.calls import warn
from ngswell.errors import InstabilityError, InstabilityWarning, NgswellError
from ngswell.observers.stability import FOLLOWED
from ngswell.problem.problem import Problem
from ngswell.run.watch import Watch
from ngswell.solve.direct import LinearSolver

ANSWERS = ("warn", "error", "off")
"""What a state past the limit of stability is answered with."""

WORK = 400
"""Solves between two looks during a run, one with a new matrix counted as `MATRIX`. A look costs a hundredth of them."""

MATRIX = 4

AT_KINK = 100
"""The same at kinks, where what loads and baths do is at an extreme; the first kink is looked at in any case."""


class Guard:
    """Warns, or raises InstabilityError, where a perturbation grows.

    Not for baths that look back one step, whose states have a map of their own, and where an observer watches stability.
    """

    def __init__(self, answer: str, watch: Watch, problem: Problem, solver: LinearSolver, duration: float) -> None:
        quiet = (
            answer == "off" or problem.setup.looks_back or any(observer.watches_stability for observer in watch.observers)
        )
        self._answer = "off" if quiet else answer
        self._problem, self._solver, self._slowest = problem, solver, 1 / duration
        self._perturbations: Perturbations | None = None
        self._looked = self._work()
        self._kinks = False  # whether it has looked at one

    @staticmethod
    def check(what: str, answer: str) -> None:
        """Refuse an answer that is none."""
        checks.choice(f"{what}: unstable =", answer, ANSWERS)

    def _work(self) -> int:
        return self._solver.solves + MATRIX * self._solver.factorisations

    def after_step(self, time: float, at_kink: bool) -> None:
        """Now and then, and at kinks: whether perturbations grow, faster than the stages just taken follow.

        The matrix that the last step was solved with tells: K(σ) at σ of one over a stage.
        """
        due = self._looked + (AT_KINK if at_kink else WORK)
        if self._answer == "off" or not self._solver.direct or not (self._work() >= due or (at_kink and not self._kinks)):
            return
        self._looked, self._kinks = self._work(), self._kinks or at_kink
        solves = self._solver.solves  # the run's own
        doubtful = self._doubtful(None)
        self._solver.solves = solves
        if doubtful:
            self._look(time, self._problem.dt.Get())

    def _look(self, time: float, stage: float) -> None:
        """Tell of growth that stages of size `stage` [s] lose; where it cannot be told, the look at the end does."""
        try:
            found = Perturbations(self._problem).fastest(self._slowest)
        except NgswellError:
            return
        if found is not None and found.rate * stage > FOLLOWED:
            self._tell(time, stage, found)

    def at_end(self, time: float) -> None:
        """Whether a perturbation grows by a factor e in as long as the run took; its matrix is a new one."""
        if self._answer == "off":
            return
        counts = self._solver.factorisations, self._solver.solves
        found = None
        if self._doubtful(self._slowest):
            assert self._perturbations is not None
            try:
                found = self._perturbations.fastest(self._slowest)
            except NgswellError as error:
                text = f"whether the state at t = {time:.10g} s is stable could not be told: {error}"
                warn(InstabilityWarning(text), self._problem.team)
        self._solver.factorisations, self._solver.solves = counts
        if found is not None:
            self._tell(time, 0.0, found)

    def _doubtful(self, rate: float | None) -> bool:
        if self._perturbations is None:
            self._perturbations = Perturbations(self._problem, self._solver)
        try:
            return self._perturbations.doubtful(rate)
        except NgswellError:
            return True

    def _tell(self, time: float, stage: float, found: Instability) -> None:
        answer, self._answer = self._answer, "off"  # once a run
        error = InstabilityError(time, stage, found.where, found.rate, found.wavelength, str(found), stage > 0)
        error.end = self._problem.snapshot(time)
        if answer == "error":
            raise error
        warn(InstabilityWarning(f"{error.said} {error.failure.remedy}"), self._problem.team)
