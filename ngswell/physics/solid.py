"""The drained solid: laws that give its energy, and what follows from it: stress, moduli, homogeneous response."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, is_dataclass
from functools import cache
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from ngsolve import CF, CoefficientFunction, Det, InnerProduct, Mesh, Parameter, log
from ngsolve.meshes import Make1DMesh
from numpy.typing import NDArray

from ngswell import checks
from ngswell.checks import Field
from ngswell.errors import InputError


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
    4. is a frozen dataclass: its fields tell checkpoints one law from another, and `describe()` prints them;
    5. has `check_on(mesh)` if it refuses values of fields of position (`Located`);
    6. has `kinked = True` if its stiffness jumps, as that of fibres that bear tension only: Newton's method then goes on
       where it would stall.

    Forms, stress outputs, closed forms and stability all take this one energy.
    """

    def energy(self, deformation: Deformation, material: SolidParameters, /) -> CoefficientFunction:
        """ψ(F, J, J − nS0) [N/mm²], up to a constant."""
        ...


@runtime_checkable
class Located(Protocol):
    """A law with fields of position, such as directions of fibres, that says its refusals when a scene brings the mesh."""

    def check_on(self, mesh: Mesh, /) -> None: ...


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
    to be numbers; InputError for a law that varies in space.
    """
    if varying := list(fields_of(material.solid)):
        raise InputError(f"{varying[0][0]} varies in space: closed forms hold for a homogeneous body, give a number")
    content = Parameter(1.0)
    J = content + material.nS0
    F, stretches = _stretched(J, free)
    I1 = sum((s * s for s in stretches), CF(0.0))
    derivative = material.solid.energy(Deformation(F, J, content, I1), material)
    for _ in range(order):
        derivative = derivative.Diff(content)
    point = _any_mesh()(0.5)

    def value(at: float) -> float:
        content.Set(at)
        return float(derivative(point))

    return value


def _stretched(J: Field, free: int) -> tuple[CoefficientFunction, list[CoefficientFunction]]:
    """F that stretches the first `free` axes alike, and its stretches."""
    stretch = CF(J if free == 1 else J ** (1 / free))
    stretches = [stretch if axis < free else CF(1.0) for axis in range(3)]
    return CF(tuple(stretches[i] if i == j else CF(0.0) for i in range(3) for j in range(3)), dims=(3, 3)), stretches


UNLIKE = 1e-9
"""Share of µ by which stresses of free directions may differ by round-off where they are said to stretch alike."""


def check_alike(material: SolidParameters, free: int, J: float) -> None:
    """Refuse a law whose `free` directions do not stretch alike at J: under one pressure their stresses would differ."""
    stress = _stress_at(_stretched(J, free)[0], material)[:free, :free]
    if not np.abs(stress - stress[0, 0] * np.eye(free)).max() <= UNLIKE * (float(material.mu) + abs(stress[0, 0])):
        raise InputError(
            f"solid = {checks.short(material.solid)} does not stretch alike in {free} free directions, as the closed form "
            "has it: run the scene"
        )


DEPARTURE, SMALL = 1e-3, 1e-5
"""Share of the stress by which a law may depart from Hooke's, at a strain of `SMALL` times the initial porosity."""


def small_strain_moduli(material: SolidParameters) -> tuple[float, float]:
    """µ and λ of linear elasticity about the reference configuration [N/mm²], from the law's energy.

    d²ψ/dJ² at J = 1 is 2µ + λ in a confined motion and λ + 2µ/3 where all directions stretch alike. Parameters have to be
    numbers. For the paper's law they are its own µ and λ. Raises InputError for a law that is not Hooke's at small strains,
    such as that of fibres, which have a direction or bear no compression.
    """
    content = 1 - float(material.nS0)
    confined, bulk = (homogeneous_response(material, free, order=2)(content) for free in (1, 3))
    mu = 3 / 4 * (confined - bulk)
    lam = confined - 2 * mu
    size = SMALL * content
    for pair in ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)):
        for strain in (size, -size):
            G = np.zeros((3, 3))
            G[pair] = G[pair[::-1]] = strain
            linear = lam * np.trace(G) * np.eye(3) + 2 * mu * G
            stress = _stress_at(CF(tuple((np.eye(3) + G).ravel()), dims=(3, 3)), material)
            if not np.abs(stress - linear).max() <= DEPARTURE * size * abs(confined):
                raise InputError(
                    f"solid = {checks.short(material.solid)} is not isotropic and linear at small strains, as the closed "
                    "form has it: run the scene"
                )
    return mu, lam


def _stress_at(F: CoefficientFunction, material: SolidParameters) -> NDArray:
    """Nominal stress of a homogeneous body [N/mm²]."""
    return np.array(nominal_stress(F, material)(_any_mesh()(0.5))).reshape(3, 3)


def fields_of(law: object, name: str = "solid") -> Iterator[tuple[str, CoefficientFunction]]:
    """The fields of position in a law, and in the laws that it is made of, by name."""
    if isinstance(law, CoefficientFunction):
        yield name, law
    elif isinstance(law, tuple):
        for entry in law:
            yield from fields_of(entry, name)
    elif is_dataclass(law):
        for field in fields(law):
            yield from fields_of(getattr(law, field.name), f"{name}: {field.name}")


@cache
def _any_mesh() -> Mesh:
    """A mesh: NGSolve evaluates nothing without a point of one, and a point does not keep its mesh alive."""
    return Make1DMesh(1)
