"""The direct linear solver: one symbolic analysis, many numeric factorisations."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from netgen.meshing import NgException
from ngsolve import BaseMatrix, BaseVector, BitArray
from numpy.typing import NDArray

from ngswell import checks
from ngswell.errors import InputError
from ngswell.problem.forms import Form
from ngswell.problem.problem import Problem
from ngswell.problem.tie import Tie
from ngswell.solve.factors import Factors, best_solver, factors, why_not
from ngswell.solve.gathered import Gathered
from ngswell.team import ALONE, Team

MakeFactors = Callable[[BaseMatrix, BitArray, Team], Factors]
"""Makes factors of a matrix, or of the ranks' shares of it, on its free degrees of freedom."""


class LinearSolver:
    """Solves A x = b on the free degrees of freedom, for matrices of one pattern whose values change.

    A linear solver of one's own derives from this; `scene.run(..., solver=MySolver)` calls it with the problem. It gives:

    1. `factorise`: prepare solves with a matrix; False where it is singular or not finite;
    2. `invert`: the solution on the free degrees of freedom; False where none is found;
    3. `linearise`, if it takes another matrix than `problem.linearise()`;
    4. `direct`, `name`: whether problems are of a size that is factorised as a whole, and what to call it.

    `name` is "pardiso", or one of NGSolve's solvers for unsymmetric matrices: "umfpack", or "cudss" on a graphics card where
    NGSolve has it (never tried by us). Raises InputError for a name that does not work here. With `make`, which makes the
    factors, the name is only what it is called.
    """

    direct = True
    """Whether the problem is of a size that is factorised as a whole."""

    def __init__(self, free: BitArray, name: str | None = None, team: Team = ALONE, make: MakeFactors | None = None) -> None:
        self.name, self.team, self._make = name or best_solver(), team, make
        if make is None and (refused := why_not(self.name)):
            raise InputError(f"linear solver {self.name!r} {refused}; without a name it is {best_solver()!r}")
        self._free = free
        self._matrix: BaseMatrix | None = None
        self._factors: Factors | None = None
        self._ties: Ties | None = None
        self.factorisations = self.solves = 0

    def factorise(self, matrix: BaseMatrix) -> bool:
        """Factorise `matrix`; False if it is singular or holds a value that is not finite."""
        if self._factors is None or matrix is not self._matrix:
            self._matrix, self._factors = matrix, self._factors_of(matrix)
        if not self._factors.update():
            self._factors = None
            return False
        self.factorisations += 1
        return True

    def _factors_of(self, matrix: BaseMatrix) -> Factors:
        if self._make is not None:
            return self._make(matrix, self._free, self.team)
        if self.team.alone:
            return factors(self.name, matrix, self._free)
        return Gathered(matrix, self._free, self.team, lambda whole: factors(self.name, whole, self._free))

    def product(self, vector: BaseVector, result: BaseVector) -> None:
        """result = A vector, with the matrix of the last factorisation: over all ranks."""
        result.data = self._matrix * vector
        self.team.sum(result)

    @property
    def analysed_anew(self) -> bool:
        """Whether the last factorisation has an analysis of its own, which later ones share."""
        return self._factors is not None and self._factors.anew

    def linearise(self, problem: Problem) -> BaseMatrix:
        """The matrix to factorise, at the present fields."""
        return problem.linearise()

    def renew(self, problem: Problem) -> bool:
        """Linearise and factorise; False as `factorise`, or where a cell's own unknowns cannot be eliminated."""
        try:
            matrix = self.linearise(problem)
        except NgException:
            return False
        return self.prepare(matrix, problem.ties)

    def prepare(self, matrix: BaseMatrix, ties: Sequence[Tie]) -> bool:
        """Factorise, and find how the free degrees of freedom follow those of `ties`, each of which are one number."""
        if not self.factorise(matrix):
            return False
        self._ties = Ties(self.product, ties, self.invert, matrix.CreateColVector()) if ties else None
        return self._ties is None or self._ties.regular

    def solve(self, right: BaseVector, solution: BaseVector, prescribed: BaseVector | None = None) -> bool:
        """solution = A⁻¹ right, with `prescribed` values where degrees of freedom are not free; False if not finite."""
        moved = right
        if prescribed is not None:
            moved = right.CreateVector()
            self.product(prescribed, moved)
            moved.data = -1 * moved  # not right - moved, which NGSolve evaluates from the left, in place
            moved += right
        solved = self.invert(moved, solution)
        if self._ties is not None:
            self._ties.move(moved, solution)
        if prescribed is not None:
            solution.data += prescribed
        self.solves += 1
        return solved and bool(np.isfinite(solution.FV().NumPy()).all())

    def invert(self, right: BaseVector, solution: BaseVector) -> bool:
        """A⁻¹ on the free degrees of freedom, zero elsewhere; not in place."""
        if self._factors is None:
            raise RuntimeError("factorise before solving")
        return self._factors.solve(right, solution)


