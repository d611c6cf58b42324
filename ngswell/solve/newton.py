"""Newton's method with a convergence test per field, damping, and refusal of what is not physical."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

import numpy as np
from ngsolve import BaseVector

from ngswell import checks
from ngswell.problem.problem import Problem
from ngswell.solve.direct import LinearSolver

SHORTEST = 1e-12
"""Share of a correction below which keeping the fields admissible leaves none of it."""


@dataclass(frozen=True)
class Outcome:
    """How a nonlinear solve ended: `reason` is None on success, else what went wrong, in which field, where; what helps."""

    iterations: int
    reason: str | None = None
    field: str = ""
    where: tuple[float, ...] = ()
    remedy: str = ""


SQUEEZED = "Remedies: a smaller or slower load or change of the bath, a finer mesh there."
UNRESOLVED = (
    "Remedies: Penalty or Multiplier in place of Nitsche; where anions are few, a slower change of bath or charge, finer "
    "cells at the bath; Potential(), whose ions cannot be negative."
)
LOST = (
    "Remedies: a gentler ramp, a finer mesh where the field is worst, a weaker penalty; the surface of a gel that is held "
    "sideways and swells beyond J = 2.5 may wrinkle."
)


@dataclass(frozen=True)
class Newton:
    """Damped Newton iteration, with new or old matrices.

    A field has converged when the last correction's largest coefficient is below `tolerance` times the field's reference
    size (`Problem.references`); all fields have to. Steps are halved until the fields are admissible, and from there at most
    to `least_damping` until the simplified correction (old matrix, new residual) is smaller than the correction: the natural
    monotonicity test, which does not depend on units or on how equations are scaled. The simplified correction that passes
    the test of convergence is applied as well, so accepted states are about a factor `tolerance` better than tested.

    A factorisation is kept, over iterations, stages and steps, as long as each correction is at most `slowest` times the one
    before; the error that is left is then estimated as that of a geometric series. With 0, each iteration has its own.

    Prescribed values are part of the correction. Put into the fields at once, a sudden change of a bath would be a jump
    across one cell; every step would then start from it, however short.
    """

    tolerance: float = 1e-8
    most_iterations: int = 15
    least_damping: float = 1 / 64
    slowest: float = 0.0

    def __post_init__(self) -> None:
        checks.settle(
            self,
            tolerance=checks.number("Newton: tolerance", self.tolerance, low=1e-16, high=1.0),
            most_iterations=checks.whole("Newton: most_iterations", self.most_iterations, 1, 1000),
            least_damping=checks.number("Newton: least_damping", self.least_damping, low=1e-10, high=1.0),
            slowest=checks.number("Newton: slowest", self.slowest, low=0.0, high=0.99, hint="0 renews every matrix"),
        )

    def solve(self, problem: Problem, solver: LinearSolver) -> Outcome:
        """Iterate from the fields of `problem`, in place."""
        vector = problem.vector
        residual, correction, simplified, gap = (problem.fields.vec.CreateVector() for _ in range(4))

        def solve(solution: BaseVector) -> bool:
            excess = problem.gap()
            if not excess.any():
                return solver.solve(residual, solution)
            gap.FV().NumPy()[:] = excess
            return solver.solve(residual, solution, gap)

        def size(change: BaseVector) -> float:
            values = change.FV().NumPy()
            return max(float(np.abs(values[problem.ranges[n]]).max()) / problem.references[n] for n in problem.names)

        def failure(count: int, reason: str) -> Outcome:
            field, where = problem.worst(correction.FV().NumPy())
            return Outcome(count, reason, field, where, LOST)

        def left(change: float) -> float:
            """What further corrections with the present factorisation would add up to, after one of this size."""
            rate = solver.contraction
            return change if rate is None or not self.slowest else change * min(1.0, rate / (1 - rate))

        def success(count: int) -> Outcome:
            found = problem.inadmissible_solution()
            if found is None:
                return Outcome(count)
            return Outcome(count, f"{found[0]} is not positive in the solution", found[0], found[1], UNRESOLVED)

        correction[:] = 0.0
        found = problem.inadmissible()
        if found:
            return Outcome(0, f"the step starts with {found[0]} not positive", found[0], found[1], SQUEEZED)
        problem.residual(residual)
        renew = not self._may_keep(solver)
        beyond: tuple[str, tuple[float, ...]] | None = None  # what the last correction would leave the physical range with
        known = False  # whether `correction` answers the present residual
        for count in range(1, self.most_iterations + 1):
            if renew and not solver.renew(problem):
                return failure(count, "the linear system is singular or not finite")
            if (renew or not known) and not solve(correction):
                return failure(count, "the linear system is singular or not finite")
            before = size(correction)
            start = vector.copy()
            damping, rate, least = 1.0, inf, SHORTEST
            while True:
                vector[:] = start - damping * correction.FV().NumPy()
                refused = problem.inadmissible()
                beyond = refused or (beyond if damping < 1.0 else None)
                if refused is None:
                    least = max(least, self.least_damping * damping)
                    if damping == 1.0 and (before if renew else left(before)) <= self.tolerance:
                        return success(count)
                    problem.residual(residual)
                    if solve(simplified):
                        rate = size(simplified) / before
                        if rate <= 1 - damping / 4:
                            break
                if not renew:
                    break
                damping /= 2
                if damping < least:
                    vector[:] = start
                    if beyond:
                        return Outcome(count, f"{beyond[0]} would not stay positive", beyond[0], beyond[1], SQUEEZED)
                    return failure(count, "Newton's method stalls: no damped step reduces the correction")
            if not renew and (refused or not rate < 1):
                vector[:] = start
                problem.residual(residual)
                renew = True
                continue
            solver.contraction = max(rate, solver.contraction or 0.0)
            if damping == 1.0 and left(size(simplified)) <= self.tolerance:
                converged = vector.copy()
                vector -= simplified.FV().NumPy()
                if problem.inadmissible():  # at the edge of the physical range even what is left may be too much
                    vector[:] = converged
                return success(count)
            known = damping == 1.0 and self._may_keep(solver)
            renew = not known
            correction.data = simplified
        if beyond:
            return Outcome(count, f"{beyond[0]} would not stay positive", beyond[0], beyond[1], SQUEEZED)
        return failure(self.most_iterations, f"Newton's method needs more than {self.most_iterations} iterations")

    def _may_keep(self, solver: LinearSolver) -> bool:
        return solver.ready and (solver.contraction is None or solver.contraction <= self.slowest) and self.slowest > 0
