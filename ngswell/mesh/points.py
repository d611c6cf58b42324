"""Points of a mesh, for checks and for reports of where something happens."""

from __future__ import annotations

from functools import cache
from hashlib import sha256

import numpy as np
from ngsolve import BND, CF, ET, VOL, BoundaryFromVolumeCF, CoefficientFunction, Integrate, IntegrationRule, Mesh, x, y, z
from numpy.typing import NDArray

_SHAPES = (ET.SEGM, ET.TRIG, ET.QUAD, ET.TET, ET.HEX, ET.PRISM, ET.PYRAMID)

CORNERS: dict[ET, list[tuple[float, ...]]] = {
    ET.SEGM: [(0,), (1,)],
    ET.TRIG: [(0, 0), (1, 0), (0, 1)],
    ET.QUAD: [(0, 0), (1, 0), (1, 1), (0, 1)],
    ET.TET: [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)],
    ET.HEX: [(r, s, t) for r in (0, 1) for s in (0, 1) for t in (0, 1)],
    ET.PRISM: [(r, s, t) for r, s in ((0, 0), (1, 0), (0, 1)) for t in (0, 1)],
    ET.PYRAMID: [(r, s, 0) for r in (0, 1) for s in (0, 1)],  # at the tip gradients are not defined
}
"""Corners of the reference cells."""


def rules(order: int) -> dict[ET, IntegrationRule]:
    """Integration rules of degree `order`, by shape of cell."""
    return {shape: IntegrationRule(shape, order) for shape in _SHAPES}


def points(mesh: Mesh, region: object = VOL, order: int = 4) -> NDArray:
    """Mapped integration points of degree `order` on all elements of `region`; any CoefficientFunction takes them."""
    return mesh.MapToAllElements(rules(order), region)


def points_and_corners(mesh: Mesh, region: object, order: int) -> NDArray:
    """The same, and the corners of the elements."""
    return mesh.MapToAllElements({shape: with_corners(shape, order) for shape in CORNERS}, region)


@cache
def with_corners(shape: ET, order: int) -> IntegrationRule:
    """The integration rule of degree `order` on a cell, and its corners with no weight."""
    rule, corners = IntegrationRule(shape, order), CORNERS[shape]
    inside = [point if isinstance(point, tuple) else (point,) for point in rule.points]
    return IntegrationRule([*inside, *corners], [*rule.weights, *(0.0 for _ in corners)])


def corners(mesh: Mesh) -> NDArray:
    """Mapped corners of all cells of the body, each from the inside of its cell."""
    rules = {shape: IntegrationRule(list(places), [0.0] * len(places)) for shape, places in CORNERS.items()}
    return mesh.MapToAllElements(rules, VOL)


def integral_on_boundary(
    mesh: Mesh, field: CoefficientFunction, boundary: str, order: int, measure: CoefficientFunction | float = 1.0
) -> float:
    """Integral over a boundary, in 1-d the sum over ends, of a field of the body (and its derivatives) times `measure`."""
    region = mesh.Boundaries(boundary)
    if mesh.dim == 1:  # NGSolve's traces of derivatives need a boundary with area
        return sum((measure * field)(mesh(*mesh[element.vertices[0]].point)) for element in region.Elements())
    return Integrate(BoundaryFromVolumeCF(field) * measure, mesh, BND, definedon=region, order=order)


def vertices_of(mesh: Mesh, boundary: str) -> set[int]:
    """Numbers of the vertices on a boundary ("a|b")."""
    return {vertex.nr for element in mesh.Boundaries(boundary).Elements() for vertex in element.vertices}


def vertices(mesh: Mesh) -> NDArray:
    """Coordinates of the vertices [mm], one row each, in the order of their numbers."""
    return np.array([vertex.point for vertex in mesh.vertices])


def digest(mesh: Mesh) -> str:
    """What tells a mesh from another, in every process: its vertices, cells with their materials, sides, curved shape."""
    cells = [(e.mat, [v.nr for v in e.vertices]) for region in (VOL, BND) for e in mesh.Elements(region)]
    shape = CF((x, y, z)[: mesh.dim])(points(mesh)).astype(np.float32)  # processors differ in the last digits of a double
    return sha256(repr((vertices(mesh).tolist(), cells, shape.tolist())).encode()).hexdigest()
