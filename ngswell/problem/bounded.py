"""Fields of position on the functions of an unknown, without overshoot where they jump."""

from __future__ import annotations

from typing import Any

import numpy as np
from ngsolve import VOL, CoefficientFunction, ElementId, GridFunction
from numpy.typing import NDArray

from ngswell.mesh.points import points_and_corners


def set_bounded(field: GridFunction, value: CoefficientFunction, region: Any = None) -> None:
    """`Bounded` for one value."""
    Bounded(field, region).set(value)


class Bounded:
    """`field.Set` on the body, or on the boundary `region`, with no value beyond those that the given field takes.

    The projection of a field that jumps inside a cell overshoots: of 0.3 | 0.6 by a fifth, of 1e-6 | 4 below zero. In cells
    where that shows, at integration points or corners, the field becomes linear between bounded values at the vertices; all
    others keep the projection. A value `uniform` in space is projected only.
    """

    def __init__(self, field: GridFunction, region: Any = None, uniform: bool = False) -> None:
        self.field, self._region, self._uniform = field, region, uniform
        self._where = points_and_corners(
            field.space.mesh, VOL if region is None else region, 2 * field.space.globalorder + 2
        )
        self._given: NDArray | None = None

    def set(self, value: CoefficientFunction) -> None:
        """Set the field to `value`; where that is what it was the last time, nothing is to be done."""
        if not len(self._where):
            self._project(value)
            return
        given = np.asarray(value(self._where)).ravel()
        if self._given is None or not np.array_equal(given, self._given):
            self._given = given
            self._project(value)
            if not self._uniform:
                self._bound(float(given.min()), float(given.max()))

    def _project(self, value: CoefficientFunction) -> None:
        where = {} if self._region is None else {"definedon": self._region}
        self.field.Set(value, **where)

    def _bound(self, low: float, high: float) -> None:
        space, where = self.field.space, self._where
        kind = VOL if self._region is None else self._region.VB()
        round_off = 1e-9 * (high - low) + 1e-14 * max(abs(low), abs(high))
        coefficients = self.field.vec.FV().NumPy()
        bounded: set[int] = set()
        while True:
            found = np.asarray(self.field(where)).ravel()
            beyond = (found < low - round_off) | (found > high + round_off)
            cells = set(where["nr"][beyond].tolist()) - bounded if beyond.any() else set()
            if not cells:
                return
            bounded |= cells
            for number in cells:
                dofs = np.array(space.GetDofNrs(ElementId(kind, number)))
                at_vertices = dofs < space.mesh.nv
                coefficients[dofs[~at_vertices]] = 0.0
                coefficients[dofs[at_vertices]] = coefficients[dofs[at_vertices]].clip(low, high)
