"""How the body may deform: displacement space, deformation gradient, stretch of the boundary."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from ngsolve import CF, H1, CoefficientFunction, Cof, FESpace, Grad, Id, Mesh, Norm, VectorH1, grad, specialcf


class Kinematics(Protocol):
    """The displacement's part of a scene. `directions` names its components, as supports do."""

    @property
    def dimension(self) -> int: ...

    @property
    def directions(self) -> str: ...

    def space(self, mesh: Mesh, order: int, held: dict[str, str]) -> FESpace:
        """Displacement space; `held` maps a direction to the boundaries ("a|b") where it vanishes."""
        ...

    def gradient(self, u: CoefficientFunction) -> CoefficientFunction:
        """Grad u, a square matrix [-]."""
        ...

    def vector(self, u: CoefficientFunction) -> CoefficientFunction:
        """The displacement as a vector [mm]."""
        ...

    def area_stretch(self, u: CoefficientFunction) -> CoefficientFunction:
        """da/dA = |Cof(F) N| on a boundary [-]; u is a trial function."""
        ...


@dataclass(frozen=True)
class Confined:
    """One displacement component on a 1-d mesh: a column between frictionless walls, F = 1 + u′ = J."""

    dimension = 1
    directions = "x"

    def space(self, mesh: Mesh, order: int, held: dict[str, str]) -> FESpace:
        return H1(mesh, order=order, dirichlet=held["x"])

    def gradient(self, u: CoefficientFunction) -> CoefficientFunction:
        return CF(grad(u), dims=(1, 1))

    def vector(self, u: CoefficientFunction) -> CoefficientFunction:
        return u

    def area_stretch(self, u: CoefficientFunction) -> CoefficientFunction:
        return CF(1.0)


@dataclass(frozen=True)
class PlaneStrain:
    """Two displacement components on a 2-d mesh; no stretch and no flow out of the plane."""

    dimension = 2
    directions = "xy"

    def space(self, mesh: Mesh, order: int, held: dict[str, str]) -> FESpace:
        return VectorH1(mesh, order=order, dirichletx=held["x"], dirichlety=held["y"])

    def gradient(self, u: CoefficientFunction) -> CoefficientFunction:
        return Grad(u)

    def vector(self, u: CoefficientFunction) -> CoefficientFunction:
        return u

    def area_stretch(self, u: CoefficientFunction) -> CoefficientFunction:
        # Cof(F) N needs tangential derivatives only, which the trace has.
        return Norm(Cof(Id(2) + Grad(u).Trace()) * specialcf.normal(2))
