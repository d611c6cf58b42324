"""An iterative linear solver for large bodies in space: GMRES with a two-level preconditioner."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from netgen.meshing import NgException
from ngsolve import ELEMENT, VOL, BaseMatrix, BaseVector, BitArray, NodeId
from ngsolve.krylovspace import GMResSolver
from numpy.typing import NDArray

from ngswell.errors import InputError
from ngswell.problem.problem import Problem
from ngswell.solve.direct import LinearSolver

TOLERANCE = 1e-8
"""GMRES stops when the preconditioned residual has fallen by this factor. That residual estimates the error."""

ROUND_OFF = 1e-13
"""GMRES also stops below this residual, in units of the fields. At a state of rest the right-hand side is round-off only."""

MOST_ITERATIONS = 40
"""Iterations of GMRES. A matrix that needs more gets the larger coarse level. There three times as many are allowed."""

EASY = 10
"""Iterations on the larger coarse level. After a solve with so few, the next matrix gets the smaller level."""


class TwoLevelSolver(LinearSolver):
    """Solves A x = b on the free degrees of freedom of a problem by GMRES: `scene.run(..., solver=TwoLevelSolver)`.

    The preconditioner is one cycle on the whole system, all fields together: exact solves on the cells around each vertex
    (block Gauss-Seidel), an exact solve on the coarse level, which is spanned by the functions of first order, and the
    solves around vertices again in reverse order. The bases are hierarchical: all these are submatrices of A.

    In steps far shorter than fluid takes to cross a cell, displacements have to preserve volume, and those of first
    order cannot do that together with pressures of first order. The coarse level then takes in what belongs to facets,
    as the element of Bernardi and Raugel does; the number of iterations decides.

    Where facets have no functions of their own (tetrahedra of order 2), the larger level is the whole system.

    GMRES measures each field in units of its reference (`Problem.references`). Raises InputError for a body in 1-d.
    """

    direct = False

    def __init__(self, problem: Problem) -> None:
        if problem.mesh.dim == 1:
            raise InputError("TwoLevelSolver is for bodies in the plane and in space; leave solver= out for a column")
        super().__init__(problem.free)
        self.iterations = 0  # of the last solve
        self._patches, self._levels = _patches(problem), _coarse_levels(problem)
        self._units = problem.sizes
        self._level = 0
        self._smoother: BaseMatrix | None = None
        self._coarse: LinearSolver | None = None

    @property
    def with_facets(self) -> bool:
        """Whether the coarse level is the larger one."""
        return self._level > 0

    def factorise(self, matrix: BaseMatrix) -> bool:
        """Prepare the preconditioner of `matrix`; False if a part of it is singular or a value is not finite."""
        if self._level and self.iterations <= EASY:
            self._level, self._coarse = 0, None
        self._matrix, self._smoother = matrix, None
        if self._coarse is None:
            self._coarse = LinearSolver(self._levels[self._level])
        if not self._coarse.factorise(matrix):
            return False
        try:
            self._smoother = matrix.CreateBlockSmoother(self._patches)
        except NgException:
            return False
        self.factorisations += 1
        return True

    def invert(self, right: BaseVector, solution: BaseVector) -> bool:
        """A⁻¹ on the free degrees of freedom; False if GMRES does not converge."""
        if self._matrix is None or self._smoother is None:
            raise RuntimeError("factorise before solving")
        if self._level == 0:
            if self._gmres(right, solution, MOST_ITERATIONS):
                return True
            self._level, self._coarse = 1, LinearSolver(self._levels[1])
            if not self._coarse.factorise(self._matrix):
                return False
        return self._gmres(right, solution, 3 * MOST_ITERATIONS)

    def _gmres(self, right: BaseVector, solution: BaseVector, most: int) -> bool:
        assert self._coarse is not None
        cycle = _Cycle(self._matrix, self._smoother, self._coarse)
        found = gmres(self._matrix, cycle, self._units, right, solution, most)
        self.iterations = most if found is None else found
        return found is not None


def gmres(
    matrix: BaseMatrix, preconditioner: BaseMatrix, units: NDArray, right: BaseVector, solution: BaseVector, most: int
) -> int | None:
    """solution = A⁻¹ right to `TOLERANCE`, every coefficient counted in its unit; iterations, None if `most` are too few."""

    def product(a: BaseVector, b: BaseVector) -> float:
        return float(np.dot(a.FV().NumPy() / units, b.FV().NumPy() / units))

    method = GMResSolver(matrix, preconditioner, tol=TOLERANCE, atol=ROUND_OFF, maxiter=most + 1, innerproduct=product)
    method.Solve(right, solution)
    converged = method.residuals[-1] <= max(TOLERANCE * method.residuals[0], ROUND_OFF)
    if not converged or not np.isfinite(solution.FV().NumPy()).all():
        return None
    return method.iterations - 1  # it counts the start


class _Cycle(BaseMatrix):
    """The preconditioner as a linear map."""

    def __init__(self, matrix: BaseMatrix, smoother: BaseMatrix, coarse: LinearSolver) -> None:
        super().__init__()
        self._matrix, self._smoother, self._coarse = matrix, smoother, coarse
        self._left, self._correction = matrix.CreateColVector(), matrix.CreateColVector()

    def Height(self) -> int:
        return self._matrix.height

    def Width(self) -> int:
        return self._matrix.width

    def CreateVector(self, column: bool) -> BaseVector:
        return self._matrix.CreateColVector()

    def Mult(self, right: BaseVector, result: BaseVector) -> None:
        result[:] = 0.0
        self._smoother.Smooth(result, right)
        self._left.data = right - self._matrix * result
        self._coarse.solve(self._left, self._correction)
        result.data += self._correction
        self._smoother.SmoothBack(result, right)


def _patches(problem: Problem) -> list[list[int]]:
    """Free degrees of freedom inside the cells around each vertex; on their outer boundary only those of the body's."""
    space, mesh = problem.space, problem.mesh
    patches = [list(space.GetDofNrs(vertex)) for vertex in mesh.vertices]
    for nodes in (mesh.edges, mesh.faces)[: mesh.dim - 1]:
        for node in nodes:
            for vertex in node.vertices:
                patches[vertex.nr] += space.GetDofNrs(node)
    for cell in mesh.Elements(VOL):
        for vertex in cell.vertices:
            patches[vertex.nr] += space.GetDofNrs(NodeId(ELEMENT, cell.nr))
    free = [[dof for dof in patch if dof >= 0 and problem.free[dof]] for patch in patches]
    return [patch for patch in free if patch]


def _coarse_levels(problem: Problem) -> tuple[BitArray, BitArray]:
    """Free degrees of freedom of first order and numbers, and with them those of facets."""

    def of(dofs: Iterable[int]) -> BitArray:
        chosen = BitArray(problem.space.ndof)
        chosen.Clear()
        for dof in dofs:
            if dof >= 0 and problem.free[dof]:
                chosen.Set(dof)
        return chosen

    dofs_of, mesh = problem.space.GetDofNrs, problem.mesh
    numbers = [problem.ranges[name].start for name in problem.numbers]
    vertices = of([*numbers, *(dof for vertex in mesh.vertices for dof in dofs_of(vertex))])
    with_facets = vertices | of(dof for facet in mesh.facets for dof in dofs_of(facet))
    return vertices, with_facets if with_facets.NumSet() > vertices.NumSet() else problem.free
