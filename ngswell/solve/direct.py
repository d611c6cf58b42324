"""The direct linear solver: one symbolic analysis, many numeric factorisations."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from netgen.meshing import NgException
from ngsolve import H1, BaseMatrix, BaseVector, BilinearForm, BitArray, dx
from ngsolve.meshes import Make1DMesh
from numpy.typing import NDArray

if TYPE_CHECKING:
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


class Point(NamedTuple):
    """Where a matrix is dr/dx: time and step [s], and fields."""

    time: float
    dt: float
    values: NDArray


class LinearSolver:
    """Solves A x = b on the free degrees of freedom, for matrices of one pattern whose values change."""

    direct = True
    """Whether the problem is of a size that is factorised as a whole."""

    def __init__(self, free: BitArray, name: str | None = None) -> None:
        self.name = name or best_solver()
        self._free = free
        self._matrix: BaseMatrix | None = None
        self._inverse: BaseMatrix | None = None
        self.factorisations = self.solves = 0
        self.ready = False
        """Whether there is a factorisation that may be used again."""
        self.contraction: float | None = None
        """The last correction made with the present factorisation over the one before, once there are two."""
        self.factorised: Point | None = None
        """Of the present factorisation."""
        self._analysed: Point | None = None
        """Of the first one: the analysis, which all share, depends on its values."""

    def factorise(self, matrix: BaseMatrix) -> bool:
        """Factorise `matrix`; False if it is singular or holds a value that is not finite."""
        self.ready, self.contraction = False, None
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
        self.ready = True
        return True

    def linearise(self, problem: Problem) -> BaseMatrix:
        """The matrix to factorise, at the present fields."""
        return problem.linearise()

    def renew(self, problem: Problem) -> bool:
        """Linearise and factorise; False as `factorise`, or where a cell's own unknowns cannot be eliminated."""
        at, first = Point(problem.time, problem.dt.Get(), problem.vector.copy()), self._inverse is None
        try:
            matrix = self.linearise(problem)
        except NgException:
            self.ready = False
            return False
        if not self.factorise(matrix):
            return False
        self.factorised = at
        self._analysed = at if first else self._analysed
        return True

    def memory(self) -> dict[str, NDArray]:
        """What makes the next solve, or the next factorisation, the same in another process."""
        kept = {"counts": np.array([self.factorisations, self.solves]), "ready": np.array(self.ready)}
        if self.contraction is not None:
            kept["contraction"] = np.array(self.contraction)
        for name, point in (("analysed", self._analysed), ("factorised", self.factorised)):
            if point is not None:
                kept |= {f"{name} at": np.array([point.time, point.dt]), f"{name} fields": point.values}
        return kept

    def remember(self, problem: Problem, memory: dict[str, NDArray]) -> None:
        """Factorise as before; moves the fields and the clock of `problem`."""
        for name in ("analysed", "factorised"):
            if f"{name} at" in memory:
                time, dt = memory[f"{name} at"].tolist()
                problem.set_time(time)
                problem.dt.Set(dt)
                problem.vector[:] = memory[f"{name} fields"]
                self.renew(problem)
        self.factorisations, self.solves = memory["counts"].tolist()
        self.ready = bool(memory["ready"])
        self.contraction = float(memory["contraction"]) if "contraction" in memory else None

    def solve(self, right: BaseVector, solution: BaseVector, prescribed: BaseVector | None = None) -> bool:
        """solution = A⁻¹ right, with `prescribed` values where degrees of freedom are not free; False if not finite."""
        if prescribed is None:
            solved = self._invert(right, solution)
        else:
            moved = right.CreateVector()
            moved.data = right - self._matrix * prescribed
            solved = self._invert(moved, solution)
            solution.data += prescribed
        self.solves += 1
        return solved and bool(np.isfinite(solution.FV().NumPy()).all())

    def _invert(self, right: BaseVector, solution: BaseVector) -> bool:
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
