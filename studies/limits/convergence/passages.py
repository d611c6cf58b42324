"""The free-swelling scene from its state at 7000 s, in every variant, on several meshes and with several steps."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache

import numpy as np

from ngswell import Area, DampedNewton, Fixed, Reason, Scene, StepError
from ngswell.errors import Failure
from ngswell.problem.problem import Problem
from ngswell.setup.snapshot import Snapshot
from ngswell.solve.factorisation import Factorisation
from ngswell.solve.newton import Outcome
from ngswell.stepping.steps import Step
from studies.limits.convergence.variants import VARIANTS, as_variant
from studies.scenes import END, INITIAL, free_swelling_block, with_noise

PATIENCE = 24
NOISE = 1e-4  # mm

Intervals = tuple[tuple[float, float], ...]
"""Parts of a run, each (until, step) [s]."""

INTO_THE_RIM: Intervals = ((7080.0, 20.0), (7200.0, 5.0))
"""Large steps to 7200 s, where the rim swells fastest."""

PAST_THE_RAMP: Intervals = ((7300.0, 20.0),)


@dataclass(frozen=True)
class Plan:
    """A run of the free-swelling scene from 7000 s: `variant` on `cells`, after `approach` in steps of `step` [s].

    With `noise` [mm], from the present model's state at the end of the approach, its displacement disturbed at random.
    """

    variant: str
    cells: tuple[int, int]
    step: float
    until: float = END
    approach: Intervals = ()
    undamped: bool = False
    noise: float = 0.0

    @property
    def key(self) -> str:
        nx, ny = self.cells
        return f"{self.variant}_{nx}x{ny}_{self.step:g}s" + "_undamped" * self.undamped + "_disturbed" * bool(self.noise)

    @property
    def begin(self) -> float:
        """Start of the part that counts [s]."""
        return self.approach[-1][0] if self.approach else INITIAL


def plans(quick: bool) -> list[Plan]:
    """The matrix of runs."""
    if quick:
        short = [Plan(name, (8, 8), 50.0) for name in ("potential", "present", "smooth")]
        return [*short, Plan("elementwise", (8, 8), 50.0, 8500.0)]
    coarse = [Plan(name, (11, 10), 50.0) for name in ("potential", *VARIANTS)]
    coarse += [Plan("smooth", (11, 10), 50.0, undamped=True)]
    fine = [Plan(name, (22, 20), 20.0) for name in ("potential", "present", "smooth")]
    fine += [Plan(name, (22, 20), 20.0, 7360.0, PAST_THE_RAMP, noise=NOISE) for name in VARIANTS]
    small = [Plan(name, (22, 20), 0.1, 7222.0, INTO_THE_RIM) for name in ("potential", "present", "smooth")]
    return coarse + fine + small


# -- what is watched -----------------------------------------------------------------------------------------------------


class _GivenUp(Exception):
    """More solves have failed than a run is worth."""


@dataclass(frozen=True)
class Undamped(DampedNewton):
    """Newton's method without damping and without looking at what is admissible, as a short script has it."""

    def solve(self, problem: Problem, factorisation: Factorisation, shares: dict[str, float] | None = None) -> Outcome:
        residual, correction = (problem.fields.vec.CreateVector() for _ in range(2))
        for count in range(1, self.most_iterations + 1):
            problem.residual(residual)
            if not factorisation.renew(problem) or not factorisation.solve(residual, correction):
                return Outcome(count, Failure(Reason.SINGULAR))
            change = correction.FV().NumPy()
            problem.vector[:] -= change
            if all(np.abs(change[problem.ranges[n]]).max() <= self.tolerance * problem.references[n] for n in problem.names):
                return Outcome(count)
        failure = Failure(Reason.TOO_MANY_ITERATIONS, *problem.worst(change), str(self.most_iterations))
        return Outcome(self.most_iterations, failure)


@dataclass(frozen=True)
class Watched(DampedNewton):
    """Another iteration, whose failures are kept with the time of the last accepted step."""

    method: DampedNewton = DampedNewton()
    clock: Area = field(default_factory=Area)
    failures: list[tuple[float, Failure]] = field(default_factory=list)

    def solve(self, problem: Problem, factorisation: Factorisation, shares: dict[str, float] | None = None) -> Outcome:
        outcome = self.method.solve(problem, factorisation, shares)
        if outcome.failure is not None:
            self.failures.append((float(self.clock.time[-1]), outcome.failure))
            if len(self.failures) >= PATIENCE:
                raise _GivenUp
        return outcome


class _Counter(Area):
    """The area at every step, the last accepted state, and the Newton iterations."""

    iterations, steps = 0, 0
    last: Snapshot

    def start(self, problem: Problem, begin: float, until: float) -> None:
        super().start(problem, begin, until)
        self.last = problem.snapshot(begin)

    def observe(self, problem: Problem, step: Step) -> None:
        super().observe(problem, step)
        self.last = problem.snapshot(step.time)
        self.iterations, self.steps = self.iterations + step.iterations, self.steps + 1


# -- the runs ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Passage:
    """How a run went; `state` is its last accepted one."""

    plan: Plan
    scene: Scene
    reached: float
    iterations: int
    steps: int
    failures: list[tuple[float, Failure]]
    state: Snapshot

    @property
    def passed(self) -> bool:
        return self.reached >= self.plan.until

    @property
    def share(self) -> float:
        """Of the wanted time."""
        return (self.reached - self.plan.begin) / (self.plan.until - self.plan.begin)

    @property
    def numbers(self) -> dict[str, float | int | str]:
        key = self.plan.key
        numbers: dict[str, float | int | str] = {
            f"{key}_reached_s": self.reached,
            f"{key}_wanted_s": self.plan.until,
            f"{key}_first_rejection_s": self.failures[0][0] if self.failures else -1.0,
            f"{key}_failed_solves": len(self.failures),
            f"{key}_iterations": self.iterations,
        }
        if self.failures:
            failure = self.failures[-1][1]
            numbers |= {f"{key}_field": failure.field, f"{key}_reason": failure.text}
            numbers |= {f"{key}_x_mm": failure.where[0], f"{key}_y_mm": failure.where[1]}
        return numbers


@cache
def approached(variant: str, cells: tuple[int, int], intervals: Intervals) -> Snapshot:
    """The free-swelling scene from rest at 7000 s through `intervals`."""
    scene = as_variant(free_swelling_block(*cells), variant)
    state = scene.equilibrate(INITIAL)
    for until, step in intervals:
        state = scene.run(until, Fixed(step), resume=state, unstable="off").end
    return state


def passage(plan: Plan) -> Passage:
    """Run a plan as far as it goes."""
    scene = as_variant(free_swelling_block(*plan.cells), plan.variant)
    state = approached("present" if plan.noise else plan.variant, plan.cells, plan.approach)
    if plan.noise:
        state = with_noise(scene.problem, state, plan.noise)
    counter = _Counter()
    watched = Watched(method=Undamped() if plan.undamped else DampedNewton(), clock=counter)
    with suppress(StepError, _GivenUp):
        scene.run(plan.until, Fixed(plan.step), [counter], newton=watched, resume=state, unstable="off")
    return Passage(plan, scene, counter.last.time, counter.iterations, counter.steps, watched.failures, counter.last)
