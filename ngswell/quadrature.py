"""Points of a mesh, for checks and for reports of where something happens."""

from __future__ import annotations

import numpy as np
from ngsolve import BND, ET, VOL, BoundaryFromVolumeCF, CoefficientFunction, Integrate, IntegrationRule, Mesh
from numpy.typing import NDArray

_SHAPES = (ET.SEGM, ET.TRIG, ET.QUAD, ET.TET, ET.HEX, ET.PRISM, ET.PYRAMID)


def points(mesh: Mesh, region: object = VOL, order: int = 4) -> NDArray:
    """Mapped integration points of degree `order` on all elements of `region`; any CoefficientFunction takes them."""
    return mesh.MapToAllElements({shape: IntegrationRule(shape, order) for shape in _SHAPES}, region)


def integral_on_boundary(
    mesh: Mesh, field: CoefficientFunction, boundary: str, order: int, measure: CoefficientFunction | float = 1.0
) -> float:
    """Integral over a boundary of a field of the body (and its derivatives) times `measure`; in 1-d the sum of values."""
    region = mesh.Boundaries(boundary)
    if mesh.dim == 1:  # NGSolve's traces of derivatives need a boundary with area
        return sum(field(mesh(*mesh[element.vertices[0]].point)) for element in region.Elements())
    return Integrate(BoundaryFromVolumeCF(field) * measure, mesh, BND, definedon=region, order=order)


def vertices_of(mesh: Mesh, boundary: str) -> set[int]:
    """Numbers of the vertices on a boundary ("a|b")."""
    return {vertex.nr for element in mesh.Boundaries(boundary).Elements() for vertex in element.vertices}


def vertices(mesh: Mesh) -> NDArray:
    """Coordinates of the vertices [mm], one row each, in the order of their numbers."""
    return np.array([vertex.point for vertex in mesh.vertices])
