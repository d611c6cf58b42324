"""The part of a matrix on its free degrees of freedom, as arrays that libraries in C take."""

from __future__ import annotations

from ctypes import c_void_p

import numpy as np
from ngsolve import BaseMatrix, BaseVector, BitArray
from numpy.typing import NDArray

from ngswell.solve.pattern import rows_and_columns


def at(array: NDArray) -> c_void_p:
    """Where an array begins."""
    return c_void_p(array.ctypes.data)


class FreePart:
    """Compressed rows of a matrix, its free degrees of freedom counted from 0: `starts`, `columns` and, after `take`, the
    `values`; a `right`-hand side and a `solution`. All arrays stay in their place.
    """

    def __init__(self, matrix: BaseMatrix, free: BitArray) -> None:
        self._all = np.asarray(matrix.CSR()[0])  # a view, of what it holds at any time
        self._matrix, (rows, columns) = matrix, rows_and_columns(matrix)
        mine = np.array(list(free), dtype=bool)
        number = np.cumsum(mine) - 1
        self._dofs, self._entries = np.flatnonzero(mine), np.flatnonzero(mine[rows] & mine[columns])
        counts = np.bincount(number[rows[self._entries]], minlength=self._dofs.size)
        self.starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
        self.columns = number[columns[self._entries]].astype(np.int64)
        self.values = np.zeros(self.columns.size)
        self.right, self.solution = np.zeros(self._dofs.size), np.zeros(self._dofs.size)

    def take(self) -> bool:
        """The values that the matrix has now; False if one of the whole matrix is not finite."""
        np.take(self._all, self._entries, out=self.values, mode="clip")
        return bool(np.isfinite(self._all.sum()))

    def take_right(self, vector: BaseVector) -> None:
        """The right-hand side."""
        np.take(vector.FV().NumPy(), self._dofs, out=self.right, mode="clip")

    def put(self, vector: BaseVector) -> None:
        """The solution into `vector`, and 0 where degrees of freedom are not free."""
        values = vector.FV().NumPy()
        values[:] = 0.0
        values[self._dofs] = self.solution
