"""What all models share: the deformed solid."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from ngsolve import CF, BoundaryFromVolumeCF, CoefficientFunction, Cof, Det, Id, InnerProduct, Inv, Mesh, Norm

from ngswell import checks
from ngswell.calls import refusing, warn
from ngswell.checks import Field
from ngswell.errors import ExtrapolationWarning, InputError, place
from ngswell.models.model import FieldContext
from ngswell.models.term import Kind, Term
from ngswell.physics import laws
from ngswell.physics.anisotropy import Directional
from ngswell.physics.kinematics import Kinematics
from ngswell.physics.material import Material
from ngswell.physics.solid import Deformation, extra_stress


@refusing
@dataclass(frozen=True)
class SolidState:
    """The deformed solid, of trial functions or of a result. A model adds its fields, `pore_pressure` [N/mm²] and with
    ions `cations` [mol/l]."""

    context: FieldContext
    u: CoefficientFunction

    @property
    def material(self) -> Material:
        return self.context.material

    @property
    def kinematics(self) -> Kinematics:
        return self.context.kinematics

    @property
    def mesh(self) -> Mesh:
        """The mesh of the fields."""
        return self.u.space.mesh

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

    @property
    def stretch_on_boundary(self) -> CoefficientFunction:
        """da/dA on a boundary [-], of a result. The ends of a 1-d mesh have no derivatives, and need none."""
        if self.kinematics.dimension == 1:
            return self.kinematics.area_stretch(self.u)
        return Norm(BoundaryFromVolumeCF(self.cofactor) * self.kinematics.normal)

    @cached_property
    def push(self) -> CoefficientFunction:
        """F⁻ᵀ [-], which takes reference gradients to spatial ones."""
        return Inv(self.F).trans

    @cached_property
    def content(self) -> CoefficientFunction:
        """Fluid volume per reference volume [-]."""
        return laws.fluid_content(self.J, self.material)

    @cached_property
    def deformation(self) -> Deformation:
        """What the solid's law takes; tr C counts the directions in which the motion has no stretch."""
        F, size = self.F, self.F.dims[0]
        I1 = InnerProduct(F, F) + (3 - size) if size < 3 else InnerProduct(F, F)
        return Deformation(self.whole_F, self.J, self.content, I1)

    @cached_property
    def whole_F(self) -> CoefficientFunction:
        """Deformation gradient, 3 × 3 in every motion [-]."""
        return self.kinematics.in_space(self.F)

    @cached_property
    def nF(self) -> CoefficientFunction:
        """Porosity [-]."""
        return laws.porosity(self.J, self.material)

    @cached_property
    def permeability(self) -> Field:
        """K(J) [mm⁴/(N s)]."""
        return laws.permeability(self.J, self.material)

    def through(self, frame: CoefficientFunction, flux: Callable[[Material, CoefficientFunction], tuple]) -> list:
        """The `flux` of a material in a `frame` (`pull` or `push`), where permeability depends on direction too.

        Fluxes are functions of K alone, so that each channel q of the deformed body has those of a body of its permeability:
        with Fᵀ (q⊗q) F⁻ᵀ after the frame, J F⁻¹ (q⊗q) F⁻ᵀ or (q⊗q) F⁻ᵀ. What is left has K itself.
        """
        m, law = self.material, self.material.permeability
        if not isinstance(law, Directional):
            return list(flux(m, frame))
        size, left, fluxes = self.F.dims[0], frame, []
        for ratio, projection in law.channels(self.whole_F):
            part = frame * _leading(projection, size)
            fluxes.append(flux(replace(m, K=ratio * m.K), part))
            left = left - part
        return [sum(parts[1:], parts[0]) for parts in zip(flux(m, left), *fluxes, strict=True)]

    @cached_property
    def pointwise_charge(self) -> CoefficientFunction:
        """cfc(J) at the point [mol/l]."""
        return laws.fixed_charge(self.J, self.material, self.context.charge)

    def drive(self, pressure: CoefficientFunction) -> CoefficientFunction:
        """Reference gradient of a pressure, less the pulled-back weight of the fluid [N/mm³]."""
        gradient = self.kinematics.flow_gradient(pressure)
        if self.context.fluid_weight is None:
            return gradient
        return gradient - self.F.trans * self.kinematics.flow_vector(self.context.fluid_weight)

    def momentum(self, pore_pressure: CoefficientFunction, v: CoefficientFunction) -> list[Term]:
        """Momentum balance (16) with the extra stress from the energy of the material's law; loads add their terms."""
        m = self.material
        power = InnerProduct(self.cofactor, self.kinematics.gradient(v))
        return [
            Term("momentum", "solid", m.solid.energy(self.deformation, m), Kind.ENERGY, apart=m.kinked),
            Term("momentum", "pore pressure", -pore_pressure * power),
        ]

    def outputs(self) -> dict[str, CoefficientFunction]:
        """Named fields in the current configuration; `OUTPUT_UNITS` has their units."""
        raise NotImplementedError

    def output(self, name: str) -> CoefficientFunction:
        """One of the outputs. Raises InputError for a name that is none."""
        outputs = self.outputs()
        if name not in outputs:
            raise InputError(f"there is no quantity {name!r}; the model gives {', '.join(outputs)}")
        return outputs[name]

    def at(self, point: Sequence[float], name: str) -> float | tuple[float, ...]:
        """An output of a result at a point of the reference configuration [mm], in the unit of `OUTPUT_UNITS`.

        Fluxes and stress are made of derivatives: good inside cells. At a bath take `Outflow`, see docs/limits.md. Warns
        with ExtrapolationWarning at a corner where J − nS0 is not positive.
        """
        mesh, point = self.mesh, checks.vector("a point", point, 1e6, "mm")
        if len(point) != mesh.dim or not mesh.Contains(*point):
            raise InputError(f"{point} is not a point of the {mesh.dim}-d body")
        value, content = self.output(name)(mesh(*point)), self.content(mesh(*point))
        if content <= 0:
            warn_of_extrapolation("state.at", content, point)
        return value

    def solid_outputs(self, pore_pressure: CoefficientFunction) -> dict[str, CoefficientFunction]:
        """Displacement, J, nS and total Cauchy stress, 3 × 3 in every motion."""
        return {
            "displacement": self.u,
            "J": self.J,
            "nS": laws.solidity(self.J, self.material),
            "stress": extra_stress(self.whole_F, self.material) - pore_pressure * Id(3),
        }


