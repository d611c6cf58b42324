"""Contents lumped at the vertices: what keeps ions positive in steps shorter than they take to cross a cell."""

from __future__ import annotations

import numpy as np
from ngsolve import (
    ET,
    H1,
    VOL,
    BitArray,
    CoefficientFunction,
    Discontinuous,
    GridFunction,
    IntegrationRule,
    LinearForm,
    Mesh,
    dx,
)

from ngswell.mesh.points import CORNERS

VERTEX_RULES = {
    shape: IntegrationRule(list(corners), [1 / len(corners)] * len(corners))
    for shape, corners in CORNERS.items()
    if shape is not ET.PYRAMID
}
"""Rules whose points are the corners of a cell; `vertex_weights` makes their weights right. Pyramids have none:
gradients are not defined at their tips."""


class Storage:
    """In which of a rank's `cells` contents are integrals, and in which they are lumped at the corners; it starts with none
    of these.

    In steps Δt < h²/(6 κ) what the integrals ask of linear fields after a jump at a boundary alternates from node to node,
    and next to nothing it is negative. Lumped contents do neither, to second order in the cell; but a jump then fills all
    of the half cell beside it at once, so that uptake within the first cell is up to 1.7 times that of the integrals. They
    are for where the integrals fail.

    Functions inside cells and on their sides hold nothing at corners: in lumped cells they follow at once.
    """

    def __init__(self, mesh: Mesh, weight: CoefficientFunction | float, cells: BitArray) -> None:
        self.vertex_weights = vertex_weights(mesh, weight)
        self.integrated, self.lumped = BitArray(mesh.ne), BitArray(mesh.ne)
        self._can_be = BitArray([cell.type in VERTEX_RULES for cell in mesh.Elements(VOL)])
        self._cells = cells
        self.lump(False)

    @property
    def is_lumped(self) -> bool:
        """Whether any contents are lumped."""
        return self._wanted and self._can_be.NumSet() > 0

    def lump(self, wanted: bool) -> None:
        """Lump contents in all cells that are not pyramids, or in none."""
        self._wanted = wanted
        self.lumped.Clear()
        if wanted:
            self.lumped |= self._can_be & self._cells
        self.integrated.Set()
        self.integrated &= self._cells & ~self.lumped


def vertex_weights(mesh: Mesh, weight: CoefficientFunction | float) -> GridFunction:
    """A factor on `VERTEX_RULES` that gives a cell's corner ∫ φ w dX of its function φ of first order, w the `weight`.

    These are the sums of a cell's rows of the mass matrix: exact for fields of first order however a cell is distorted, and
    positive on an axis, too, where w itself vanishes.
    """
    space = Discontinuous(H1(mesh, order=1))
    test = space.TestFunction()
    wanted = LinearForm(weight * test * dx(bonus_intorder=2)).Assemble().vec.FV().NumPy()
    given = LinearForm(test * dx(intrules=VERTEX_RULES)).Assemble().vec.FV().NumPy()
    factor = GridFunction(space)
    factor.vec.FV().NumPy()[:] = np.divide(wanted, given, out=np.zeros_like(wanted), where=given > 0)
    return factor
