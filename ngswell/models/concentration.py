"""The paper's model: displacement, overall pressure and cation concentration, with a continuous charge field."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

from ngsolve import H1, CoefficientFunction, FESpace, InnerProduct, Mesh, sqrt

from ngswell.models.model import BathData, BathFields, FieldContext, check_order, needs_ions, needs_salt
from ngswell.models.solid_state import SolidState
from ngswell.models.term import Kind, Term
from ngswell.physics import donnan, laws
from ngswell.physics.kinematics import Kinematics
from ngswell.physics.material import Material

NEGLIGIBLE = 1e-3
"""Share of the cations by which anions may fall below zero: vanishing ones are the small difference of two fields."""


@dataclass(frozen=True)
class State(SolidState):
    """Displacement, overall pressure p, cation concentration c and the continuous charge field cfc."""

    p: CoefficientFunction
    c: CoefficientFunction
    cfc: CoefficientFunction

    @property
    def cations(self) -> CoefficientFunction:
        """c₊ [mol/l]."""
        return self.c

    @cached_property
    def pore_pressure(self) -> CoefficientFunction:
        """p with the osmotic pressure of the charge at the point in place of the smooth field's [N/mm²].

        At the salt concentration c̃ = sqrt(c₊ c₋) of the (ideal) bath in equilibrium with the point, (38) gives
        p + 2 φ Rθ [sqrt(c̃² + cfc(J)²/4) − sqrt(c̃² + cfc²/4)], the last root being c − cfc/2.
        """
        return self.p + 2 * self.material.phi * self.material.RT * (sqrt(self.root_squared) - self.c + self.cfc / 2)

    @cached_property
    def root_squared(self) -> CoefficientFunction:
        """c̃² + cfc(J)²/4 [mol²/l²]; below zero, where anions undershoot by more than a charge, no pressure follows."""
        return self.c * (self.c - self.cfc) + self.pointwise_charge * self.pointwise_charge / 4

    def transport(self, frame: CoefficientFunction) -> laws.Transport:
        """Fluxes from gradients in the `frame` (a matrix on reference gradients): `pull` or `push`."""
        gradient = self.kinematics.flow_gradient
        return self.driven(frame, self.drive(self.p), gradient(self.c), gradient(self.cfc))

    def driven(self, frame: CoefficientFunction, *gradients: CoefficientFunction) -> laws.Transport:
        """Fluxes that reference gradients of p, c and cfc drive."""

        def flux(material: Material, frame: CoefficientFunction) -> laws.Transport:
            return laws.transport(material, self.J, self.c, self.cfc, *(frame * g for g in gradients))

        return laws.Transport(*self.through(frame, flux))

    def outputs(self) -> dict[str, CoefficientFunction]:
        """Named fields in the current configuration; `OUTPUT_UNITS` has their units."""
        flux, anions = self.transport(self.push), self.c - self.cfc
        return {
            **self.solid_outputs(self.pore_pressure),
            "p": self.p,
            "fluid_potential": self.p - self.material.phi * self.material.RT * (self.c + anions),
            "c_plus": self.c,
            "c_minus": anions,
            "cfc": self.cfc,
            "seepage": flux.fluid,
            "cation_flux": flux.cations,
        }


@dataclass(frozen=True)
class Concentration:
    """Unknowns u (order k), p, c and cfc (order k − 1): extended Taylor-Hood elements, Fig. 6.

    cfc(J) of a piecewise polynomial displacement jumps between elements, so its gradient exists elementwise only. The fixed
    charge therefore gets a continuous field of its own, the projection of (13)₂ weighted with the fluid content: fluxes
    and boundary conditions use that field, and the total charge is exact.

    In exchange the smooth p does not see J vary inside an element, and a swollen gel owes most of its bulk stiffness to
    that: where fast swelling outruns the mesh, the cells at the surface would wrinkle. The momentum balance therefore takes
    the pressure that local Donnan equilibrium gives for the charge at the point (`State.pore_pressure`); the difference
    vanishes with the mesh size.
    """

    order: int = 2

    unknowns: ClassVar[tuple[str, ...]] = ("u", "p", "c", "cfc")
    balanced: ClassVar[dict[str, str]] = {"fluid": "p", "cations": "c"}
    positive: ClassVar[tuple[str, ...]] = ()
    charge_field: ClassVar[str | None] = "cfc"
    evolving: ClassVar[dict[str, float]] = {"u": 1e-2, "p": 1e-1, "c": 1e-1}  # cfc follows u

    def __post_init__(self) -> None:
        check_order("Concentration", self.order)

    def check(self, material: Material, baths: Sequence[BathData]) -> None:
        needs_ions("Concentration", material)
        needs_salt("Concentration", baths)

    def space(self, mesh: Mesh, kinematics: Kinematics, fixed: dict[str, str], prescribed: str) -> FESpace:
        V = kinematics.space(mesh, self.order, fixed)
        Q = H1(mesh, order=self.order - 1)
        Q_bath = H1(mesh, order=self.order - 1, dirichlet=prescribed)
        return FESpace([V, Q_bath, Q_bath, Q])

    def state(self, functions: Sequence[CoefficientFunction], context: FieldContext) -> State:
        return State(context, *functions)

    def equilibrium(self, bath: BathFields, cfc: CoefficientFunction, material: Material) -> dict[str, CoefficientFunction]:
        m = material
        return {
            "p": donnan.pressure(bath.salt, cfc, m.RT, bath.P, m.Gamma, m.phi, m.phi_bath),
            "c": donnan.cations(bath.salt, cfc, m.Gamma),
        }

    def terms(self, state: State, tests: Sequence[CoefficientFunction]) -> list[Term]:
        v, q, d, r = tests
        s, m = state, state.material
        gradient = s.kinematics.flow_gradient
        flux = s.transport(s.pull)
        reference_charge = s.context.charge * (1 - m.nS0) * m.cfc0
        return [
            *s.momentum(s.pore_pressure, v),
            Term("fluid", "storage", s.content * q, Kind.RATE),
            Term("fluid", "seepage", -InnerProduct(flux.fluid, gradient(q))),
            Term("cations", "storage", s.content * s.c * d, Kind.RATE, lumps=True),
            Term("cations", "diffusion and convection", -InnerProduct(flux.cations, gradient(d))),
            Term("charge", "projection", (s.content * s.cfc - reference_charge) * r),
        ]

    def excess(self, state: State, bath: BathFields) -> dict[str, CoefficientFunction]:
        wanted = self.equilibrium(bath, state.cfc, state.material)
        return {"fluid": state.p - wanted["p"], "cations": state.c - wanted["c"]}

    def references(self, concentration: float, stress: float, length: float) -> dict[str, float]:
        return {"u": length, "p": stress, "c": concentration, "cfc": concentration}

    def round_off(self, charge: float, RT: float) -> dict[str, float]:
        return {}

    def bounds(self, state: State) -> dict[str, CoefficientFunction]:
        return {"cation concentration": state.c, "c̃² + cfc²/4": state.root_squared}

    def solution_bounds(self, state: State) -> dict[str, CoefficientFunction]:
        return {"anion concentration c₊ − cfc": (1 + NEGLIGIBLE) * state.c - state.cfc}
