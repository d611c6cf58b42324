"""Fibres that bear tension only, in families of one direction or over all directions, in a ground solid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi
from typing import Any, ClassVar

import numpy as np
from ngsolve import CF, VOL, CoefficientFunction, Id, IfPos, InnerProduct, Mesh, exp
from numpy.typing import NDArray

from ngswell import checks
from ngswell.checks import Field
from ngswell.errors import InputError
from ngswell.mesh.points import points
from ngswell.physics.directions import check_length, direction, unit
from ngswell.physics.solid import Deformation, Located, SolidLaw, SolidParameters

STIFFEST = 1e6
"""Largest ξ [N/mm²]."""


@dataclass(frozen=True)
class Fibres:
    """One family of fibres along `direction` N, which bears tension only: with Iₙ = N·CN/N·N, the squared stretch,

    ψ = ξ/(αβ) (exp[α (Iₙ − 1)^β] − 1) where Iₙ > 1, and 0 elsewhere; as α → 0 it is ξ/β (Iₙ − 1)^β.

    N has three components in the reference configuration, a vector or a field of position, of any length but zero: x, y, z,
    also of plane strain and columns, r, z, hoop when axisymmetric, r, hoop, z when `Cylindrical`, r and two across when
    `Spherical`. ξ ≥ 0 [N/mm²] may be a field, β ≥ 2, α ≥ 0 [-].
    G. A. Holzapfel, T. C. Gasser and R. W. Ogden, J. Elasticity 61 (2000) 1; "fiber-exp-pow" of FEBio.
    """

    direction: Any
    xi: Field
    beta: float = 2.0
    alpha: float = 0.0

    kinked: ClassVar[bool] = True

    def __post_init__(self) -> None:
        checks.set_fields(self, direction=direction("Fibres: direction", self.direction))
        checks.set_fields(self, xi=_stiffness("Fibres: xi", self.xi))
        _check_exponents(self, "Fibres")

    def energy(self, deformation: Deformation, material: SolidParameters) -> CoefficientFunction:
        return self.xi * _tension(deformation, unit(self.direction), self.beta, self.alpha)

    def check_on(self, mesh: Mesh) -> None:
        check_length("Fibres: direction", self.direction, mesh)
        if (least := float(CF(self.xi)(points(mesh, VOL, 4)).min())) < 0:
            raise InputError(f"Fibres: xi = {least:g} N/mm² at a point of the body; it has to be 0 or more")


@dataclass(frozen=True)
class FibreDistribution:
    """Fibres in all directions N, each as in `Fibres`: the integral of ψ(N) over the unit sphere, by quadrature.

    `xi` is one number (spherical) or the semiaxes of an ellipsoid, ξ(N) = [(N₁/ξ₁)² + (N₂/ξ₂)² + (N₃/ξ₃)²]^(−1/2), ξ > 0
    [N/mm²]; the axes are those of `Fibres`. G. A. Ateshian et al., J. Biomech. Eng. 131 (2009) 061003, with one β. The
    quadrature has 48 directions: the stress is within 5 % where some fibres are slack, to round-off where none is (β = 2).
    """

    xi: Any
    beta: float = 2.0
    alpha: float = 0.0

    kinked: ClassVar[bool] = True

    def __post_init__(self) -> None:
        xi = (
            (self.xi,) * 3
            if checks.is_number(self.xi)
            else checks.vector("FibreDistribution: xi", self.xi, STIFFEST, "N/mm²")
        )
        if len(xi) != 3:
            raise InputError(f"FibreDistribution: xi has to be one number or three, got {checks.short(self.xi)}")
        for value in xi:
            checks.number(
                "FibreDistribution: xi", checks.positive("FibreDistribution: xi", value, "N/mm²"), "", 0.0, STIFFEST
            )
        checks.set_fields(self, xi=tuple(map(float, xi)))
        _check_exponents(self, "FibreDistribution")

    def energy(self, deformation: Deformation, material: SolidParameters) -> CoefficientFunction:
        directions, weights = hemisphere(*DIRECTIONS)
        weights = weights / np.linalg.norm(directions / np.array(self.xi), axis=1)
        total = CF(0.0)
        for N, weight in zip(directions, weights, strict=True):
            total += float(weight) * _tension(deformation, CF(tuple(map(float, N))), self.beta, self.alpha)
        return total


@dataclass(frozen=True)
class FibreReinforced:
    """A `ground` solid with families of `fibres`: the sum of their energies. Fibres alone bear no compression."""

    ground: SolidLaw
    fibres: Sequence[SolidLaw]

    kinked: ClassVar[bool] = True

    def __post_init__(self) -> None:
        checks.instance("FibreReinforced: ground", self.ground, SolidLaw, "a law such as NeoHookean()")
        fibres = checks.several(
            "FibreReinforced: fibres", self.fibres, SolidLaw, "families such as Fibres((0, 0, 1), xi=1.0)"
        )
        if not fibres:
            raise InputError("FibreReinforced: fibres is empty; give a family such as Fibres((0, 0, 1), xi=1.0)")
        checks.set_fields(self, fibres=fibres)

    def energy(self, deformation: Deformation, material: SolidParameters) -> CoefficientFunction:
        return sum((law.energy(deformation, material) for law in self.fibres), self.ground.energy(deformation, material))

    def check_on(self, mesh: Mesh) -> None:
        for law in (self.ground, *self.fibres):
            if isinstance(law, Located):
                law.check_on(mesh)


def _tension(deformation: Deformation, N: CoefficientFunction, beta: float, alpha: float) -> CoefficientFunction:
    """ψ/ξ of fibres along a unit vector. Iₙ − 1 = N·(C − I)N is exactly zero at F = I, where fibres are slack."""
    C = deformation.F.trans * deformation.F
    strain = InnerProduct(N, (C - Id(3)) * N)
    positive = IfPos(strain, strain, 1.0)  # no powers of what is not positive
    power = strain * strain if beta == 2 else positive**beta
    return IfPos(strain, power / beta if alpha == 0 else (exp(alpha * power) - 1) / (alpha * beta), 0.0)


DIRECTIONS = (4, 12)
"""Points of the quadrature over a hemisphere, from equator to pole and around: each costs as much as a family."""


def hemisphere(rings: int, around: int) -> tuple[NDArray, NDArray]:
    """Directions of a hemisphere and weights that add up to the whole sphere, 4π: opposite directions are one fibre."""
    roots, ring_weights = np.polynomial.legendre.leggauss(rings)
    heights, ring_weights = (roots + 1) / 2, ring_weights / 2
    angles = 2 * pi * (np.arange(around) + 0.5) / around
    radii = np.sqrt(1 - heights**2)
    vectors = np.array([(r * np.cos(a), r * np.sin(a), h) for r, h in zip(radii, heights, strict=True) for a in angles])
    return vectors, np.repeat(ring_weights, around) * 4 * pi / around


def _stiffness(what: str, value: Field) -> Field:
    if isinstance(value, CoefficientFunction):
        checks.scalar(what, value)
        return value
    return checks.number(what, value, "N/mm²", 0.0, STIFFEST)


def _check_exponents(law: Any, name: str) -> None:
    hint = "below 2 the stiffness of slack fibres would be infinite"
    checks.set_fields(
        law,
        beta=checks.number(f"{name}: beta", law.beta, "", 2.0, 20.0, hint),
        alpha=checks.number(f"{name}: alpha", law.alpha, "", 0.0, 1e4),
    )
