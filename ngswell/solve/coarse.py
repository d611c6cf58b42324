"""The coarse level of the two-level solver: functions of first order, with what stands for the finer displacements."""

from __future__ import annotations

import numpy as np
from ngsolve import BaseMatrix, BaseVector, BitArray
from ngsolve.la import SparseMatrixd
from numpy.typing import NDArray

from ngswell.problem.problem import Problem
from ngswell.solve.direct import LinearSolver
from ngswell.solve.factors import Factors
from ngswell.solve.gathered import Gathered
from ngswell.solve.pattern import rows_and_columns

SHARE = 0.5
"""Of what finer displacements leave. Alone each leaves more than together with its neighbours. With 0.25, 0.5 and 1 a step
of 0.01 s takes 15, 13 and 12 iterations on 8³ cells, and 14, 12 and 12 on 4³."""


class CoarseLevel(LinearSolver):
    """Solves C y = b on the free functions of first order and the numbers. C is A on them, less, between the scalars q,

        ½ A_qf diag(A_ff)⁻¹ A_fq   with the finer displacements f:

    half of what they would leave if each alone were eliminated. Steps far shorter than fluid takes to cross a cell
    preserve volume, which displacements and pressures of first order cannot together: without the term C is all but
    singular there. In long steps the term is small beside what flows.

    Of several ranks the first makes C and solves with it; A_qf and A_fq of all go there too.
    """

    def __init__(self, problem: Problem) -> None:
        free, first, moves, counts = _kinds(problem)
        self.dofs = np.flatnonzero(free & first)
        level = BitArray(free.size)
        level.Clear()
        for dof in self.dofs.tolist():
            level.Set(dof)
        super().__init__(level, team=problem.team)
        self._scalars, self._finer = np.flatnonzero(free & first & ~moves & ~counts), np.flatnonzero(free & ~first & moves)

    def _factors_of(self, matrix: BaseMatrix) -> Factors:
        if self.team.alone:
            return self._made(matrix)
        kind = np.zeros(matrix.height, np.int8)
        kind[self.dofs], kind[self._scalars], kind[self._finer] = 1, 2, 3

        def needed(rows: NDArray, columns: NDArray) -> NDArray:
            """Entries of A on the level, between scalars and finer displacements, and on these displacements' diagonal."""
            row, column = kind[rows], kind[columns]
            of_finer = (row + column == 5) | ((row == 3) & (rows == columns))
            return of_finer | ((row > 0) & (row < 3) & (column > 0) & (column < 3))

        return Gathered(matrix, self._free, self.team, self._made, needed)

    def _made(self, matrix: BaseMatrix) -> Factors:
        return CoarseFactors(matrix, self.dofs, self._scalars, self._finer)


class CoarseFactors:
    """Factors of C for a matrix A: see `CoarseLevel`, and `Factors` for what they do."""

    def __init__(self, matrix: BaseMatrix, dofs: NDArray, scalars: NDArray, finer: NDArray) -> None:
        self.whole, self._dofs, self._finer = matrix, dofs, finer
        self._own = Part(matrix, dofs, dofs)
        self._down, self._up = Part(matrix, scalars, finer), Part(matrix, finer, scalars)
        rows, columns = rows_and_columns(matrix)
        on_diagonal = np.flatnonzero(rows == columns)
        self._diagonal = on_diagonal[np.searchsorted(rows[on_diagonal], finer)]
        self._rows_up = rows_and_columns(self._up.matrix)[0]

        at, size = np.searchsorted(dofs, scalars), dofs.size
        term = self._down.matrix @ self._up.matrix  # kept, as its entries are views
        term_rows, term_columns = rows_and_columns(term)
        keys = [_keys(*rows_and_columns(self._own.matrix), size), _keys(at[term_rows], at[term_columns], size)]
        rows, columns = np.divmod(np.union1d(*keys), size)
        self._matrix = SparseMatrixd.CreateFromCOO(
            rows.astype(np.int32), columns.astype(np.int32), np.zeros(rows.size), size, size
        )
        self._at_own, self._at_term = (np.searchsorted(_keys(rows, columns, size), mine) for mine in keys)
        every = BitArray(size)
        every.Set()
        self._solver = LinearSolver(every)
        self._right, self._found = self._matrix.CreateColVector(), self._matrix.CreateColVector()

    @property
    def anew(self) -> bool:
        """See `Factors`."""
        return self._solver.analysed_anew

    def update(self) -> bool:
        """See `Factors`."""
        entries = _values(self.whole)
        if not np.isfinite(entries).all():
            return False
        for part in (self._own, self._down, self._up):
            part.update(self.whole)
        self._up.values[:] *= SHARE * softness(entries[self._diagonal])[self._rows_up]
        term = self._down.matrix @ self._up.matrix
        values = self._matrix.AsVector().FV().NumPy()
        values[:] = 0.0
        values[self._at_own] = self._own.values
        values[self._at_term] -= _values(term)
        return self._solver.factorise(self._matrix)

    def solve(self, right: BaseVector, solution: BaseVector) -> bool:
        """See `Factors`."""
        self._right.FV().NumPy()[:] = right.FV().NumPy()[self._dofs]
        solved = self._solver.invert(self._right, self._found)
        solution[:] = 0.0
        solution.FV().NumPy()[self._dofs] = self._found.FV().NumPy()
        return solved


def softness(stiffness: NDArray) -> NDArray:
    """One over the stiffness of displacements; zero of one that is not stiff, as past a limit of stability."""
    return np.divide(1.0, stiffness, out=np.zeros_like(stiffness), where=stiffness > 0)


class Part:
    """The submatrix on chosen rows and columns of matrices of one pattern."""

    def __init__(self, matrix: BaseMatrix, rows: NDArray, columns: NDArray) -> None:
        at_row, at_column = (np.full(matrix.height, -1, np.int32) for _ in range(2))
        at_row[rows], at_column[columns] = np.arange(rows.size), np.arange(columns.size)
        row, column = (at[of] for at, of in zip((at_row, at_column), rows_and_columns(matrix), strict=True))
        mine = np.flatnonzero((row >= 0) & (column >= 0))
        self._entries: NDArray = mine.astype(np.int32 if row.size < 2**31 else np.int64)
        self.matrix = SparseMatrixd.CreateFromCOO(row[mine], column[mine], np.zeros(mine.size), rows.size, columns.size)

    @property
    def values(self) -> NDArray:
        """Of its entries, row by row."""
        return self.matrix.AsVector().FV().NumPy()

    def update(self, matrix: BaseMatrix) -> None:
        """Take the values of another matrix of the same pattern."""
        np.take(_values(matrix), self._entries, out=self.values, mode="clip")


def _kinds(problem: Problem) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """Which degrees of freedom are free, of functions of first order or numbers, of displacements, numbers."""
    free = np.array(list(problem.free), bool)
    first, moves, counts = np.zeros((3, free.size), bool)
    moves[problem.ranges[problem.names[0]]] = True
    for name in problem.numbers:
        counts[problem.ranges[name]] = True
    at_vertices = [dof for vertex in problem.mesh.vertices for dof in problem.space.GetDofNrs(vertex) if dof >= 0]
    first[at_vertices] = True
    return free, first | counts, moves, counts


def _values(matrix: BaseMatrix) -> NDArray:
    return np.asarray(matrix.CSR()[0])


def _keys(rows: NDArray, columns: NDArray, size: int) -> NDArray:
    """A number for each entry of a matrix, in their order."""
    return rows.astype(np.int64) * size + columns
