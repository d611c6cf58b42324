"""Newton's method with a convergence test per field, damping, and refusal of what is not physical."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ngswell.problem import Problem
from ngswell.solvers import LinearSolver


@dataclass(frozen=True)
class Outcome:
    """How one nonlinear solve ended: `reason` is None on success, else what went wrong, in which field and where."""

    iterations: int
    reason: str | None = None
    field: str = ""
    where: tuple[float, ...] = ()


@dataclass(frozen=True)
class Newton:
    """Damped Newton iteration.

    A field has converged when the last correction's largest coefficient is below `tolerance` times the field's reference
    size (`Problem.references`); all fields have to. Steps are halved until the fields are admissible and the simplified
    correction (old matrix, new residual) is smaller than the correction: the natural monotonicity test, which
    does not depend on units or on how equations are scaled. The simplified correction that passes the
    test of convergence is applied as well, so accepted states are about a factor `tolerance` better than tested.
    """

    tolerance: float = 1e-8
    most_iterations: int = 15
    least_damping: float = 1 / 64

    def solve(self, problem: Problem, solver: LinearSolver) -> Outcome:
        """Iterate from the fields of `problem`, in place."""
        vector = problem.vector
        residual, correction, simplified = (problem.fields.vec.CreateVector() for _ in range(3))

        def size(change) -> float:  # type: ignore[no-untyped-def]
            values = change.FV().NumPy()
            return max(float(np.abs(values[problem.ranges[n]]).max()) / problem.references[n] for n in problem.names)

        def failure(count: int, reason: str) -> Outcome:
            field, where = problem.worst(correction.FV().NumPy())
            return Outcome(count, reason, field, where)

        correction[:] = 0.0
        found = problem.inadmissible()
        if found:
            return Outcome(0, f"the step starts with {found[0]} not positive", found[0], found[1])
        problem.residual(residual)
        for count in range(1, self.most_iterations + 1):
            if not solver.factorise(problem.linearise()) or not solver.solve(residual, correction):
                return failure(count, "the linear system is singular or not finite")
            before = size(correction)
            if before <= self.tolerance:
                vector -= correction.FV().NumPy()
                return Outcome(count)
            start = vector.copy()
            damping = 1.0
            while True:
                vector[:] = start - damping * correction.FV().NumPy()
                refused = problem.inadmissible()
                if refused is None:
                    problem.residual(residual)
                    if solver.solve(residual, simplified) and size(simplified) <= (1 - damping / 4) * before:
                        break
                damping /= 2
                if damping < self.least_damping:
                    vector[:] = start
                    if refused:
                        return Outcome(count, f"{refused[0]} would not stay positive", refused[0], refused[1])
                    return failure(count, "Newton's method stalls: no damped step reduces the correction")
            if damping == 1.0 and size(simplified) <= self.tolerance:
                vector -= simplified.FV().NumPy()
                return Outcome(count)
        return failure(self.most_iterations, f"Newton's method needs more than {self.most_iterations} iterations")