class Ties:
    """Degrees of freedom that are one number, by elimination: A x = b where x is free or on a tie, and equal on each tie.

    With the columns t of ones on ties, m = t − A_ff⁻¹ A t is how all follows a tie that moves by one. Then

        x = A_ff⁻¹ b + m q,   tᵀA m q = tᵀ(b − A A_ff⁻¹ b).
    """

    def __init__(
        self,
        product: Callable[[BaseVector, BaseVector], None],
        ties: Sequence[Tie],
        invert: Callable[[BaseVector, BaseVector], bool],
        work: BaseVector,
    ) -> None:
        self._product, self._dofs, self._work = product, [tie.dofs for tie in ties], work
        self._followed: list[NDArray] = []
        stiffness, found = [], True
        for dofs in self._dofs:
            one, answer = work.CreateVector(), work.CreateVector()
            one[:] = 0.0
            one.FV().NumPy()[dofs] = 1.0
            product(one, work)
            found &= invert(work, answer)
            one -= answer
            product(one, work)
            stiffness.append(self._summed(work))
            self._followed.append(one.FV().NumPy().copy())
        self._stiffness = np.array(stiffness).T
        self.regular = bool(found and np.isfinite(self._stiffness).all() and np.linalg.det(self._stiffness) != 0)

    def _summed(self, vector: BaseVector) -> list[float]:
        values = vector.FV().NumPy()
        return [float(values[dofs].sum()) for dofs in self._dofs]

    def move(self, right: BaseVector, solution: BaseVector) -> None:
        """Add what ties move to a `solution` on the free degrees of freedom."""
        self._product(solution, self._work)
        self._work.data = -1 * self._work
        self._work += right
        amounts = np.linalg.solve(self._stiffness, self._summed(self._work))
        for amount, followed in zip(amounts, self._followed, strict=True):
            solution.FV().NumPy()[:] += amount * followed


class CondensedSolver(LinearSolver):
    """The same for the system of a problem, with the unknowns inside cells eliminated cell by cell.

    The factorisation is of their Schur complement: A_bb − A_bi A_ii⁻¹ A_ib.
    """

    def __init__(
        self,
        form: Form,
        free: BitArray,
        name: str | None = None,
        team: Team = ALONE,
        make: MakeFactors | None = None,
    ) -> None:
        super().__init__(free & form.linearised.space.FreeDofs(True), name, team, make)
        self._form, self._condensed = form, form.linearised
        self._work: BaseVector | None = None

    def linearise(self, problem: Problem) -> BaseMatrix:
        return self._form.linearise()

    def solve(self, right: BaseVector, solution: BaseVector, prescribed: BaseVector | None = None) -> bool:
        if self._work is None:
            self._work = right.CreateVector()
        work = self._work
        work.data = self._condensed.harmonic_extension_trans * right
        self.team.sum(work)
        work.data += right
        solved = super().solve(work, solution, prescribed)
        work.data = self._condensed.inner_solve * right
        work.data += self._condensed.harmonic_extension * solution
        self.team.sum(work)
        solution.data += work
        return solved and bool(np.isfinite(solution.FV().NumPy()).all())


def checked_solver(make: Callable[[Problem], LinearSolver], problem: Problem) -> LinearSolver:
    """What `make` makes for the problem. Raises InputError for what is no solver, or none for ranks where they share it."""
    solver = make(problem)
    checks.instance("what solver makes", solver, LinearSolver, "a LinearSolver, as TwoLevelSolver")
    if solver.team is not problem.team:
        raise InputError(
            f"solver: {type(solver).__name__} solves on one rank, and {problem.team.size} share the matrix; leave solver= "
            "out, or hand `team=problem.team` on to LinearSolver if it knows that each rank has a share"
        )
    return solver
