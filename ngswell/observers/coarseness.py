"""Where and when the mesh was too coarse during a run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from ngsolve import L2, VOL, GridFunction
from numpy.typing import NDArray

from ngswell.analysis.recovery import Recovery
from ngswell.errors import InputError, place
from ngswell.files import Tree
from ngswell.mesh.points import vertices_of
from ngswell.observers.base import Observer
from ngswell.problem.problem import Problem

LARGEST_PART = 1 / 5
"""With half of the squared error in more than this share of the cells, no part of the mesh stands out."""

ALONG = 1 / 3
"""A boundary is named when the worst cells along it hold at least this share of their squared error."""

NOTHING = 1e-6
"""Estimates below this come from Newton's tolerance."""


class Worst(NamedTuple):
    """The cell with the largest estimated error: number, centre [mm], time [s], share in the relative error [-], unknown."""

    cell: int
    place: tuple[float, ...]
    time: float
    value: float
    unknown: str


class Coarseness(Observer):
    """Estimated errors in space (`ngswell.analysis.recovery.Recovery`), relative to each gradient's largest norm of the run.

        coarseness = Coarseness()
        scene.run(until=8000, observers=[coarseness])
        print(coarseness.report())

    Relative to the run as a whole, because a layer that has just begun is thinner than any cell and does not matter yet.
    For smooth fields the numbers are the errors, to some ten percent; where a mesh does not resolve a layer, and for what
    a cell inherits from others, they are smaller than the errors. They compare meshes and places.
    Raises InputError when asked before a run, or used with a second mesh.
    """

    def __init__(self, when: float | Sequence[float] | None = None) -> None:
        super().__init__(when)
        self._mesh: Any = None  # of the run
        self._sizes: dict[str, float] = {}
        self._totals: dict[str, list[float]] = {}
        self._largest: dict[str, NDArray] = {}
        self._at: dict[str, NDArray] = {}

    def prepare(self, problem: Problem, begin: float, until: float) -> None:
        self._mesh = problem.mesh
        self._recovery = Recovery(problem)

    def record(self, problem: Problem, time: float) -> None:
        estimate = self._recovery.estimate()
        for name, error in estimate.errors.items():
            largest = self._largest.setdefault(name, np.zeros(len(error)))
            at = self._at.setdefault(name, np.full(len(error), time))
            at[error > largest] = time
            np.maximum(largest, error, out=largest)
            self._sizes[name] = max(self._sizes.get(name, 0.0), estimate.sizes[name])
            self._totals.setdefault(name, []).append(float(np.linalg.norm(error)))

    def state(self) -> Tree:
        return {"size": self._sizes, "total": self._totals, "largest": self._largest, "at": self._at}

    def restore(self, state: Tree) -> None:
        self._sizes = {name: float(value) for name, value in state.get("size", {}).items()}
        self._totals = {name: value.tolist() for name, value in state.get("total", {}).items()}
        self._largest, self._at = dict(state.get("largest", {})), dict(state.get("at", {}))

    def table(self) -> dict[str, NDArray]:
        return {"total [-]": self.total}

    def _relative(self) -> dict[str, NDArray]:
        if not self._largest:
            raise InputError("Coarseness: nothing was recorded; pass it to scene.run(..., observers=[...]) first")
        return {name: error / self._sizes[name] for name, error in self._largest.items()}

    @property
    def cells(self) -> NDArray:
        """Each cell's share in the relative error of a gradient: the largest over time and unknowns [-]."""
        return np.max(list(self._relative().values()), axis=0)

    @property
    def total(self) -> NDArray:
        """Relative error over the body at each `time`, of the unknown where it is largest [-]."""
        return np.max([np.array(self._totals[name]) / self._sizes[name] for name in self._relative()], axis=0)

    @property
    def field(self) -> GridFunction:
        """`cells` as a field that is constant in each cell, for `VTKOutput` or to mark cells."""
        field = GridFunction(L2(self._mesh, order=0))
        field.vec.FV().NumPy()[:] = self.cells
        return field

    def worst(self) -> Worst:
        """The cell with the largest error, and when and in which unknown."""
        relative = self._relative()
        unknown = max(relative, key=lambda name: relative[name].max())
        cell = int(np.argmax(relative[unknown]))
        time, value = float(self._at[unknown][cell]), float(relative[unknown][cell])
        return Worst(cell, self._centre(cell), time, value, unknown)

    def report(self) -> str:
        """Where and when the mesh is too coarse, and along which boundaries thinner cells would help."""
        worst, total, squares = self.worst(), self.total, self.cells**2
        peak = int(np.argmax(total))
        # The fewest cells that hold half of the squared error.
        ranked = np.argsort(squares)[::-1]
        count = int(np.searchsorted(np.cumsum(squares[ranked]), 0.5 * squares.sum())) + 1
        share = self._along_boundaries(ranked[:count], squares)
        listed = ", ".join(f"{name} ({100 * part:.0f} %)" for name, part in share.items())
        graded = ", ".join(name for name, part in share.items() if part >= ALONG)
        if total[peak] < NOTHING:
            advice = "No gradients to resolve."
        elif count > LARGEST_PART * len(squares):
            advice = "The error is spread over the body: more cells everywhere, or a higher order."
        elif graded:
            advice = f"Thinner cells along {graded} would help (`grade`)."
        else:
            advice = "It does not lie along a boundary: more cells around the worst, or a higher order."
        return "\n".join(
            [
                f"Coarseness: the estimated error of a gradient reaches {100 * total[peak]:.2g} % at {self.time[peak]:g} s.",
                f"Worst cell: {worst.cell} of {len(squares)} at {place(worst.place)} mm, {worst.time:g} s, "
                f"with {100 * worst.value:.2g} % in {worst.unknown}.",
                f"Half of the squared error lies in {count} cells{f'; of that along {listed}' if listed else ''}.",
                advice,
            ]
        )

    def _along_boundaries(self, cells: NDArray, squares: NDArray) -> dict[str, float]:
        """Share of the squared error of `cells` in those that touch each boundary, the largest first."""
        mesh = self._mesh
        corners = {cell.nr: {vertex.nr for vertex in cell.vertices} for cell in mesh.Elements(VOL)}
        shares = {}
        for name in sorted(set(mesh.GetBoundaries())):
            on_boundary = vertices_of(mesh, name)
            touching = [cell for cell in cells if corners[cell] & on_boundary]
            if touching:
                shares[name] = float(squares[touching].sum() / squares[cells].sum())
        return dict(sorted(shares.items(), key=lambda item: -item[1]))

    def _centre(self, cell: int) -> tuple[float, ...]:
        places = [self._mesh[vertex].point for vertex in list(self._mesh.Elements(VOL))[cell].vertices]
        return tuple(map(float, np.mean(places, axis=0)))
