"""The drained solid: laws that give its energy, and what follows from it: stress, moduli, homogeneous response."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple, Protocol, runtime_checkable

from ngsolve import CF, CoefficientFunction, Det, InnerProduct, Mesh, Parameter, log
from ngsolve.meshes import Make1DMesh

from ngswell.checks import Field


class Deformation(NamedTuple):
    """The deformation as a solid law sees it: of trial functions, of a result, or along a closed form."""

    F: CoefficientFunction  # deformation gradient, always 3 × 3 [-]
    J: CoefficientFunction  # det F [-]
    content: CoefficientFunction  # J − nS0, fluid volume per reference volume [-]
    I1: CoefficientFunction  # tr C = F : F [-]

    @classmethod
    def of(cls, F: CoefficientFunction, nS0: Field) -> Deformation:
        """That of a gradient F, 3 × 3."""
        J = Det(F)
        return cls(F, J, J - nS0, InnerProduct(F, F))


class SolidParameters(Protocol):
    """What a solid law may use of a `Material`."""

    @property
    def mu(self) -> Field: ...

    @property
    def lam(self) -> Field: ...

    @property
    def nS0(self) -> Field: ...

    @property
    def solid(self) -> SolidLaw: ...


@runtime_checkable
class SolidLaw(Protocol):
    """The energy of the drained solid, `Material(solid=...)`. A law of one's own:

    1. gives `energy`, a density per reference volume [N/mm²], whose derivative by F is the extra stress;
    2. takes `content` where it has its pole at the compression point: there J does not tell J − nS0;
    3. has no stress at F = I, eq. (35): a scene refuses it otherwise;
    4. is a frozen dataclass: its fields tell checkpoints one law from another, and `describe()` prints them.

    Forms, stress outputs, closed forms and stability all take this one energy.
    """

    def energy(self, deformation: Deformation, material: SolidParameters, /) -> CoefficientFunction:
        """ψ(F, J, J − nS0) [N/mm²], up to a constant."""
        ...


@dataclass(frozen=True)
class NeoHookean:
    """The paper's law, eq. (18), after its reference [12]: neo-Hookean with a pole at the compression point J = nS0.

    ψ = µ/2 tr C − µ ln J + λ (1 − nS0)² [J/(1 − nS0) − ln(J − nS0)],
    τ = µ (B − I) + λ (1 − nS0)² [J/(1 − nS0) − J/(J − nS0)] I.
    """

    def energy(self, deformation: Deformation, material: SolidParameters) -> CoefficientFunction:
        d, m = deformation, material
        volumetric = m.lam * (1 - m.nS0) ** 2 * (d.J / (1 - m.nS0) - log(d.content))
        return m.mu / 2 * d.I1 - m.mu * log(d.J) + volumetric


def nominal_stress(F: CoefficientFunction, material: SolidParameters) -> CoefficientFunction:
    """First Piola–Kirchhoff extra stress dψ/dF of the material's law [N/mm²]; `F` and the stress are 3 × 3."""
    variable = F.MakeVariable()
    return material.solid.energy(Deformation.of(variable, material.nS0), material).Diff(variable)


def extra_stress(F: CoefficientFunction, material: SolidParameters) -> CoefficientFunction:
    """Cauchy extra stress (dψ/dF) Fᵀ/J of the material's law [N/mm²]; `F` and the stress are 3 × 3."""
    return nominal_stress(F, material) * F.trans / Det(F)


def homogeneous_response(material: SolidParameters, free: int, order: int = 1) -> Callable[[float], float]:
    """The derivative of that order of ψ by J where `free` = 1, 2, 3 directions stretch alike, over the content J − nS0.

    The first is the extra stress τ/J that acts in the free directions [N/mm²], since dψ = P : dF = τ dJ/J. Parameters have
    to be numbers.
    """
    content = Parameter(1.0)
    J = content + material.nS0
    stretch = J if free == 1 else J ** (1 / free)
    stretches = [stretch if axis < free else CF(1.0) for axis in range(3)]
    F = CF(tuple(stretches[i] if i == j else CF(0.0) for i in range(3) for j in range(3)), dims=(3, 3))
    I1 = sum((s * s for s in stretches), CF(0.0))
    derivative = material.solid.energy(Deformation(F, J, content, I1), material)
    for _ in range(order):
        derivative = derivative.Diff(content)
    point = _any_mesh()(0.5)

    def value(at: float) -> float:
        content.Set(at)
        return float(derivative(point))

    return value


def small_strain_moduli(material: SolidParameters) -> tuple[float, float]:
    """µ and λ of linear elasticity about the reference configuration [N/mm²], from the law's energy.

    d²ψ/dJ² at J = 1 is 2µ + λ in a confined motion and λ + 2µ/3 where all directions stretch alike. Parameters have to be
    numbers. For the paper's law they are its own µ and λ.
    """
    content = 1 - float(material.nS0)
    confined, bulk = (homogeneous_response(material, free, order=2)(content) for free in (1, 3))
    mu = 3 / 4 * (confined - bulk)
    return mu, confined - 2 * mu


@cache
def _any_mesh() -> Mesh:
    """A mesh: NGSolve evaluates nothing without a point of one, and a point does not keep its mesh alive."""
    return Make1DMesh(1)
