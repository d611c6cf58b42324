"""Material parameters with their units, checked; the two tables of the paper."""

from __future__ import annotations

from dataclasses import dataclass, fields
from math import inf
from typing import Any

import numpy as np
from ngsolve import CF, VOL, CoefficientFunction, Id, Mesh

from ngswell import checks
from ngswell.checks import Field
from ngswell.errors import InputError
from ngswell.mesh.points import points
from ngswell.physics.anisotropy import ratios
from ngswell.physics.pores import Constant, Diffusivity, Permeability
from ngswell.physics.ranges import ONE_NUMBER, within
from ngswell.physics.solid import Located, NeoHookean, SolidLaw, fields_of, nominal_stress

GAS_CONSTANT = 8.3144e-3
"""R [N/mm² per mol/l and K]."""

STRESS_FREE = 1e-9
"""Share of µ that a solid law's stress at F = I may have by round-off."""


LAWS = ("solid", "permeability", "diffusivity")
"""The parameters that are laws."""

DIFFUSIVITIES = ("D_plus", "D_minus")
"""The parameters that a material without ions does not have."""

NO_IONS = "the material has no ions: give it cfc0 [mol/l], D_plus and D_minus [mm²/s], or take the model Uncharged()"


@dataclass(frozen=True, kw_only=True)
class Material:
    """A charged hydrated porous solid and its pore fluid.

    The parameters up to K are floats or CoefficientFunctions of position in the reference configuration, the others are one
    number or one law; left out, they are the paper's. A material without ions, for `Uncharged`, leaves out cfc0, which is 0
    then, D_plus and D_minus. Raises InputError for a value outside its possible (or, by orders of magnitude, plausible)
    range; fields of position are checked when a scene brings the mesh.
    """

    mu: Field  # µS, shear modulus of the drained solid [N/mm²]
    lam: Field  # λS, second Lamé constant [N/mm²]
    nS0: Field  # nS0S, solidity of the reference configuration [-]
    cfc0: Field = None  # cfc0S, fixed charge per fluid volume at the start [mol/l]; never None
    D_plus: Field | None = None  # D₊, cation diffusivity in the pore fluid (before a diffusivity law) [mm²/s]
    D_minus: Field | None = None  # D₋, anion diffusivity, likewise [mm²/s]
    K: Field  # kF/γFR, Darcy permeability over effective fluid weight, at J = 1 [mm⁴/(N s)]
    theta: float = 298.0  # θ, temperature [K]
    solid: SolidLaw = NeoHookean()  # ψ(F)
    permeability: Permeability = Constant()  # K(J)
    diffusivity: Diffusivity = Constant()  # D₊(nF), D₋(nF)
    phi: float = 1.0  # φ, osmotic coefficient of the pore fluid [-]
    phi_bath: float = 1.0  # φ̄, osmotic coefficient of the bath [-]
    Gamma: float = 1.0  # Γ = γ̄/γ, mean activity coefficient of the salt in the bath over that in the gel [-]

    def __post_init__(self) -> None:
        self._check_ions()
        checks.instance("solid", self.solid, SolidLaw, "a law with energy(deformation, material), such as NeoHookean()")
        reference = _sample("permeability", self.permeability, (1.0, 1.0, 0.5), "K(K0, J, nS0) such as PowerLaw(m=2.0)")
        if not abs(reference - 1) <= 1e-12:
            raise InputError(f"permeability = {self.permeability!r} gives K = {reference:g} K0 at J = 1; it has to give K0")
        diffusivity = _sample("diffusivity", self.diffusivity, (1.0, 0.5), "D(D0, nF) such as MackieMeares()")
        if not 0 < diffusivity < inf:
            raise InputError(
                f"diffusivity = {self.diffusivity!r} gives D = {diffusivity:g} D0 at nF = 0.5; it has to be positive"
            )
        for field in fields(self):
            value = getattr(self, field.name)
            if field.name in LAWS or (field.name in DIFFUSIVITIES and value is None):
                continue
            if isinstance(value, CoefficientFunction):
                if field.name in ONE_NUMBER:
                    raise InputError(ONE_NUMBER[field.name])
                checks.scalar(field.name, value)
            else:
                checks.set_fields(self, **{field.name: within(field.name, value)})

    def _check_ions(self) -> None:
        """Refuse a material with some of its ions' parameters; with none it has no charge."""
        absent = [name for name in DIFFUSIVITIES if getattr(self, name) is None]
        if self.cfc0 is None:
            if len(absent) < len(DIFFUSIVITIES):
                raise InputError("cfc0 is missing beside D_plus and D_minus: give the fixed charge [mol/l], 0.0 for none")
            checks.set_fields(self, cfc0=0.0)
        charged = not checks.is_number(self.cfc0) or self.cfc0 != 0
        if absent and (charged or len(absent) < len(DIFFUSIVITIES)):
            raise InputError(
                f"{' and '.join(absent)} [mm²/s] missing: ions have both diffusivities, D_plus and D_minus; a material "
                "without ions, for Uncharged(), has neither and no cfc0"
            )

    @property
    def diffusivities(self) -> tuple[Field, Field]:
        """D₊ and D₋, before any law [mm²/s]. Raises InputError for a material without ions."""
        if self.D_plus is None or self.D_minus is None:
            raise InputError(NO_IONS)
        return self.D_plus, self.D_minus

    @property
    def RT(self) -> float:
        """Rθ [N/mm² per mol/l]."""
        return GAS_CONSTANT * self.theta

    @property
    def kinked(self) -> bool:
        """Whether the stiffness of the solid jumps somewhere: what the law says of itself."""
        return bool(getattr(self.solid, "kinked", False))

    def number(self, name: str) -> float:
        """The parameter `name` as one number, for closed forms; InputError if it is a field of position."""
        value = getattr(self, name)
        if value is None:
            raise InputError(NO_IONS)
        if isinstance(value, CoefficientFunction):
            raise InputError(f"{name} varies in space: closed forms hold for a homogeneous body, give a number")
        return float(value)

    def uniform_permeability(self) -> float:
        """K as one number, for closed forms; InputError if it varies in space or with the direction."""
        if ratios(self.permeability):
            raise InputError(
                f"permeability = {checks.short(self.permeability)} depends on direction, while the closed form has one K: "
                "give a material with the K along the flow and without that law"
            )
        return self.number("K")

    def laws(self) -> dict[str, object]:
        """The constitutive choices that are not the paper's, by name."""
        names = (*LAWS, "phi", "phi_bath", "Gamma")
        return {name: getattr(self, name) for name in names if getattr(self, name) not in (NeoHookean(), Constant(), 1.0)}

    @property
    def samples(self) -> dict[str, list[float]]:
        """Values of the laws that are any callable, which tell one from another where its name does not."""
        stretches, porosities = np.linspace(0.5, 4.0, 29), np.linspace(0.05, 0.95, 19)
        return {
            "permeability": [float(self.permeability(1.0, J, 0.25)) for J in stretches],
            "diffusivity": [float(self.diffusivity(1.0, nF)) for nF in porosities],
        }

    def check_on(self, mesh: Mesh) -> None:
        """Refuse fields of position whose values, at the quadrature points of `mesh`, are out of range, and a solid law
        whose reference configuration is not free of stress there."""
        where = points(mesh, VOL, 4)
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, CoefficientFunction):
                _check_regions(field.name, value, mesh)
                samples = value(where).ravel()
                within(field.name, float(samples.min()))
                within(field.name, float(samples.max()))

        for law in (self.solid, self.permeability):
            for name, value in fields_of(law, "solid" if law is self.solid else "permeability"):
                _check_regions(name, value, mesh)
            if isinstance(law, Located):
                law.check_on(mesh)
        try:
            stress = float(np.abs(nominal_stress(Id(3), self)(where)).max())
        except Exception as error:  # whatever a user's law raises on fields
            raise InputError(f"solid = {checks.short(self.solid)} is not a law of fields: {error}") from error
        if not stress <= STRESS_FREE * self.largest("mu", mesh):
            raise InputError(
                f"solid = {checks.short(self.solid)} has a stress of {stress:.3g} N/mm² at F = I; the body starts free of "
                "stress: subtract it from the law"
            )

    def largest(self, name: str, mesh: Mesh) -> float:
        """Largest value of the parameter `name` over the quadrature points of `mesh`, in the parameter's unit."""
        value = getattr(self, name)
        return float(value(points(mesh, VOL, 4)).max()) if isinstance(value, CoefficientFunction) else float(value)


