"""How the body may deform: displacement space, deformation gradient, measures of volume and boundary."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Any, Protocol, runtime_checkable

import numpy as np
from ngsolve import CF, H1, CoefficientFunction, Cof, FESpace, Grad, Id, IfPos, Mesh, Norm, VectorH1, grad, specialcf, x
from numpy.typing import NDArray

from ngswell.errors import InputError
from ngswell.mesh.points import vertices, vertices_of


@runtime_checkable
class Kinematics(Protocol):
    """The displacement's part of a scene. `directions` names its components, as supports do.

    Tensors are as large as the motion needs: 1 × 1 confined, 2 × 2 in plane strain, 3 × 3 otherwise; `in_space` makes a
    deformation gradient whole. A motion of one's own gives, numbered:

    1. `dimension` of its meshes, `directions`, `power`, and `check`, its refusals;
    2. `space`, `gradient`: the displacement and its gradient;
    3. `flow_gradient`, `flow_vector`: gradients of pressures and vectors of the scene, as long as its tensors are wide;
    4. `in_space`: F as 3 × 3;
    5. `weight`, `normal`, `area_vector`, `area_stretch`: measures of the body and its boundary; `rigid_motions`.
    """

    dimension: int
    directions: str
    power: int  # of mm, in the unit of the body's volume

    def check(self, mesh: Mesh, fixed: dict[str, str]) -> None:
        """Refuse meshes on which the kinematics has no meaning; `fixed` maps directions to boundaries ("a|b")."""
        ...

    def space(self, mesh: Mesh, order: int, fixed: dict[str, str]) -> FESpace:
        """Displacement space; `fixed` maps a direction to the boundaries ("a|b") where it vanishes."""
        ...

    def gradient(self, u: CoefficientFunction) -> CoefficientFunction:
        """Grad u, a square matrix [-]."""
        ...

    def flow_gradient(self, p: CoefficientFunction) -> CoefficientFunction:
        """Reference gradient of a scalar field, as long as the tensors are wide."""
        ...

    def flow_vector(self, components: tuple[float, ...]) -> CoefficientFunction:
        """A vector of the scene, as long as the tensors are wide."""
        ...

    @property
    def weight(self) -> CoefficientFunction | float:
        """Reference volume (and area) per mesh volume (and area)."""
        ...

    @property
    def normal(self) -> CoefficientFunction:
        """Outer normal N of the reference configuration, as long as the tensors are wide."""
        ...

    def in_space(self, F: CoefficientFunction) -> CoefficientFunction:
        """The whole deformation gradient, 3 × 3: out of the motion's plane or line there is no stretch."""
        ...

    def area_vector(self, u: CoefficientFunction) -> CoefficientFunction:
        """n da/dA = Cof(F) N on a boundary [-], along `directions`; u is a trial function."""
        ...

    def area_stretch(self, u: CoefficientFunction) -> CoefficientFunction:
        """da/dA = |Cof(F) N| on a boundary [-]; u is a trial function."""
        ...

    def rigid_motions(self, point: NDArray) -> NDArray:
        """Displacement at `point` (rows) of the rigid motions (columns): translations, then rotations."""
        ...


@dataclass(frozen=True)
class Confined:
    """One displacement component on a 1-d mesh: a column between frictionless walls, F = 1 + u′ = J."""

    dimension = power = 1
    directions = "x"
    weight = 1.0

    @property
    def normal(self) -> CoefficientFunction:
        return specialcf.normal(1)

    def check(self, mesh: Mesh, fixed: dict[str, str]) -> None:
        pass

    def space(self, mesh: Mesh, order: int, fixed: dict[str, str]) -> FESpace:
        return H1(mesh, order=order, dirichlet=fixed["x"])

    def gradient(self, u: CoefficientFunction) -> CoefficientFunction:
        return CF(grad(u), dims=(1, 1))

    def flow_gradient(self, p: CoefficientFunction) -> CoefficientFunction:
        return grad(p)

    def flow_vector(self, components: tuple[float, ...]) -> CoefficientFunction:
        return CF(components)

    def in_space(self, F: CoefficientFunction) -> CoefficientFunction:
        return CF((F[0, 0], 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0), dims=(3, 3))

    def area_vector(self, u: CoefficientFunction) -> CoefficientFunction:
        return self.normal[0]

    def area_stretch(self, u: CoefficientFunction) -> CoefficientFunction:
        return CF(1.0)

    def rigid_motions(self, point: NDArray) -> NDArray:
        return np.eye(1)


