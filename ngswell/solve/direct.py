"""The direct linear solver: one symbolic analysis, many numeric factorisations."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import Protocol

import numpy as np
from netgen.meshing import NgException
from ngsolve import BaseMatrix, BaseVector, BitArray
from ngsolve.la import SparseMatrixd
from numpy.typing import NDArray

from ngswell.errors import InputError
from ngswell.problem.discretisation import Tie
from ngswell.problem.forms import Form
from ngswell.problem.problem import Problem
from ngswell.solve import pardiso, umfpack


@cache
def best_solver() -> str:
    """Name of the solver: pardiso where MKL is installed (`pip install ngswell[mkl]`), else umfpack."""
    return "umfpack" if pardiso.library() is None else "pardiso"


@cache
def _why_not(name: str) -> str | None:
    """Why there is no such solver here, tried on a matrix of one entry; None where there is."""
    if name == "sparsecholesky" or name.endswith("spd"):
        return "is for symmetric matrices, which dr/dx is not"
    if name == "pardiso":
        return "needs MKL: pip install ngswell[mkl]" if pardiso.library() is None else None
    one = SparseMatrixd.CreateFromCOO([0], [0], [1.0], 1, 1)
    try:
        one.Inverse(inverse=name)
    except (NgException, ImportError, RuntimeError) as error:
        return f"is not to be had from this NGSolve ({error})"
    return None


class Factors(Protocol):
    """Factors of a matrix on its free degrees of freedom."""

    anew: bool
    """Whether the last factorisation has an analysis of its own, which later ones share."""

    def update(self) -> bool:
        """Factorise the matrix as it is now; False where it is singular or holds a value that is not finite."""

    def solve(self, right: BaseVector, solution: BaseVector) -> bool:
        """solution = A⁻¹ right on the free degrees of freedom, 0 elsewhere; False where none is found."""


class NGSolveFactors:
    """Factors by one of the solvers that NGSolve calls itself."""

    def __init__(self, matrix: BaseMatrix, free: BitArray, name: str) -> None:
        self._matrix, self._free, self._name = matrix, free, name
        self._inverse: BaseMatrix | None = None
        self.anew = False

    def update(self) -> bool:
        """See `Factors`."""
        if not np.isfinite(self._matrix.AsVector().FV().NumPy()).all():
            return False
        self.anew = self._inverse is None
        try:
            if self._inverse is None:
                self._inverse = self._matrix.Inverse(self._free, inverse=self._name)
            else:
                self._inverse.Update()
        except NgException:
            self._inverse = None
            return False
        return True

    def solve(self, right: BaseVector, solution: BaseVector) -> bool:
        """See `Factors`."""
        solution.data = self._inverse * right
        return True


def _factors(name: str, matrix: BaseMatrix, free: BitArray) -> Factors:
    if name == "pardiso":
        return pardiso.Pardiso(matrix, free)
    if name == "umfpack" and umfpack.library() is not None:
        return umfpack.Umfpack(matrix, free)
    return NGSolveFactors(matrix, free, name)


class LinearSolver:
    """Solves A x = b on the free degrees of freedom, for matrices of one pattern whose values change.

    A linear solver of one's own derives from this; `scene.run(..., solver=MySolver)` calls it with the problem. It gives:

    1. `factorise`: prepare solves with a matrix; False where it is singular or not finite;
    2. `invert`: the solution on the free degrees of freedom; False where none is found;
    3. `linearise`, if it takes another matrix than `problem.linearise()`;
    4. `direct`, `name`: whether problems are of a size that is factorised as a whole, and what to call it.

    `name` is "pardiso", or one of NGSolve's solvers for unsymmetric matrices: "umfpack", or "cudss" on a graphics card where
    NGSolve has it (never tried by us). Raises InputError for a name that does not work here.
    """

    direct = True
    """Whether the problem is of a size that is factorised as a whole."""

    def __init__(self, free: BitArray, name: str | None = None) -> None:
        self.name = name or best_solver()
        if refused := _why_not(self.name):
            raise InputError(f"linear solver {self.name!r} {refused}; without a name it is {best_solver()!r}")
        self._free = free
        self._matrix: BaseMatrix | None = None
        self._factors: Factors | None = None
        self._ties: Ties | None = None
        self.factorisations = self.solves = 0

    def factorise(self, matrix: BaseMatrix) -> bool:
        """Factorise `matrix`; False if it is singular or holds a value that is not finite."""
        if self._factors is None or matrix is not self._matrix:
            self._matrix, self._factors = matrix, _factors(self.name, matrix, self._free)
        if not self._factors.update():
            self._factors = None
            return False
        self.factorisations += 1
        return True

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
        self._ties = Ties(matrix, ties, self.invert) if ties else None
        return self._ties is None or self._ties.regular

    def solve(self, right: BaseVector, solution: BaseVector, prescribed: BaseVector | None = None) -> bool:
        """solution = A⁻¹ right, with `prescribed` values where degrees of freedom are not free; False if not finite."""
        moved = right
        if prescribed is not None:
            moved = right.CreateVector()
            moved.data = right - self._matrix * prescribed
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

    def __init__(self, matrix: BaseMatrix, ties: Sequence[Tie], invert: Callable[[BaseVector, BaseVector], bool]) -> None:
        self._matrix, self._dofs, self._work = matrix, [tie.dofs for tie in ties], matrix.CreateColVector()
        self._followed: list[NDArray] = []
        stiffness, found = [], True
        for dofs in self._dofs:
            one, answer = matrix.CreateColVector(), matrix.CreateColVector()
            one[:] = 0.0
            one.FV().NumPy()[dofs] = 1.0
            self._work.data = matrix * one
            found &= invert(self._work, answer)
            one -= answer
            self._work.data = matrix * one
            stiffness.append(self._summed(self._work))
            self._followed.append(one.FV().NumPy().copy())
        self._stiffness = np.array(stiffness).T
        self.regular = bool(found and np.isfinite(self._stiffness).all() and np.linalg.det(self._stiffness) != 0)

    def _summed(self, vector: BaseVector) -> list[float]:
        values = vector.FV().NumPy()
        return [float(values[dofs].sum()) for dofs in self._dofs]

    def move(self, right: BaseVector, solution: BaseVector) -> None:
        """Add what ties move to a `solution` on the free degrees of freedom."""
        self._work.data = right - self._matrix * solution
        amounts = np.linalg.solve(self._stiffness, self._summed(self._work))
        for amount, followed in zip(amounts, self._followed, strict=True):
            solution.FV().NumPy()[:] += amount * followed


class CondensedSolver(LinearSolver):
    """The same for the system of a problem, with the unknowns inside cells eliminated cell by cell.

    The factorisation is of their Schur complement: A_bb − A_bi A_ii⁻¹ A_ib.
    """

    def __init__(self, form: Form, free: BitArray, name: str | None = None) -> None:
        super().__init__(free & form.linearised.space.FreeDofs(True), name)
        self._form, self._condensed = form, form.linearised
        self._reduced: BaseVector | None = None

    def linearise(self, problem: Problem) -> BaseMatrix:
        return self._form.linearise()

    def solve(self, right: BaseVector, solution: BaseVector, prescribed: BaseVector | None = None) -> bool:
        if self._reduced is None:
            self._reduced = right.CreateVector()
        self._reduced.data = right
        self._reduced.data += self._condensed.harmonic_extension_trans * right
        solved = super().solve(self._reduced, solution, prescribed)
        solution.data += self._condensed.inner_solve * right
        solution.data += self._condensed.harmonic_extension * solution
        return solved and bool(np.isfinite(solution.FV().NumPy()).all())


def solver_of(problem: Problem) -> LinearSolver:
    """The solver for the steps of a problem."""
    if problem.condensed is None:
        return LinearSolver(problem.free)
    return CondensedSolver(problem.condensed, problem.free)
