"""Newton's method with a convergence test per field, damping, and refusal of what is not physical."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf

from ngsolve import BaseVector

from ngswell import checks
from ngswell.errors import Failure, Reason
from ngswell.problem.admissible import Violation
from ngswell.problem.problem import Problem
from ngswell.solve.factorisation import Factorisation
from ngswell.solve.search import search
from ngswell.solve.size import MeanSize, Size

ROUND_OFF = 1e-13
"""Share of a reference size that no correction is asked to be below for the sake of small `shares`."""

STAGNANT = 1e-11
"""There a correction below this share of a reference size that does not shrink any more is round-off as well."""

SHORTEST = 1e-12
"""Share of a correction below which keeping the fields admissible leaves none of it."""


PATIENCE = 4
"""How many times more iterations a solid with kinks may take."""


@dataclass(frozen=True)
class Outcome:
    """How a nonlinear solve ended; `failure` is None on success."""

    iterations: int
    failure: Failure | None = None


@dataclass(frozen=True)
class DampedNewton:
    """Damped Newton iteration, with new or old matrices.

    A field has converged when the last correction's largest coefficient is below `tolerance` times the field's reference
    size (`Problem.references`); all fields have to. Steps are halved until the fields are admissible, and from there at most
    to `least_damping` until the simplified correction (old matrix, new residual) is smaller than the correction: the natural
    monotonicity test, which does not depend on units or on how equations are scaled. The simplified correction that passes
    the test of convergence is applied as well, so accepted states are about a factor `tolerance` better than tested.

    At kinks of a solid, where fibres go taut, the old matrix knows one side only: where the test passes no step, the part of
    the correction that does work is taken (`search`). At those of terms, where a body begins to touch, a simplified
    correction that fails the test is taken again with the matrix of the new fields.

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
        checks.set_fields(
            self,
            tolerance=checks.number("DampedNewton: tolerance", self.tolerance, low=1e-16, high=1.0),
            most_iterations=checks.integer("DampedNewton: most_iterations", self.most_iterations, 1, 1000),
            least_damping=checks.number("DampedNewton: least_damping", self.least_damping, low=1e-10, high=1.0),
            slowest=checks.number("DampedNewton: slowest", self.slowest, low=0.0, high=0.99, hint="0 renews every matrix"),
        )

    def solve(self, problem: Problem, factorisation: Factorisation, shares: dict[str, float] | None = None) -> Outcome:
        """Iterate from the fields of `problem`, in place. In the test of convergence, by unknown, `shares` of the references
        take their place, and the root mean square that of the largest coefficient: so are a run's errors measured."""
        patient = replace(self, most_iterations=PATIENCE * self.most_iterations) if problem.setup.material.kinked else self
        return _Iteration(patient, problem, factorisation, shares or {}).run()

    def solve_from_above(
        self, problem: Problem, factorisation: Factorisation, shares: dict[str, float] | None = None
    ) -> Outcome:
        """The same from fields whose ions are too many rather than too few.

        Next to nothing, ions are a square that each iteration halves: three times as many are allowed. What is left then is
        what round-off leaves (`Problem.round_off`), and no vertex loses all at once (`Problem.keep_positive`).
        """
        patient = replace(self, most_iterations=3 * self.most_iterations)
        return _Iteration(patient, problem, factorisation, shares or {}, from_above=True).run()