class _Cartesian:
    """Displacement components along the axes of a 2-d or 3-d mesh."""

    dimension: int
    directions: str
    weight = 1.0

    def check(self, mesh: Mesh, fixed: dict[str, str]) -> None:
        pass

    def space(self, mesh: Mesh, order: int, fixed: dict[str, str]) -> FESpace:
        return VectorH1(mesh, order=order, **_vanishing(fixed.values()))

    def gradient(self, u: CoefficientFunction) -> CoefficientFunction:
        return Grad(u)

    def flow_gradient(self, p: CoefficientFunction) -> CoefficientFunction:
        return grad(p)

    def flow_vector(self, components: tuple[float, ...]) -> CoefficientFunction:
        return CF(components)

    @property
    def normal(self) -> CoefficientFunction:
        return specialcf.normal(self.dimension)

    def area_vector(self, u: CoefficientFunction) -> CoefficientFunction:
        # Cof(F) N needs tangential derivatives only, which the trace has.
        return Cof(Id(self.dimension) + Grad(u).Trace()) * self.normal

    def area_stretch(self, u: CoefficientFunction) -> CoefficientFunction:
        return Norm(self.area_vector(u))


@dataclass(frozen=True)
class PlaneStrain(_Cartesian):
    """Two displacement components on a 2-d mesh; no stretch and no flow out of the plane."""

    dimension = power = 2
    directions = "xy"

    def in_space(self, F: CoefficientFunction) -> CoefficientFunction:
        return CF((F[0, 0], F[0, 1], 0.0, F[1, 0], F[1, 1], 0.0, 0.0, 0.0, 1.0), dims=(3, 3))

    def rigid_motions(self, point: NDArray) -> NDArray:
        px, py = point
        return np.array([[1.0, 0.0, -py], [0.0, 1.0, px]])


@dataclass(frozen=True)
class Spatial(_Cartesian):
    """Three displacement components on a 3-d mesh."""

    dimension = power = 3
    directions = "xyz"

    def in_space(self, F: CoefficientFunction) -> CoefficientFunction:
        return F

    def rigid_motions(self, point: NDArray) -> NDArray:
        px, py, pz = point
        return np.column_stack([np.eye(3), [-py, px, 0.0], [pz, 0.0, -px], [0.0, -pz, py]])


@dataclass(frozen=True)
class Axisymmetric:
    """Displacements along r and z on a 2-d mesh in the (r, z) half-plane; hoop stretch 1 + u_r/r, weight 2πr.

    On the axis u_r/r is the limit ∂u_r/∂r, and u_r has to vanish there.
    """

    dimension, power = 2, 3
    directions = "rz"

    def check(self, mesh: Mesh, fixed: dict[str, str]) -> None:
        radii = vertices(mesh)[:, 0]
        inner, size = radii.min(), radii.max()
        if inner < -1e-12 * abs(size):
            raise InputError(f"Axisymmetric: the mesh crosses the axis, its first coordinate r falls to {inner:g} mm")
        on_axis = set(np.flatnonzero(radii <= 1e-12 * size))
        on_support = vertices_of(mesh, fixed["r"]) if fixed["r"] else set()
        if on_axis - on_support:
            raise InputError("Axisymmetric: the mesh touches the axis r = 0; hold it there, Roller(boundary, 'r')")

    def space(self, mesh: Mesh, order: int, fixed: dict[str, str]) -> FESpace:
        return VectorH1(mesh, order=order, **_vanishing(fixed.values()))

    def gradient(self, u: CoefficientFunction) -> CoefficientFunction:
        return _with_hoop(Grad(u), u)

    def flow_gradient(self, p: CoefficientFunction) -> CoefficientFunction:
        return CF((grad(p)[0], grad(p)[1], 0.0))

    def flow_vector(self, components: tuple[float, ...]) -> CoefficientFunction:
        return CF((*components, 0.0))

    @property
    def weight(self) -> CoefficientFunction:
        return 2 * pi * x

    @property
    def normal(self) -> CoefficientFunction:
        components = specialcf.normal(2)
        return CF((components[0], components[1], 0.0))

    def in_space(self, F: CoefficientFunction) -> CoefficientFunction:
        return F

    def area_vector(self, u: CoefficientFunction) -> CoefficientFunction:
        vector = self._area_vector(u)
        return CF((vector[0], vector[1]))

    def area_stretch(self, u: CoefficientFunction) -> CoefficientFunction:
        return Norm(self._area_vector(u))

    def _area_vector(self, u: CoefficientFunction) -> CoefficientFunction:
        return Cof(Id(3) + _with_hoop(Grad(u).Trace(), u)) * self.normal

    def rigid_motions(self, point: NDArray) -> NDArray:
        return np.array([[0.0], [1.0]])


def _vanishing(boundaries: Any) -> dict[str, str]:
    return {f"dirichlet{axis}": names for axis, names in zip("xyz", boundaries, strict=False)}


def _with_hoop(g: CoefficientFunction, u: CoefficientFunction) -> CoefficientFunction:
    hoop = IfPos(x - 1e-14, u[0] / x, g[0, 0])
    return CF((g[0, 0], g[0, 1], 0.0, g[1, 0], g[1, 1], 0.0, 0.0, 0.0, hoop), dims=(3, 3))
