"""Structured meshes with named boundaries."""

from __future__ import annotations

from ngsolve import Mesh
from ngsolve.meshes import Make1DMesh, MakeStructured2DMesh

from ngswell.errors import InputError


def column(height: float, cells: int) -> Mesh:
    """A segment of `height` [mm] with boundaries "bottom" (x = 0) and "top"."""
    _positive("column", (height, cells))
    mesh = Make1DMesh(cells, mapping=lambda s: height * s)
    mesh.ngmesh.SetBCName(0, "bottom")
    mesh.ngmesh.SetBCName(1, "top")
    return mesh


def rectangle(width: float, height: float, nx: int, ny: int) -> Mesh:
    """Quadrilaterals on [0, width] × [0, height] [mm] with boundaries "bottom", "right", "top", "left"."""
    _positive("rectangle", (width, height, nx, ny))
    return MakeStructured2DMesh(quads=True, nx=nx, ny=ny, mapping=lambda s, t: (width * s, height * t))


def _positive(name: str, values: tuple[float, ...]) -> None:
    if not all(value > 0 for value in values):
        raise InputError(f"{name}: sizes and numbers of cells have to be positive, got {values}")
