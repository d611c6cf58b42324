"""An iterative linear solver for large bodies in space: Krylov's method with a two-level preconditioner."""

from __future__ import annotations

import numpy as np
from ngsolve import ELEMENT, VOL, BaseMatrix, BaseVector, BitArray, NodeId
from ngsolve.la import SparseMatrixd
from numpy.typing import NDArray

from ngswell.errors import InputError
from ngswell.mesh.shares import shares_of_vertices
from ngswell.problem.problem import Problem
from ngswell.solve.direct import LinearSolver
from ngswell.solve.krylov import Krylov
from ngswell.solve.patches import Patches
from ngswell.solve.shared import Shared
from ngswell.team import Team

TOLERANCE = 1e-3
"""A solve stops when the preconditioned residual, which estimates the error, has fallen by this factor. Corrections are all
that is solved for, and Newton's method looks at what they leave: a kept matrix leaves up to a third anyway."""

ROUND_OFF = 1e-13
"""It also stops below this residual, in units of the fields. At a state of rest the right-hand side is round-off only."""

MOST_ITERATIONS = 150
"""Iterations of a solve. A step of 1e-4 of the time that fluid takes to cross a cell needs some forty."""


class TwoLevelSolver(LinearSolver):
    """Solves A x = b on the free degrees of freedom of a problem iteratively: `scene.run(..., solver=TwoLevelSolver)`.

    The preconditioner B is an exact solve on the coarse level, which is spanned by the functions of first order, and then
    exact solves on the cells around each vertex, added up. The bases are hierarchical: all these are submatrices of A.
    B A x = B b is solved to `tolerance`, every coefficient counted in the unit of its field (`Problem.references`), in the
    space of what earlier solves with A have tried (`Krylov`).

    In steps far shorter than fluid takes to cross a cell, displacements have to preserve volume, which those of first
    order cannot together with pressures of first order: iterations rise to three or four times their number.

    Of several ranks each has its share of A, of the cells around vertices and of the vectors of Krylov's method; the coarse
    level is solved on the first.

    Raises InputError for a body in 1-d.
    """

    direct = False
    tolerance = TOLERANCE

    def __init__(self, problem: Problem) -> None:
        if problem.mesh.dim == 1:
            raise InputError("TwoLevelSolver is for bodies in the plane and in space; leave solver= out for a column")
        super().__init__(problem.free, team=problem.team)
        self._units = problem.sizes
        self._level = _coarse_level(problem)
        self._coarse = LinearSolver(self._level, team=self.team)
        self._dofs_of_patches = _patches(problem)
        self._parts: _Parts | None = None  # known from the first matrix on
        self._values, self._left, self._correction = (problem.fields.vec.CreateVector() for _ in range(3))

    @property
    def iterations(self) -> int:
        """Of the last solve."""
        return self._parts.krylov.iterations if self._parts else 0

    def factorise(self, matrix: BaseMatrix) -> bool:
        """Prepare the preconditioner of `matrix`; False if a part of it is singular or a value is not finite."""
        self._matrix = None
        if not self._coarse.factorise(matrix):
            return False
        if self._parts is None:
            self._parts = _Parts(self._dofs_of_patches, matrix, self._level, self.team)
        self._parts.krylov.forget()
        if not self._parts.patches.prepare(matrix):
            return False
        self._parts.columns.update(matrix)
        self._matrix = matrix
        self.factorisations += 1
        return True

    def invert(self, right: BaseVector, solution: BaseVector) -> bool:
        """A⁻¹ on the free degrees of freedom, to `tolerance`; False if that takes too many iterations."""
        if self._matrix is None or self._parts is None:
            raise RuntimeError("factorise before solving")
        own = self._parts.shared.own
        self._left[:] = 0.0
        self._left.FV().NumPy()[own] = right.FV().NumPy()[own]
        found = self._parts.krylov.solve(self._product, self._cycle(), self.tolerance, ROUND_OFF)
        if found is None:
            return False
        solution[:] = 0.0
        solution.FV().NumPy()[own] = found * self._units[own]
        self.team.sum(solution)
        return bool(np.isfinite(solution.FV().NumPy()).all())

    def _product(self, values: NDArray) -> NDArray:
        """B A x, in units of the fields, on the unknowns of this rank."""
        assert self._parts is not None
        own, vector = self._parts.shared.own, self._values.FV().NumPy()
        vector[own] = values * self._units[own]
        self._parts.shared.spread(vector)
        self._left.data = self._matrix * self._values
        return self._cycle()

    def _cycle(self) -> NDArray:
        """B r for the shares of r in `_left`, in units of the fields, on the unknowns of this rank."""
        assert self._parts is not None
        parts, own = self._parts, self._parts.shared.own
        self._coarse.invert(self._on_level(), self._correction)
        self._left.data -= parts.columns.matrix * self._correction
        parts.shared.sum(self._left.FV().NumPy())
        found = parts.patches(self._left.FV().NumPy())
        parts.shared.sum(found)
        return (self._correction.FV().NumPy()[own] + found[own]) / self._units[own]

    def _on_level(self) -> BaseVector:
        """What the shares in `_left` are together on the coarse level; other unknowns are of no account."""
        if self.team.alone:
            return self._left
        level = np.flatnonzero(self._level)
        values = self._left.FV().NumPy()[level]
        self.team.sum_values(values)
        self._values.FV().NumPy()[level] = values
        return self._values