def _leading(tensor: CoefficientFunction, size: int) -> CoefficientFunction:
    """The block of a 3 × 3 tensor that a motion has."""
    return CF(tuple(tensor[i, j] for i in range(size) for j in range(size)), dims=(size, size))


def warn_of_extrapolation(what: str, content: float, where: Sequence[float]) -> None:
    """Say that J − nS0 = `content` is not positive at a point [mm], which no law and no balance has seen."""
    text = (
        f"{what}: at {place(where)} mm the fields overshoot, J − nS0 = {content:.3g}, as at the corner where a held side "
        "meets a free one; J, nS, concentrations and stress there are no result. Remedy: a point inside a cell."
    )
    warn(ExtrapolationWarning(text))


OUTPUT_UNITS = {
    "displacement": "mm",
    "J": "-",
    "nS": "-",
    "stress": "N/mm²",
    "p": "N/mm²",
    "fluid_potential": "N/mm²",
    "c_plus": "mol/l",
    "c_minus": "mol/l",
    "cfc": "mol/l",
    "seepage": "mm/s",
    "cation_flux": "mol/l mm/s",
}
"""Units of the outputs that models give."""

FLUXES = ("seepage", "cation_flux")
"""Outputs made of derivatives of p, P and concentrations: good inside cells, least so at baths and corners."""
