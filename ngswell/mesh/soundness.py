"""Whether a mesh is sound: cells with a size, which share whole sides with their neighbours."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np
from ngsolve import ET, VERTEX, VOL, ElementId, IntegrationRule, Mesh, NodeId, specialcf
from numpy.typing import NDArray

from ngswell.calls import in_turn
from ngswell.errors import InputError, place
from ngswell.mesh.parts import Sides, check_hinges
from ngswell.mesh.points import with_corners

_CELLS = {
    1: {"segment": ET.SEGM},
    2: {"triangle": ET.TRIG, "quadrilateral": ET.QUAD},
    3: {"tetrahedron": ET.TET, "hexahedron": ET.HEX, "prism": ET.PRISM, "pyramid": ET.PYRAMID},
}

_TOUCHING = 1e-6
"""Sides closer than this share of their size touch: files have six digits or more, and no gap so narrow stays open."""

_AT_ONCE = 20_000
"""Pairs of a side and a point that are looked at together."""


@in_turn
def check_mesh(mesh: Mesh) -> None:
    """Refuse cells that are turned inside out or have no size, meshes that do not conform, and hinges, by place.

    What is asked of the cells: `check_cells`; of their sides: `check_sides`. A scene does both by itself.
    """
    check_cells(mesh)
    check_sides(Sides(mesh))


def check_cells(mesh: Mesh) -> None:
    """Refuse cells that are turned inside out or have no size, by number and place.

    At the corners and the integration points of degree 4 the determinant of the cell's mapping has to have the sign it has
    in most cells of the same shape (which one depends on how the mesh generator numbers the corners), and the thickness,
    determinant over largest stretch to the power d − 1, has to be above round-off of the body's size. The determinant of a
    straight quadrilateral is linear, so that its corners decide: their angles have to stay below 180°.
    """
    round_off = 1e-12 * float(np.ptp(mesh.ngmesh.Coordinates(), axis=0).max())
    for name, shape in _CELLS[mesh.dim].items():
        where = mesh.MapToAllElements({shape: with_corners(shape, 4)}, VOL)
        if not len(where):
            continue
        mapping = specialcf.JacobianMatrix(mesh.dim)(where).reshape(-1, mesh.dim, mesh.dim)
        det = np.linalg.det(mapping)
        stretch = np.linalg.norm(mapping, axis=1).max(axis=1)
        thickness = np.sign(np.median(det)) * det / np.maximum(stretch, round_off) ** (mesh.dim - 1)
        bad = np.unique(where["nr"][~(thickness > round_off)])
        if len(bad):
            found = thickness[where["nr"] == bad[0]]
            fault = "is turned inside out" if found.min() < -round_off else "has no size"
            if (found[: len(IntegrationRule(shape, 4))] > round_off).all():
                fault = "has a corner of 180° or more"
            vertices = [mesh[vertex].point for vertex in mesh[ElementId(VOL, int(bad[0]))].vertices]
            where = place(np.mean(vertices, axis=0))
            raise InputError(
                f"mesh: cell {bad[0]}, a {name} near {where} mm, {fault}"
                f"{f', as {len(bad) - 1} more' if len(bad) > 1 else ''}: move its corners, or mesh the body again"
            )


def check_sides(sides: Sides) -> None:
    """Refuse cells that touch without sharing a side: fields would jump there and nothing would flow, as at a crack.

    Nowhere may the corners or the middle of a side that belongs to one cell alone lie on another such side: there are no
    vertices twice at one place, no vertices within the side of another cell (hanging nodes), and no sides that cover each
    other. Curved sides count as straight. Nor may parts of the body hang together by less than a side.
    """
    _check_shapes(sides.mesh)
    surface = _Surface(sides)
    for simplices, points in _candidates(surface.low, surface.high, surface.points):
        others = ~surface.own(simplices, points)
        simplices, points = simplices[others], points[others]
        touching = surface.touching(simplices, points)
        if touching.any():
            first = int(np.argmax(touching))
            raise InputError(surface.fault(int(simplices[first]), int(points[first])))
    check_hinges(sides.mesh, sides.parts)


def _check_shapes(mesh: Mesh) -> None:
    """Refuse triangles on quadrilaterals that have their corners: NGSolve takes one of them for the whole side."""
    corners = {ET.PRISM: 18, ET.PYRAMID: 16, ET.HEX: 24, ET.TET: 12}  # of all sides of a cell
    if mesh.dim < 3 or (len(types := {cell.type for cell in mesh.Elements(VOL)}) == 1 and types <= {ET.TET, ET.HEX}):
        return
    of_side = [len(face.vertices) for face in mesh.faces]
    for cell in mesh.Elements(VOL):
        if sum(of_side[face.nr] for face in cell.faces) != corners[cell.type]:
            where = np.mean([mesh[vertex].point for vertex in cell.vertices], axis=0)
            raise InputError(_fault(where, *_DIFFER))


def _fault(where: NDArray, what: str, remedy: str) -> str:
    return f"mesh: cells touch near {place(where)} mm without sharing a side, as along a crack: {what}; {remedy}"


_DIFFER = "their sides differ", "mesh the body again, so that cells share whole sides"


class _Surface:
    """The sides of one cell alone, in simplices, and the points that may lie on none of the others: corners and middles."""

    def __init__(self, sides: Sides) -> None:
        numbers = sorted({number for corners in sides.corners for number in corners})
        row = {number: index for index, number in enumerate(numbers)}
        corners = [[row[number] for number in these] for these in sides.corners]
        places = np.array([sides.mesh[NodeId(VERTEX, number)].point for number in numbers])
        self.vertices, round_off = len(numbers), 1e-13 * float(np.ptp(places, axis=0).max())
        self.side, pieces = sides.simplices
        self.simplices = np.searchsorted(numbers, pieces)
        self.corners = np.array([(these + these[:1] * 4)[:4] for these in corners])
        middles = np.array([places[these].mean(axis=0) for these in corners])
        self.points = np.concatenate([places, middles])
        sizes = np.array([self._size(places[these], round_off) for these in corners])
        at_vertices = np.full(self.vertices, np.inf)
        np.minimum.at(at_vertices, self.corners, sizes[:, None])
        self.sizes, self.side_sizes = np.concatenate([at_vertices, sizes]), sizes
        reach = _TOUCHING * sizes[self.side, None]
        ends = places[self.simplices]
        self.low, self.high = ends.min(axis=1) - reach, ends.max(axis=1) + reach

    @staticmethod
    def _size(places: NDArray, round_off: float) -> float:
        """Shortest distance of two corners of a side, at least what makes round-off touch."""
        lengths = [float(np.linalg.norm(a - b)) for a, b in combinations(places, 2)]
        return max(round_off / _TOUCHING, min(lengths, default=0.0))

    def own(self, simplices: NDArray, points: NDArray) -> NDArray:
        """Whether each point is a corner or the middle of the simplex' side."""
        side = self.side[simplices]
        return (self.corners[side] == points[:, None]).any(axis=1) | (points == self.vertices + side)

    def touching(self, simplices: NDArray, points: NDArray) -> NDArray:
        """Whether each point lies on the simplex beside it."""
        corners, where = self.points[self.simplices[simplices]], self.points[points]
        edges = np.moveaxis(corners[:, 1:] - corners[:, :1], 1, 2)
        offset = (where - corners[:, 0])[..., None]
        local, lengths = (np.linalg.pinv(edges) @ offset)[..., 0], np.linalg.norm(edges, axis=1)
        distance = np.linalg.norm((offset - edges @ local[..., None])[..., 0], axis=1)
        side = self.side[simplices]
        reach = _TOUCHING * np.minimum(self.side_sizes[side], self.sizes[points])
        beyond = (local.sum(axis=1) - 1) * lengths.max(axis=1, initial=0.0)
        return (local * lengths >= -reach[:, None]).all(axis=1) & (beyond <= reach) & (distance <= reach)

    def fault(self, simplex: int, point: int) -> str:
        """What is wrong where a point lies on a simplex."""
        near = self.points[self.corners[self.side[simplex]]] - self.points[point]
        what, remedy = _DIFFER
        if point < self.vertices:
            what = "a vertex of one lies within a side of the other (a hanging node)"
            if np.linalg.norm(near, axis=1).min() <= _TOUCHING * self.sizes[point]:
                what, remedy = "there are two vertices", "merge the vertices (Glue in netgen.occ, Coherence in Gmsh)"
        return _fault(self.points[point], what, remedy)


def _candidates(low: NDArray, high: NDArray, points: NDArray) -> Iterator[tuple[NDArray, NDArray]]:
    """Pairs (box, point) of points in boxes from `low` to `high`, some at a time. Halves the points until few are left."""
    todo = [(np.arange(len(low)), np.arange(len(points)))]
    while todo:
        boxes, inside = todo.pop()
        places = points[inside]
        spread = np.ptp(places, axis=0) if len(inside) else np.zeros(1)
        if len(boxes) * len(inside) <= _AT_ONCE or not spread.any():
            within = (places >= low[boxes, None]) & (places <= high[boxes, None])
            found, those = np.nonzero(within.all(axis=2))
            yield boxes[found], inside[those]
            continue
        axis = int(np.argmax(spread))
        middle = (places[:, axis].min() + places[:, axis].max()) / 2
        first = places[:, axis] <= middle
        todo += [(boxes[low[boxes, axis] <= middle], inside[first]), (boxes[high[boxes, axis] > middle], inside[~first])]
