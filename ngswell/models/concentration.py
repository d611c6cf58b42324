"""The paper's model: displacement, overall pressure and cation concentration, with a continuous charge field."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

from ngsolve import (
    CF,
    H1,
    CoefficientFunction,
    Cof,
    Det,
    FESpace,
    Id,
    InnerProduct,
    Inv,
    Mesh,
    grad,
    sqrt,
)

from ngswell import donnan, laws
from ngswell.errors import InputError
from ngswell.kinematics import Kinematics
from ngswell.materials import Field, Material
from ngswell.models.terms import Term
from ngswell.supports import Weight


@dataclass(frozen=True)
class Concentration:
    """Unknowns u (order k), p, c and cfc (order k − 1): extended Taylor-Hood elements, Fig. 6.

    cfc(J) of a piecewise polynomial displacement jumps between elements, so its gradient exists elementwise only. The fixed
    charge therefore gets a continuous field of its own, the projection of (13)₂ weighted with the fluid content: fluxes
    and boundary conditions use that field, and the total charge is exact.

    In exchange the smooth p does not see J vary inside an element, and a swollen gel owes most of its bulk stiffness to
    that: where fast swelling outruns the mesh, elements would buckle inside. The momentum balance therefore takes the
    pressure that local Donnan equilibrium gives for the charge at the point (`State.pore_pressure`); the difference
    vanishes with the mesh size.
    """

    order: int = 2

    unknowns = ("u", "p", "c", "cfc")
    balances = ("momentum", "fluid", "cations", "charge")
    evolving: ClassVar = {"u": 1e-2, "p": 1e-1, "c": 1e-1}
    """Fields whose time error is controlled (cfc follows u), with the fraction of their reference size that the error is
    relative to as long as they have changed by less."""

    def __post_init__(self) -> None:
        if self.order not in (2, 3, 4, 5, 6):
            raise InputError(f"Concentration(order={self.order!r}): order 2 to 6 for u; p, c get one less")

    def space(self, mesh: Mesh, kinematics: Kinematics, held: dict[str, str], essential: str) -> FESpace:
        """Product space. `held` maps a direction to boundaries where u vanishes; `essential` names those with given p, c."""
        V = kinematics.space(mesh, self.order, held)
        Q = H1(mesh, order=self.order - 1)
        Q_bath = H1(mesh, order=self.order - 1, dirichlet=essential)
        return FESpace([V, Q_bath, Q_bath, Q])

    def state(
        self,
        functions: Sequence[CoefficientFunction],
        material: Material,
        kinematics: Kinematics,
        charge: Field,
        weight: Weight | None,
    ) -> State:
        """The fields that `functions` (trial functions or components of a result, one an unknown) stand for."""
        u, p, c, cfc = functions
        return State(material, kinematics, u, p, c, cfc, charge, weight)

    def equilibrium(
        self, bath: CoefficientFunction, hydraulic: CoefficientFunction, cfc: CoefficientFunction, RT: float
    ) -> dict[str, CoefficientFunction]:
        """Values of the unknowns that Donnan equilibrium (23) gives, for initial states and strong treatments."""
        return {"p": donnan.pressure(bath, cfc, RT, hydraulic), "c": donnan.cations(bath, cfc)}

    def terms(self, state: State, tests: list[CoefficientFunction]) -> list[Term]:
        """The balances over the body, pulled back to the reference configuration."""
        v, q, d, r = tests
        s, m = state, state.material
        grad_v = s.kinematics.gradient(v)
        content = laws.fluid_content(s.J, m)
        pull = s.cofactor.trans * s.cofactor / s.J  # J F⁻¹ F⁻ᵀ
        flux = laws.transport(m, s.nF, s.c, s.cfc, s.drive, grad(s.c), grad(s.cfc))
        terms = [
            Term("momentum", "solid", laws.solid_energy(s.F, m), "energy"),
            Term("momentum", "pore pressure", -s.pore_pressure * InnerProduct(s.cofactor, grad_v)),
            Term("fluid", "storage", content * q, "rate"),
            Term("fluid", "seepage", -InnerProduct(pull * flux.fluid, grad(q))),
            Term("cations", "storage", content * s.c * d, "rate"),
            Term("cations", "diffusion and convection", -InnerProduct(pull * flux.cations, grad(d))),
            Term("charge", "projection", (content * s.cfc - s.charge * (1 - m.nS0) * m.cfc0) * r),
        ]
        if s.weight is not None:
            weight = m.nS0 * CF(s.weight.solid) + content * CF(s.weight.fluid)
            terms.append(Term("momentum", "weight", -InnerProduct(weight, s.kinematics.vector(v))))
        return terms


@dataclass(frozen=True)
class State:
    """The model's fields, of trial functions or of a result: what laws, boundary conditions and outputs are written in."""

    material: Material
    kinematics: Kinematics
    u: CoefficientFunction
    p: CoefficientFunction
    c: CoefficientFunction
    cfc: CoefficientFunction
    charge: Field = 1.0
    weight: Weight | None = None

    @cached_property
    def F(self) -> CoefficientFunction:
        """Deformation gradient [-]."""
        return Id(self.kinematics.dimension) + self.kinematics.gradient(self.u)

    @cached_property
    def J(self) -> CoefficientFunction:
        """Volume ratio det F [-]."""
        return Det(self.F)

    @cached_property
    def cofactor(self) -> CoefficientFunction:
        """Cof F = J F⁻ᵀ [-]."""
        return Cof(self.F)

    @cached_property
    def nF(self) -> CoefficientFunction:
        """Porosity [-]."""
        return 1 - laws.solidity(self.J, self.material)

    @cached_property
    def drive(self) -> CoefficientFunction:
        """Reference gradient of p, less the pulled-back weight of the fluid [N/mm³]."""
        if self.weight is None:
            return grad(self.p)
        return grad(self.p) - self.F.trans * CF(self.weight.fluid)

    @cached_property
    def pore_pressure(self) -> CoefficientFunction:
        """p with the osmotic pressure of the charge at the point in place of the smooth field's [N/mm²].

        At the salt concentration c̃ = sqrt(c₊ c₋) of the bath in equilibrium with the point, (38) gives
        p + 2 Rθ [sqrt(c̃² + cfc(J)²/4) − sqrt(c̃² + cfc²/4)], the last root being c − cfc/2.
        """
        pointwise = laws.fixed_charge(self.J, self.material, self.charge)
        root = sqrt(self.c * (self.c - self.cfc) + pointwise * pointwise / 4)
        return self.p + 2 * self.material.RT * (root - self.c + self.cfc / 2)

    def outputs(self) -> dict[str, CoefficientFunction]:
        """Named fields in the current configuration, with the units that `OUTPUT_UNITS` lists."""
        m = self.material
        push = Inv(self.F).trans
        flux = laws.transport(m, self.nF, self.c, self.cfc, push * self.drive, push * grad(self.c), push * grad(self.cfc))
        anions = self.c - self.cfc
        return {
            "displacement": self.kinematics.vector(self.u),
            "J": self.J,
            "p": self.p,
            "hydraulic_pressure": self.p - m.RT * (self.c + anions),
            "c_plus": self.c,
            "c_minus": anions,
            "cfc": self.cfc,
            "nS": laws.solidity(self.J, m),
            "seepage": flux.fluid,
            "cation_flux": flux.cations,
            "stress": laws.extra_stress(self.F, m) / self.J - self.pore_pressure * Id(self.kinematics.dimension),
        }


OUTPUT_UNITS = {
    "displacement": "mm",
    "J": "-",
    "p": "N/mm²",
    "hydraulic_pressure": "N/mm²",
    "c_plus": "mol/l",
    "c_minus": "mol/l",
    "cfc": "mol/l",
    "nS": "-",
    "seepage": "mm/s",
    "cation_flux": "mol/l mm/s",
    "stress": "N/mm²",
}
