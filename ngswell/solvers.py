"""The direct linear solver: one symbolic analysis, many numeric factorisations."""

from __future__ import annotations

from functools import cache

import numpy as np
from netgen.meshing import NgException
from ngsolve import H1, BaseMatrix, BaseVector, BilinearForm, BitArray, dx
from ngsolve.meshes import Make1DMesh


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
    """Solves A x = b on the free degrees of freedom, for matrices of one pattern whose values change."""

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

    @property
    def matrix(self) -> BaseMatrix:
        """What was factorised last."""
        return self._matrix

    def solve(self, right: BaseVector, solution: BaseVector) -> bool:
        """solution = A⁻¹ right; False if the result is not finite."""
        if self._inverse is None:
            raise RuntimeError("factorise before solving")
        solution.data = self._inverse * right
        self.solves += 1
        return bool(np.isfinite(solution.FV().NumPy()).all())
