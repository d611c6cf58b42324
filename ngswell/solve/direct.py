"""The direct linear solver: one symbolic analysis, many numeric factorisations."""

from __future__ import annotations

from functools import cache

import numpy as np
from netgen.meshing import NgException
from ngsolve import H1, BaseMatrix, BaseVector, BilinearForm, BitArray, dx
from ngsolve.meshes import Make1DMesh

from ngswell.problem.problem import Problem


@cache
def best_solver() -> str:
    """Name of the solver: pardiso where MKL is installed (`pip install ngswell[mkl]`), else umfpack."""
    space = H1(Make1DMesh(1), order=1)
    u, v = space.TnT()
    try:
        BilinearForm(u * v * dx).Assemble().mat.Inverse(space.FreeDofs(), inverse="pardiso")
    except (NgException, RuntimeError):
        return "umfpack"
    return "pardiso"


class LinearSolver:
    """Solves A x = b on the free degrees of freedom, for matrices of one pattern whose values change.

    A linear solver of one's own derives from this; `scene.run(..., solver=MySolver)` calls it with the problem. It gives:

    1. `factorise`: prepare solves with a matrix; False where it is singular or not finite;
    2. `invert`: the solution on the free degrees of freedom; False where none is found;
    3. `linearise`, if it takes another matrix than `problem.linearise()`;
    4. `direct`, `name`: whether problems are of a size that is factorised as a whole, and what to call it.
    """

    direct = True
    """Whether the problem is of a size that is factorised as a whole."""

    def __init__(self, free: BitArray, name: str | None = None) -> None:
        self.name = name or best_solver()
        self._free = free
        self._matrix: BaseMatrix | None = None
        self._inverse: BaseMatrix | None = None
        self.factorisations = self.solves = 0

    def factorise(self, matrix: BaseMatrix) -> bool:
        """Factorise `matrix`; False if it is singular or holds a value that is not finite."""
        if not np.isfinite(matrix.AsVector().FV().NumPy()).all():
            return False
        try:
            if self._inverse is None or matrix is not self._matrix:
                self._inverse, self._matrix = matrix.Inverse(self._free, inverse=self.name), matrix
            else:
                self._inverse.Update()
        except NgException:
            self._inverse = None
            return False
        self.factorisations += 1
        return True

    def linearise(self, problem: Problem) -> BaseMatrix:
        """The matrix to factorise, at the present fields."""
        return problem.linearise()

    def renew(self, problem: Problem) -> bool:
        """Linearise and factorise; False as `factorise`, or where a cell's own unknowns cannot be eliminated."""
        try:
            matrix = self.linearise(problem)
        except NgException:
            return False
        return self.factorise(matrix)

    def solve(self, right: BaseVector, solution: BaseVector, prescribed: BaseVector | None = None) -> bool:
        """solution = A⁻¹ right, with `prescribed` values where degrees of freedom are not free; False if not finite."""
        if prescribed is None:
            solved = self.invert(right, solution)
        else:
            moved = right.CreateVector()
            moved.data = right - self._matrix * prescribed
            solved = self.invert(moved, solution)
            solution.data += prescribed
        self.solves += 1
        return solved and bool(np.isfinite(solution.FV().NumPy()).all())

    def invert(self, right: BaseVector, solution: BaseVector) -> bool:
        """A⁻¹ on the free degrees of freedom, zero elsewhere; not in place."""
        if self._inverse is None:
            raise RuntimeError("factorise before solving")
        solution.data = self._inverse * right
        return True


class CondensedSolver(LinearSolver):
    """The same for the system of a problem, with the unknowns inside cells eliminated cell by cell.

    The factorisation is of their Schur complement: A_bb − A_bi A_ii⁻¹ A_ib.
    """

    def __init__(self, form: BilinearForm, free: BitArray, name: str | None = None) -> None:
        super().__init__(free & form.space.FreeDofs(True), name)
        self._form = form

    def linearise(self, problem: Problem) -> BaseMatrix:
        self._form.AssembleLinearization(problem.fields.vec)
        return self._form.mat

    def solve(self, right: BaseVector, solution: BaseVector, prescribed: BaseVector | None = None) -> bool:
        reduced = right.CreateVector()
        reduced.data = right
        reduced.data += self._form.harmonic_extension_trans * right
        solved = super().solve(reduced, solution, prescribed)
        solution.data += self._form.inner_solve * right
        solution.data += self._form.harmonic_extension * solution
        return solved and bool(np.isfinite(solution.FV().NumPy()).all())


def solver_of(problem: Problem) -> LinearSolver:
    """The solver for the steps of a problem."""
    if problem.condensed is None:
        return LinearSolver(problem.free)
    return CondensedSolver(problem.condensed, problem.free)