class _Parts:
    """What is made for the pattern of the first matrix."""

    def __init__(self, dofs: list[list[int]], matrix: BaseMatrix, level: BitArray, team: Team) -> None:
        self.patches, self.columns = Patches(dofs, matrix, team), _Columns(matrix, level)
        self.shared = Shared(matrix, self.patches.unknowns, team)
        self.krylov = Krylov(self.shared.count, MOST_ITERATIONS, team)


class _Columns:
    """The columns of a matrix that belong to chosen degrees of freedom, as a matrix."""

    def __init__(self, matrix: BaseMatrix, chosen: BitArray) -> None:
        _, columns, starts = (np.asarray(part) for part in matrix.CSR())
        mine, size = np.array(list(chosen), dtype=bool)[columns], matrix.height
        before = np.concatenate([[0], np.cumsum(mine)])[starts.astype(np.intp)]  # in the rows above
        rows = np.repeat(np.arange(size, dtype=np.int32), np.diff(before))
        self._entries: NDArray = np.flatnonzero(mine).astype(np.int32 if mine.size < 2**31 else np.int64)
        self.matrix = SparseMatrixd.CreateFromCOO(rows, columns[mine].astype(np.int32), np.zeros(rows.size), size, size)

    def update(self, matrix: BaseMatrix) -> None:
        """Take the values of another matrix of the same pattern."""
        np.take(np.asarray(matrix.CSR()[0]), self._entries, out=self.matrix.AsVector().FV().NumPy(), mode="clip")


def _patches(problem: Problem) -> list[list[int]]:
    """Free degrees of freedom inside the cells around each vertex of this rank; on their outer boundary the body's only."""
    space, mesh = problem.space, problem.mesh
    mine = shares_of_vertices(mesh, problem.share.of_cells) == problem.team.rank
    patches = {vertex.nr: list(space.GetDofNrs(vertex)) for vertex in mesh.vertices if mine[vertex.nr]}
    for nodes in (mesh.edges, mesh.faces)[: mesh.dim - 1]:
        for node in nodes:
            for vertex in node.vertices:
                if mine[vertex.nr]:
                    patches[vertex.nr] += space.GetDofNrs(node)
    for cell in mesh.Elements(VOL):
        for vertex in cell.vertices:
            if mine[vertex.nr]:
                patches[vertex.nr] += space.GetDofNrs(NodeId(ELEMENT, cell.nr))
    free = [[dof for dof in patch if dof >= 0 and problem.free[dof]] for patch in patches.values()]
    return [patch for patch in free if patch]


def _coarse_level(problem: Problem) -> BitArray:
    """Free degrees of freedom of first order, and numbers."""
    chosen = BitArray(problem.space.ndof)
    chosen.Clear()
    for name in problem.numbers:
        chosen.Set(problem.ranges[name].start)
    for vertex in problem.mesh.vertices:
        for dof in problem.space.GetDofNrs(vertex):
            if dof >= 0:
                chosen.Set(dof)
    return chosen & problem.free
