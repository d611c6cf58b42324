"""What a rank integrates over: its cells, and the sides of the body beside them."""

from __future__ import annotations

from typing import Any

import numpy as np
from ngsolve import CF, L2, VOL, BitArray, CoefficientFunction, FESpace, GridFunction, Mesh
from numpy.typing import NDArray

from ngswell.mesh.shares import shares, shares_of_sides
from ngswell.team import Team


class Share:
    """A rank's part of all integrals: the sums over ranks are the integrals. Alone it is the whole body."""

    def __init__(self, mesh: Mesh, team: Team) -> None:
        self.team = team
        self.of_cells: NDArray = np.zeros(mesh.ne, dtype=int)
        """The rank of each cell."""
        self.cells = BitArray(mesh.ne)
        self.cells.Set()
        self.over_body: dict[str, Any] = {}
        """Where integrals over the body are taken, as NGSolve's dx takes it."""
        self.over_sides: dict[str, Any] = {}
        """The same of boundaries."""
        self.factor: CoefficientFunction | None = None
        """1 in its cells and 0 elsewhere, for integrals over sides from within cells, which know of no elements."""
        if team.alone:
            return
        self.of_cells = shares(mesh, team.size)
        self.cells = BitArray(list(self.of_cells == team.rank))
        self.over_body = {"definedonelements": self.cells}
        self.over_sides = {"definedonelements": BitArray(list(shares_of_sides(mesh, self.of_cells) == team.rank))}
        factor = GridFunction(L2(mesh, order=0))
        factor.vec.FV().NumPy()[:] = self.of_cells == team.rank
        self.factor = CF(factor)

    def of_points(self, points: NDArray) -> NDArray:
        """Those of the mapped `points` that are in its cells."""
        return points if self.team.alone else points[self.of_cells[points["nr"]] == self.team.rank]

    def describe(self, space: FESpace) -> str:
        """Cells and unknowns of each rank, and how many of them several ranks have."""
        have = np.zeros((self.team.size, space.ndof), dtype=bool)
        for cell in space.Elements(VOL):
            have[self.of_cells[cell.nr], [dof for dof in cell.dofs if dof >= 0]] = True
        cells, unknowns = np.bincount(self.of_cells, minlength=self.team.size), have.sum(axis=1)
        shared = int((have.sum(axis=0) > 1).sum())
        return (
            f"{self.team.size} ranks: {_span(cells)} cells and {_span(unknowns)} unknowns each, {shared} of them shared; "
            f"the largest share of cells is {cells.max() / cells.mean():.3g} times the mean"
        )


def _span(numbers: NDArray) -> str:
    return f"{numbers.min()} to {numbers.max()}" if numbers.min() < numbers.max() else f"{numbers.min()}"
