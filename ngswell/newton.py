"""Newton's method with a convergence test per field, damping, and refusal of what is not physical."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from ngsolve import BaseMatrix, BaseVector

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

    Prescribed values are part of the correction. Put into the fields at once, a sudden change of a bath would be a jump
    across one cell; every step would then start from it, however short.
    """

    tolerance: float = 1e-8
    most_iterations: int = 15
    least_damping: float = 1 / 64

    def solve(self, problem: Problem, solver: LinearSolver) -> Outcome:
        """Iterate from the fields of `problem`, in place."""
        vector = problem.vector
        residual, correction, simplified, right, gap = (problem.fields.vec.CreateVector() for _ in range(5))

        def solve(matrix: BaseMatrix, solution: BaseVector) -> bool:
            excess = problem.gap()
            if not excess.any():
                return solver.solve(residual, solution)
            gap.FV().NumPy()[:] = excess
            right.data = residual - matrix * gap
            solved = solver.solve(right, solution)
            solution.data += gap
            return solved

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
            matrix = problem.linearise()
            if not solver.factorise(matrix) or not solve(matrix, correction):
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
                    if solve(matrix, simplified) and size(simplified) <= (1 - damping / 4) * before:
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
