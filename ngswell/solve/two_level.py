"""An iterative linear solver for large bodies in space: Krylov's method with a two-level preconditioner."""

from __future__ import annotations

import numpy as np
from ngsolve import ELEMENT, VOL, BaseMatrix, BaseVector, NodeId
from numpy.typing import NDArray

from ngswell.errors import InputError
from ngswell.mesh.shares import shares_of_vertices
from ngswell.problem.problem import Problem
from ngswell.solve.coarse import CoarseLevel, Part
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

MOST_ITERATIONS = 60
"""Iterations of a solve. Steps of all sizes need some ten; sixty leave a matrix that is all but singular."""


class TwoLevelSolver(LinearSolver):
    """Solves A x = b on the free degrees of freedom of a problem iteratively: `scene.run(..., solver=TwoLevelSolver)`.

    The preconditioner B is an exact solve on the functions of first order (`CoarseLevel`), and then exact solves on the
    cells around each vertex, added up (`Patches`). The bases are hierarchical: these are submatrices of A, up to what stands
    for finer displacements. B A x = B b is solved to `tolerance`, every coefficient counted in the unit of its field
    (`Problem.references`), in the space of what earlier solves with A have tried (`Krylov`). Iterations hardly depend on the
    size of cells and steps.

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
        self._coarse = CoarseLevel(problem)
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
            self._parts = _Parts(self._dofs_of_patches, matrix, self._coarse.dofs, self.team)
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
        parts.level.FV().NumPy()[:] = self._correction.FV().NumPy()[self._coarse.dofs]
        self._left.data -= parts.columns.matrix * parts.level
        parts.shared.sum(self._left.FV().NumPy())
        found = parts.patches(self._left.FV().NumPy())
        parts.shared.sum(found)
        return (self._correction.FV().NumPy()[own] + found[own]) / self._units[own]

    def _on_level(self) -> BaseVector:
        """What the shares in `_left` are together on the coarse level; other unknowns are of no account."""
        if self.team.alone:
            return self._left
        level = self._coarse.dofs
        values = self._left.FV().NumPy()[level]
        self.team.sum_values(values)
        self._values.FV().NumPy()[level] = values
        return self._values


class _Parts:
    """What is made for the pattern of the first matrix."""

    def __init__(self, dofs: list[list[int]], matrix: BaseMatrix, level: NDArray, team: Team) -> None:
        self.patches, self.columns = Patches(dofs, matrix, team), Part(matrix, np.arange(matrix.height), level)
        self.level = self.columns.matrix.CreateRowVector()
        self.shared = Shared(matrix, self.patches.unknowns, team)
        self.krylov = Krylov(self.shared.count, MOST_ITERATIONS, team)


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
