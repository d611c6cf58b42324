"""Sizes of cells."""

from __future__ import annotations

from ngsolve import CF, VOL, Integrate, Mesh


def cell_size(mesh: Mesh, boundary: str) -> float:
    """Volume of the cells at a boundary over its area: their size normal to it [mm]."""
    region = mesh.Boundaries(boundary)
    nodes = {1: "vertices", 2: "edges", 3: "faces"}[mesh.dim]
    faces = {getattr(element, nodes)[0].nr for element in region.Elements()}
    cells = {cell.nr for cell in mesh.Elements(VOL) if any(face.nr in faces for face in cell.facets)}
    volumes = Integrate(CF(1.0), mesh, VOL, element_wise=True).NumPy()
    return float(volumes[sorted(cells)].sum() / Integrate(CF(1.0), mesh, definedon=region))
