"""How the cells of a mesh hang together: sides that two of them share, sides of one alone, and the parts of the body."""

from __future__ import annotations

from functools import cached_property
from itertools import chain, combinations

import numpy as np
from ngsolve import EDGE, FACE, VERTEX, VOL, CoefficientFunction, Mesh, NodeId
from numpy.typing import NDArray

from ngswell.errors import InputError, place
from ngswell.mesh.points import points


class Sides:
    """The sides of the cells of a mesh: points in 1-d, edges in 2-d, faces in 3-d."""

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh
        of_cell = [[facet.nr for facet in cell.facets] for cell in mesh.Elements(VOL)]
        cells = np.repeat(np.arange(len(of_cell)), [len(numbers) for numbers in of_cell])
        sides = np.fromiter(chain.from_iterable(of_cell), int)
        order = np.argsort(sides, kind="stable")
        times = np.bincount(sides)[sides[order]]
        self.cells = len(of_cell)
        self.neighbours = cells[order][times == 2].reshape(-1, 2)
        """Pairs of cells that share a side."""
        self.free = sides[order][times == 1]
        """Numbers of the sides of one cell alone: the surface of the body, where the mesh is sound."""
        self.behind = cells[order][times == 1]
        """The cell of each of them."""

    @cached_property
    def corners(self) -> list[list[int]]:
        """Vertices of each free side."""
        kind = {1: VERTEX, 2: EDGE, 3: FACE}[self.mesh.dim]
        if kind is VERTEX:
            return [[number] for number in self.free.tolist()]
        return [[vertex.nr for vertex in self.mesh[NodeId(kind, number)].vertices] for number in self.free.tolist()]

    @cached_property
    def simplices(self) -> tuple[NDArray, NDArray]:
        """Segments or triangles that cover the free sides: the side's position, and vertices. Four corners may come in any
        order: all four triangles of three of them, which cover the side twice."""
        pieces = [(side, piece) for side, these in enumerate(self.corners) for piece in combinations(these, self.mesh.dim)]
        return np.array([side for side, _ in pieces]), np.array([piece for _, piece in pieces])

    @cached_property
    def _surface(self) -> set[frozenset[int]]:
        return {frozenset(corners) for corners in self.corners}

    def of_surface(self, what: str, names: list[str]) -> list[str]:
        """The names, of single boundaries; InputError for one that lies inside the body: what acts from outside has no side
        there."""
        for name in names:
            for side in self.mesh.Boundaries(name).Elements():
                if frozenset(vertex.nr for vertex in side.vertices) not in self._surface:
                    where = place(np.mean([self.mesh[vertex].point for vertex in side.vertices], axis=0))
                    raise InputError(
                        f"{what}: boundary {name!r} is inside the body near {where} mm, where it can be observed or held; "
                        "baths, flows, pressures and obstacles need its surface"
                    )
        return names

    def jumps(self, field: CoefficientFunction, share: float) -> bool:
        """Whether values of a field in two neighbouring cells are further apart than all of those inside both, by more than
        that share of its largest value: no smooth field that the cells resolve does so."""
        where = points(self.mesh)
        values, cell = field(where).ravel(), where["nr"]
        low, high = np.full(self.cells, np.inf), np.full(self.cells, -np.inf)
        np.minimum.at(low, cell, values)
        np.maximum.at(high, cell, values)
        one, other = self.neighbours.T
        apart = np.maximum(low[one] - high[other], low[other] - high[one])
        inside = (high - low)[one] + (high - low)[other]
        return bool((apart > inside + share * np.abs(values).max()).any())

    @cached_property
    def parts(self) -> list[NDArray]:
        """Vertices of each part of the body that shared sides connect."""
        label = np.arange(self.cells)
        while True:
            least = label[self.neighbours].min(axis=1)
            if (label[self.neighbours] == least[:, None]).all():
                break
            for cells in self.neighbours.T:
                np.minimum.at(label, cells, least)
            label = label[label]
        if not label.any():
            return [np.arange(self.mesh.nv)]
        found: dict[int, set[int]] = {}
        for cell, number in zip(self.mesh.Elements(VOL), label.tolist(), strict=True):
            found.setdefault(number, set()).update(vertex.nr for vertex in cell.vertices)
        return [np.array(sorted(part)) for part in found.values()]


def check_hinges(mesh: Mesh, parts: list[NDArray]) -> None:
    """Refuse parts that share a corner or an edge but no side: what holds there, and how far, only the mesh would say."""
    numbers, times = np.unique(np.concatenate(parts), return_counts=True)
    if (times > 1).any():
        where = place(mesh[NodeId(VERTEX, int(numbers[np.argmax(times > 1)]))].point)
        by = "a corner" if mesh.dim == 2 else "a corner or an edge"
        raise InputError(
            f"mesh: two parts of the body hang together near {where} mm by {by} alone, as by a hinge: join them along whole "
            "sides of cells, or keep them apart"
        )