def _check_regions(name: str, field: CoefficientFunction, mesh: Mesh) -> None:
    regions = getattr(field, "regions", mesh.GetMaterials())
    if regions != mesh.GetMaterials():
        raise InputError(
            f"{name} is by_region of another mesh, with the regions {', '.join(map(repr, regions))}; the scene's has "
            f"{', '.join(map(repr, mesh.GetMaterials()))}: make it with the scene's mesh"
        )


def _sample(name: str, law: Any, arguments: tuple[float, ...], example: str) -> float:
    """Value of a law, refused if it is none: it has to take numbers and fields."""
    try:
        law(*(CF(value) for value in arguments))
        return float(law(*arguments))
    except (TypeError, ValueError, ArithmeticError, AttributeError) as error:
        raise InputError(f"{name} = {checks.short(law)} is not a law {example} of numbers and of fields: {error}") from None


TABLE_1 = Material(mu=0.24, lam=0.02, nS0=0.25, cfc0=0.2, D_plus=0.5e-3, D_minus=0.8e-3, K=1.07e-3)
"""Table 1, the equilibrium test (Figs. 4 and 8). The charge printed in meq/l is in mol/l."""

TABLE_2 = Material(mu=0.12, lam=0.02, nS0=0.25, cfc0=0.8, D_plus=0.5e-3, D_minus=0.8e-3, K=1.07e-3)
"""Table 2, free swelling (Figs. 9 and 10). The charge printed in meq/l is in mol/l."""
