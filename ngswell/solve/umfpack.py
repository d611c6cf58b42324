"""UMFPACK as NGSolve brings it, without the iterative refinement that makes NGSolve's own solves up to four times dearer."""

from __future__ import annotations

from ctypes import CDLL, byref, c_int64, c_void_p
from functools import cache
from importlib import metadata
from weakref import finalize

import numpy as np
from ngsolve import BaseMatrix, BaseVector, BitArray

from ngswell.solve.free_part import FreePart, at

TRANSPOSED = 1
"""UMFPACK's name for a solve with the transposed matrix: it takes columns, and is given rows."""

FUNCTIONS = ("defaults", "symbolic", "numeric", "solve", "free_symbolic", "free_numeric")
"""Those that are called, with 64-bit integers."""

CONTROL, INFO = 20, 90
"""Sizes of its tables of parameters and of answers."""

REFINEMENT, LEAST_PIVOT = 7, 67
"""Places in them: most steps of iterative refinement, and the smallest pivot over the largest one."""

DOUBTFUL = 1e-10
"""Below this share solves are refined up to twice."""


@cache
def library() -> CDLL | None:
    """NGSolve's library with UMFPACK in it; None where its functions cannot be called from outside."""
    for wheel in ("netgen-mesher", "ngsolve"):
        try:
            files = metadata.files(wheel) or []
        except metadata.PackageNotFoundError:
            continue
        for file in files:
            if "ngla" in file.name:
                try:
                    found = CDLL(str(file.locate()))
                except OSError:
                    continue
                if all(hasattr(found, f"umfpack_dl_{name}") for name in FUNCTIONS):
                    return found
    return None


class Umfpack:
    """Factors of a matrix on its free degrees of freedom: one symbolic analysis, many numeric factorisations.

    The first matrix is analysed, and one whose factorisation fails with the analysis of another. A solve is one pass through
    the factors, whose pivots are chosen for accuracy; where they are small all the same it is refined.
    """

    def __init__(self, matrix: BaseMatrix, free: BitArray) -> None:
        self._part = FreePart(matrix, free)
        self._system = _System(self._part)
        self._analysed = False
        self.anew = False
        """Whether the last factorisation has an analysis of its own, which later ones share."""
        finalize(self, self._system.release)

    def update(self) -> bool:
        """Factorise the matrix as it is now; False where it is singular or holds a value that is not finite."""
        if not self._part.take():
            return False
        self.anew = False
        if self._analysed and self._system.factorise():
            return True
        self.anew = True
        self._analysed = self._system.analyse()
        return self._analysed and self._system.factorise()

    def solve(self, right: BaseVector, solution: BaseVector) -> bool:
        """solution = A⁻¹ right on the free degrees of freedom, 0 elsewhere; False where it is no solution."""
        self._part.take_right(right)
        solved = self._system.solve()
        self._part.put(solution)
        return solved


class _System:
    """What UMFPACK is called with, apart so that it outlives what owns it by the call that frees the memory."""

    def __init__(self, part: FreePart) -> None:
        loaded = library()
        if loaded is None:
            raise RuntimeError("NGSolve's UMFPACK cannot be called from outside")
        self._umfpack, self._part, self._size = loaded, part, c_int64(part.solution.size)
        self._control, self._info = np.zeros(CONTROL), np.zeros(INFO)
        self._symbolic, self._numeric = c_void_p(), c_void_p()
        loaded.umfpack_dl_defaults(at(self._control))
        self._matrix = at(part.starts), at(part.columns), at(part.values)
        self._tables = at(self._control), at(self._info)

    def _done(self) -> bool:
        return bool(self._info[0] == 0 or not self._size.value)

    def analyse(self) -> bool:
        """The symbolic analysis, of the present values too."""
        self.release()
        self._umfpack.umfpack_dl_symbolic(self._size, self._size, *self._matrix, byref(self._symbolic), *self._tables)
        return self._done()

    def factorise(self) -> bool:
        """The numeric factorisation; False where the matrix is singular."""
        self._umfpack.umfpack_dl_free_numeric(byref(self._numeric))
        self._umfpack.umfpack_dl_numeric(*self._matrix, self._symbolic, byref(self._numeric), *self._tables)
        self._control[REFINEMENT] = 0 if self._info[LEAST_PIVOT] > DOUBTFUL else 2
        return self._done()

    def solve(self) -> bool:
        """A solve with the last factorisation."""
        vectors = at(self._part.solution), at(self._part.right)
        self._umfpack.umfpack_dl_solve(c_int64(TRANSPOSED), *self._matrix, *vectors, self._numeric, *self._tables)
        return self._done()

    def release(self) -> None:
        """Give the memory back."""
        self._umfpack.umfpack_dl_free_symbolic(byref(self._symbolic))
        self._umfpack.umfpack_dl_free_numeric(byref(self._numeric))
