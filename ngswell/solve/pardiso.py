"""MKL's direct solver Pardiso, with parameters of our own: NGSolve's wrapper refines every solve up to sixteen times."""

from __future__ import annotations

from ctypes import CDLL, byref, c_int
from functools import cache
from importlib import metadata
from weakref import finalize

import numpy as np
import pyngcore
from ngsolve import BaseMatrix, BaseVector, BitArray

from ngswell.errors import InputError
from ngswell.solve.free_part import FreePart, at

ANALYSE, FACTORISE, SOLVE, RELEASE = 11, 22, 33, -1
"""Phases of Pardiso."""

UNSYMMETRIC = 11
"""Real and unsymmetric, in Pardiso's list of kinds of matrices."""

PARAMETERS = {
    0: 1,  # what follows holds; the rest is 0
    1: 2,  # order by nested dissection
    7: 0,  # refine solves twice where pivots were perturbed, never elsewhere
    9: 13,  # perturb pivots below 1e-13 of the matrix
    34: 1,  # indices begin at 0
}
"""Entries of `iparm`."""

MATCHING = [10, 12]
"""Those to scale and to permute by the values at the analysis, so that what stands on the diagonal is large."""

PERTURBED = 13
"""Entry of `iparm` with the number of perturbed pivots."""

ACCURATE = 1e-6
"""Residual over right-hand side that a solve may leave where pivots were perturbed."""

MOST_ENTRIES = 2**31 - 1
"""Entries of a matrix that are counted in 32 bits."""


@cache
def library() -> CDLL | None:
    """MKL of the wheel `mkl`; None where it is not installed or does not load."""
    try:
        files = metadata.files("mkl") or []
    except metadata.PackageNotFoundError:
        return None
    for file in files:
        if "mkl_rt" in file.name:
            try:
                found = CDLL(str(file.locate()))
                found.pardiso.restype = None
            except (OSError, AttributeError):  # one to link against, or for another machine
                continue
            return found
    return None


class Pardiso:
    """Factors of a matrix on its free degrees of freedom: one symbolic analysis, many numeric factorisations.

    The analysis is of the pattern. A matrix whose pivots have to be perturbed is analysed anew, if need be with its values,
    and later ones share that. A solve is one pass through the factors; where pivots are perturbed all the same it is refined
    twice, and its residual looked at. Raises InputError for a matrix of more entries than are counted in 32 bits.
    """

    def __init__(self, matrix: BaseMatrix, free: BitArray) -> None:
        self._part = FreePart(matrix, free)
        if self._part.columns.size > MOST_ENTRIES:
            size = self._part.columns.size
            raise InputError(f"Pardiso: the matrix has {size} entries, at most {MOST_ENTRIES} go; use TwoLevelSolver")
        self._system = _System(self._part)
        self._analysed = False
        self.anew = False
        """Whether the last factorisation has an analysis of its own, which later ones share."""
        finalize(self, self._system.call, RELEASE)

    def update(self) -> bool:
        """Factorise the matrix as it is now; False where it is singular or holds a value that is not finite."""
        if not self._part.take():
            return False
        suspended = pyngcore.SuspendTaskManager()  # else its threads and those of MKL wait for each other
        try:
            return self._factorised(pyngcore.GetNumThreads())
        finally:
            del suspended

    def _factorised(self, threads: int) -> bool:
        system, self.anew = self._system, False
        done = self._analysed and system.call(FACTORISE, threads)
        for matching in () if done and not system.perturbed else (0, 1):
            self.anew = True
            system.call(RELEASE)
            system.parameters[MATCHING] = matching
            self._analysed = system.call(ANALYSE, threads)
            done = self._analysed and system.call(FACTORISE, threads)
            if done and not system.perturbed:
                break
        return done

    def solve(self, right: BaseVector, solution: BaseVector) -> bool:
        """solution = A⁻¹ right on the free degrees of freedom, 0 elsewhere; False where it is no solution."""
        system, part = self._system, self._part
        part.take_right(right)
        solved = system.call(SOLVE)
        part.put(solution)
        return solved and (not system.perturbed or system.is_solved())


class _System:
    """What Pardiso is called with, apart so that it outlives what owns it by the call that frees the memory."""

    def __init__(self, part: FreePart) -> None:
        loaded = library()
        if loaded is None:
            raise RuntimeError("Pardiso needs MKL: pip install ngswell[mkl]")
        self._mkl, self._size = loaded, part.solution.size
        self._starts, self._columns = part.starts.astype(np.int32), part.columns.astype(np.int32)
        self.values, self.right, self.solution = part.values, part.right, part.solution
        self._handle, self.parameters = np.zeros(64, np.int64), np.zeros(64, np.int32)
        self.parameters[list(PARAMETERS)] = list(PARAMETERS.values())
        one, self._phase, self._error = byref(c_int(1)), c_int(), c_int()
        self._arguments = (
            *(at(self._handle), one, one, byref(c_int(UNSYMMETRIC)), byref(self._phase), byref(c_int(self._size))),
            *(at(self.values), at(self._starts), at(self._columns), None, one, at(self.parameters)),
            *(byref(c_int(0)), at(self.right), at(self.solution), byref(self._error)),
        )

    def call(self, phase: int, threads: int = 1) -> bool:
        """One phase; False where Pardiso tells of an error. Solves are too short for more than one thread."""
        if not self._size:
            return True
        self._phase.value, self._error.value = phase, 0
        before = self._mkl.MKL_Set_Num_Threads_Local(threads)
        self._mkl.pardiso(*self._arguments)
        self._mkl.MKL_Set_Num_Threads_Local(before)
        return self._error.value == 0

    @property
    def perturbed(self) -> bool:
        """Whether pivots of the last factorisation were perturbed."""
        return bool(self.parameters[PERTURBED] > 0)

    def is_solved(self) -> bool:
        """Whether the residual is as small as that of a solution."""
        products = self.values * self.solution[self._columns]
        left = np.abs(np.add.reduceat(products, self._starts[:-1]) - self.right)
        return bool(left.max() <= ACCURATE * np.abs(self.right).max())
