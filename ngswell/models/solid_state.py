"""What all models share: the deformed solid."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from ngsolve import CoefficientFunction, Cof, Det, Id, InnerProduct, Inv

from ngswell.models.model import Setting, Term
from ngswell.physics import laws
from ngswell.physics.kinematics import Kinematics
from ngswell.physics.material import Field, Material


@dataclass(frozen=True)
class SolidState:
    """The deformed solid, of trial functions or of a result. A model adds its fields and `pore_pressure` [N/mm²]."""

    setting: Setting
    u: CoefficientFunction

    @property
    def material(self) -> Material:
        return self.setting.material

    @property
    def kinematics(self) -> Kinematics:
        return self.setting.kinematics

    @cached_property
    def F(self) -> CoefficientFunction:
        """Deformation gradient [-]."""
        gradient = self.kinematics.gradient(self.u)
        return Id(gradient.dims[0]) + gradient

    @cached_property
    def J(self) -> CoefficientFunction:
        """Volume ratio det F [-]."""
        return Det(self.F)

    @cached_property
    def cofactor(self) -> CoefficientFunction:
        """Cof F = J F⁻ᵀ [-]."""
        return Cof(self.F)

    @cached_property
    def pull(self) -> CoefficientFunction:
        """J F⁻¹ F⁻ᵀ [-], which takes reference gradients to fluxes per reference area."""
        return self.cofactor.trans * self.cofactor / self.J

    @cached_property
    def push(self) -> CoefficientFunction:
        """F⁻ᵀ [-], which takes reference gradients to spatial ones."""
        return Inv(self.F).trans

    @cached_property
    def content(self) -> CoefficientFunction:
        """Fluid volume per reference volume [-]."""
        return laws.fluid_content(self.J, self.material)

    @cached_property
    def nF(self) -> CoefficientFunction:
        """Porosity [-]."""
        return 1 - laws.solidity(self.J, self.material)

    @cached_property
    def permeability(self) -> Field:
        """K(J) [mm⁴/(N s)]."""
        return laws.permeability(self.J, self.material)

    @cached_property
    def pointwise_charge(self) -> CoefficientFunction:
        """cfc(J) at the point [mol/l]."""
        return laws.fixed_charge(self.J, self.material, self.setting.charge)

    def drive(self, pressure: CoefficientFunction) -> CoefficientFunction:
        """Reference gradient of a pressure, less the pulled-back weight of the fluid [N/mm³]."""
        gradient = self.kinematics.flow_gradient(pressure)
        if self.setting.weight is None:
            return gradient
        return gradient - self.F.trans * self.kinematics.flow_vector(self.setting.weight.fluid)

    def momentum(self, pore_pressure: CoefficientFunction, v: CoefficientFunction) -> list[Term]:
        """Momentum balance (16) with the extra stress (18) from its energy."""
        power = InnerProduct(self.cofactor, self.kinematics.gradient(v))
        terms = [
            Term("momentum", "solid", laws.solid_energy(self.F, self.material), "energy"),
            Term("momentum", "pore pressure", -pore_pressure * power),
        ]
        weight = self.setting.weight
        if weight is not None:
            solid, fluid = (CoefficientFunction(vector) for vector in (weight.solid, weight.fluid))
            force = self.material.nS0 * solid + self.content * fluid
            terms.append(Term("momentum", "weight", -InnerProduct(force, v)))
        return terms

    def solid_outputs(self, pore_pressure: CoefficientFunction) -> dict[str, CoefficientFunction]:
        """Displacement, J, nS and total Cauchy stress."""
        return {
            "displacement": self.u,
            "J": self.J,
            "nS": laws.solidity(self.J, self.material),
            "stress": laws.extra_stress(self.F, self.material) / self.J - pore_pressure * Id(self.F.dims[0]),
        }


OUTPUT_UNITS = {
    "displacement": "mm",
    "J": "-",
    "nS": "-",
    "stress": "N/mm²",
    "p": "N/mm²",
    "hydraulic_pressure": "N/mm²",
    "c_plus": "mol/l",
    "c_minus": "mol/l",
    "cfc": "mol/l",
    "seepage": "mm/s",
    "cation_flux": "mol/l mm/s",
}
"""Units of the outputs that models give."""
