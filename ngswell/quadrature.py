"""Points of a mesh, for checks and for reports of where something happens."""

from __future__ import annotations

import numpy as np
from ngsolve import ET, VOL, IntegrationRule, Mesh
from numpy.typing import NDArray

_SHAPES = (ET.SEGM, ET.TRIG, ET.QUAD, ET.TET, ET.HEX, ET.PRISM, ET.PYRAMID)


def points(mesh: Mesh, region: object = VOL, order: int = 4) -> NDArray:
    """Mapped integration points of degree `order` on all elements of `region`; any CoefficientFunction takes them."""
    return mesh.MapToAllElements({shape: IntegrationRule(shape, order) for shape in _SHAPES}, region)


def vertices(mesh: Mesh) -> NDArray:
    """Coordinates of the vertices [mm], one row each, in the order of their numbers."""
    return np.array([vertex.point for vertex in mesh.vertices])
