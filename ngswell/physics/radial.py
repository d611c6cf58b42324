"""Radial motions on 1-d meshes in r: cylinders without axial strain, and spheres; solid or hollow."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np
from ngsolve import CF, H1, CoefficientFunction, FESpace, IfPos, Mesh, grad, specialcf, x
from numpy.typing import NDArray

from ngswell.errors import InputError
from ngswell.mesh.points import vertices, vertices_of

AT_CENTRE = 1e-14
"""Radius [mm] below which u/r is its limit."""


class _Radial:
    """One displacement component u on a mesh in r; hoop stretch 1 + u/r. At r = 0 u vanishes, and u/r is its limit u′."""

    dimension = 1
    directions = "r"

    def check(self, mesh: Mesh, fixed: dict[str, str]) -> None:
        name, radii = type(self).__name__, vertices(mesh)[:, 0]
        inner, size = radii.min(), radii.max()
        if inner < -1e-12 * abs(size):
            raise InputError(f"{name}: the mesh crosses the centre, its coordinate r falls to {inner:g} mm")
        at_centre = set(np.flatnonzero(radii <= 1e-12 * size))
        if at_centre - (vertices_of(mesh, fixed["r"]) if fixed["r"] else set()):
            raise InputError(f"{name}: the mesh touches the centre r = 0; hold it there, Roller(boundary, 'r')")

    def space(self, mesh: Mesh, order: int, fixed: dict[str, str]) -> FESpace:
        return H1(mesh, order=order, dirichlet=fixed["r"])

    def flow_gradient(self, p: CoefficientFunction) -> CoefficientFunction:
        return CF((grad(p), 0.0, 0.0))

    def flow_vector(self, components: tuple[float, ...]) -> CoefficientFunction:
        return CF((*components, 0.0, 0.0))

    @property
    def normal(self) -> CoefficientFunction:
        return CF((specialcf.normal(1), 0.0, 0.0))

    def in_space(self, F: CoefficientFunction) -> CoefficientFunction:
        return F

    def rigid_motions(self, point: NDArray) -> NDArray:
        return np.zeros((1, 0))


@dataclass(frozen=True)
class Cylindrical(_Radial):
    """F = diag(1 + u′, 1 + u/r, 1) on a mesh in r: a long cylinder or a tube, or a disc between rigid plates; weight 2πr.

    Amounts are those of a millimetre of its length.
    """

    power = 2

    @property
    def weight(self) -> CoefficientFunction:
        return 2 * pi * x

    def gradient(self, u: CoefficientFunction) -> CoefficientFunction:
        along, hoop = _strains(u)
        return CF((along, 0.0, 0.0, 0.0, hoop, 0.0, 0.0, 0.0, 0.0), dims=(3, 3))

    def area_vector(self, u: CoefficientFunction) -> CoefficientFunction:
        return self.area_stretch(u) * specialcf.normal(1)[0]

    def area_stretch(self, u: CoefficientFunction) -> CoefficientFunction:
        return 1 + _hoop(u)


@dataclass(frozen=True)
class Spherical(_Radial):
    """F = diag(1 + u′, 1 + u/r, 1 + u/r) on a mesh in r: a sphere, a bead or a shell; weight 4πr²."""

    power = 3

    @property
    def weight(self) -> CoefficientFunction:
        return 4 * pi * x * x

    def gradient(self, u: CoefficientFunction) -> CoefficientFunction:
        along, hoop = _strains(u)
        return CF((along, 0.0, 0.0, 0.0, hoop, 0.0, 0.0, 0.0, hoop), dims=(3, 3))

    def area_vector(self, u: CoefficientFunction) -> CoefficientFunction:
        return self.area_stretch(u) * specialcf.normal(1)[0]

    def area_stretch(self, u: CoefficientFunction) -> CoefficientFunction:
        return (1 + _hoop(u)) * (1 + _hoop(u))


def _strains(u: CoefficientFunction) -> tuple[CoefficientFunction, CoefficientFunction]:
    """u′ and u/r inside cells."""
    along = CF(grad(u), dims=(1, 1))[0, 0]
    return along, IfPos(x - AT_CENTRE, u / x, along)


def _hoop(u: CoefficientFunction) -> CoefficientFunction:
    """u/r at an end, which has no derivatives; at the centre nothing is asked for, as it has no area."""
    return IfPos(x - AT_CENTRE, u / x, 0.0 * u)