class _Iteration:
    """One nonlinear solve: the fields on their way from the first iterate to the solution."""

    def __init__(
        self,
        method: DampedNewton,
        problem: Problem,
        factorisation: Factorisation,
        shares: dict[str, float],
        from_above: bool = False,
    ) -> None:
        self.method, self.problem, self.factorisation, self.from_above = method, problem, factorisation, from_above
        self.small = bool(shares)
        least = min(1.0, ROUND_OFF / method.tolerance)
        self.wanted = {name: max(shares.get(name, 1.0), least) * size for name, size in problem.references.items()}
        vectors = (problem.fields.vec.CreateVector() for _ in range(5))
        self.residual, self.correction, self.simplified, self._gap, self._start = vectors
        self.correction[:] = 0.0
        self._size = Size(problem, problem.references)
        self._wanted_size = (MeanSize if shares else Size)(problem, self.wanted)
        self.count = 0
        self.beyond: Violation | None = None  # what the last correction would leave the physical range with

    def run(self) -> Outcome:
        """Corrections until the fields have converged or an attempt fails."""
        violation = self.problem.admissible.violation()
        if violation:
            return self._violated(Reason.NOT_ADMISSIBLE_AT_START, violation)
        self.problem.residual(self.residual)
        known = False  # whether `correction` answers the present residual
        fresh = not self.factorisation.usable
        while self.count < self.method.most_iterations:
            self.count += 1
            if fresh and not self.factorisation.renew(self.problem):
                return self._failed(Reason.SINGULAR)
            if not (known or self._solve(self.correction)):
                if fresh:
                    return self._failed(Reason.SINGULAR)
                fresh = True  # the old matrix finds none
                continue
            ended, accepted, damping = self._damp(fresh)
            if ended is not None:
                return ended
            if not accepted:  # the matrix was an old one
                fresh, known = True, False
                continue
            if damping == 1.0 and self._converged(self.simplified):
                return self._finish()
            known = damping == 1.0 and self.factorisation.usable
            fresh = not known
            self.correction.data = self.simplified
        if self.beyond:
            return self._violated(self.beyond.reason, self.beyond)
        return self._failed(Reason.TOO_MANY_ITERATIONS, str(self.method.most_iterations))

    def _damp(self, fresh: bool) -> tuple[Outcome | None, bool, float]:
        """Take as much of the correction as helps: the end of the solve if it is one, whether a step was accepted, its part.

        With a `fresh` matrix the step is halved until the fields are admissible and the simplified correction is smaller;
        with an old one a step that does not help at once is taken back.
        """
        problem, fields, method = self.problem, self.problem.fields.vec, self.method
        before, start = self._size(self.correction), self._start
        start.data = fields
        damping, rate, least = 1.0, inf, SHORTEST
        while True:
            fields.data = start - damping * self.correction
            if self.from_above:
                problem.keep_positive(start.FV().NumPy())
            refused = problem.admissible.violation()
            self.beyond = refused or (self.beyond if damping < 1.0 else None)
            if refused is None:
                least = max(least, method.least_damping * damping)
                if damping == 1.0 and self._converged(self.correction, fresh):
                    return self._success(), True, damping
                problem.residual(self.residual)
                if self._solve(self.simplified):
                    rate = self._size(self.simplified) / before
                    if rate <= 1 - damping / 4:
                        break
                    if self.small and rate * before <= STAGNANT:
                        return self._success(), True, damping
                if fresh and problem.kinked and self._renewed_rate(before) <= 1 - damping / 4:
                    return None, True, damping
            if not fresh:
                break
            damping /= 2
            if damping < least:
                fields.data = start
                if self.from_above and self._is_round_off():
                    return self._success(), True, damping
                if self.beyond:
                    return self._violated(self.beyond.reason, self.beyond), False, damping
                if self._past_kinks():
                    return None, True, 1.0
                return self._failed(Reason.STALLED), False, damping
        if not fresh and (refused or not rate < 1):
            fields.data = start
            problem.residual(self.residual)
            return None, False, damping
        self.factorisation.contracted(rate)
        return None, True, damping

    def _past_kinks(self) -> bool:
        """Whether as much of the correction as does work is taken; `simplified` then answers the residual there."""
        if not self.problem.setup.material.kinked or not search(self.problem, self.correction, self.residual):
            return False
        return self.factorisation.renew(self.problem) and self._solve(self.simplified)

    def _renewed_rate(self, before: float) -> float:
        """The size of the correction with a matrix of the present fields, over that `before`; infinite where there is none.

        Across a kink the old matrix says nothing of the new fields: a body that begins to touch meets a stiffness that it
        does not have.
        """
        renewed = self.factorisation.renew(self.problem) and self._solve(self.simplified)
        return self._size(self.simplified) / before if renewed else inf

    def _finish(self) -> Outcome:
        """Apply the simplified correction that passed the test as well."""
        fields, converged = self.problem.fields.vec, self._start
        converged.data = fields
        fields -= self.simplified
        if self.problem.admissible.violation():  # at the edge of the physical range even what is left may be too much
            fields.data = converged
        return self._success()

    def _solve(self, solution: BaseVector) -> bool:
        """The correction that answers the present residual, prescribed values included."""
        excess = self.problem.gap()
        if not excess.any():
            return self.factorisation.solve(self.residual, solution)
        self._gap.FV().NumPy()[:] = excess
        return self.factorisation.solve(self.residual, solution, self._gap)

    def _converged(self, change: BaseVector, fresh: bool = False) -> bool:
        """Whether what is left after a correction, of a `fresh` matrix the correction itself, is below the tolerance."""
        size = self._wanted_size(change)
        return (size if fresh else self.factorisation.left(size)) <= self.method.tolerance

    def _is_round_off(self) -> bool:
        """Whether a correction that nothing reduces is what round-off leaves of unknowns next to nothing."""
        left, tolerance = self.problem.round_off, self.method.tolerance
        units = {name: max(unit, left.get(name, 0.0) / tolerance) for name, unit in self.wanted.items()}
        return Size(self.problem, units)(self.correction) <= tolerance

    def _success(self) -> Outcome:
        violation = self.problem.admissible.violation(solution=True)
        return Outcome(self.count) if violation is None else self._violated(Reason.NOT_A_SOLUTION, violation)

    def _violated(self, reason: Reason, violation: Violation) -> Outcome:
        return Outcome(self.count, Failure(reason, violation.what, violation.where, violation.what))

    def _failed(self, reason: Reason, what: str = "") -> Outcome:
        return Outcome(self.count, Failure(reason, *self.problem.worst(self.correction.FV().NumPy()), what))
