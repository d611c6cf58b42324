"""Factors of a matrix, by the libraries that make them."""

from __future__ import annotations

from functools import cache
from typing import Protocol

import numpy as np
from netgen.meshing import NgException
from ngsolve import BaseMatrix, BaseVector, BitArray
from ngsolve.la import SparseMatrixd

from ngswell.solve import pardiso, umfpack


@cache
def best_solver() -> str:
    """Name of the solver: pardiso where MKL is installed (`pip install ngswell[mkl]`), else umfpack."""
    return "umfpack" if pardiso.library() is None else "pardiso"


@cache
def why_not(name: str) -> str | None:
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

    @property
    def anew(self) -> bool:
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


def factors(name: str, matrix: BaseMatrix, free: BitArray) -> Factors:
    """Factors of a matrix by the solver of that name."""
    if name == "pardiso":
        return pardiso.Pardiso(matrix, free)
    if name == "umfpack" and umfpack.library() is not None:
        return umfpack.Umfpack(matrix, free)
    return NGSolveFactors(matrix, free, name)
