"""The same physics in unknowns that are continuous across a bath's boundary: exact baths, no charge field."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

from ngsolve import H1, CoefficientFunction, FESpace, InnerProduct, Mesh

from ngswell.baths.bath import Bath, BathFields, Essential, Penalty
from ngswell.models.model import Setting, Term, check_order, needs_salt
from ngswell.models.solid_state import SolidState
from ngswell.physics import donnan, laws
from ngswell.physics.kinematics import Kinematics
from ngswell.physics.material import Material


@dataclass(frozen=True)
class State(SolidState):
    """Displacement, and the bath (P, c̃) with which the point would be in equilibrium."""

    P: CoefficientFunction
    salt: CoefficientFunction

    @cached_property
    def pore_pressure(self) -> CoefficientFunction:
        """Overall pressure p, eq. (38) for that bath and the charge at the point [N/mm²]."""
        m = self.material
        return donnan.pressure(self.salt, self.pointwise_charge, m.RT, self.P, m.Gamma, m.phi, m.phi_bath)

    @cached_property
    def cations(self) -> CoefficientFunction:
        """c₊ of (23)₁ for that bath [mol/l]."""
        return donnan.cations(self.salt, self.pointwise_charge, self.material.Gamma)

    @cached_property
    def anions(self) -> CoefficientFunction:
        """c₋ [mol/l]."""
        return donnan.anions(self.salt, self.pointwise_charge, self.material.Gamma)

    def transport(self, frame: CoefficientFunction) -> laws.Transport:
        """Fluxes from gradients in the `frame` (a matrix on reference gradients): `pull` or `push`."""
        gradients = (frame * self.drive(self.P), frame * self.kinematics.flow_gradient(self.salt))
        return laws.transport_by_potentials(self.material, self.nF, self.salt, self.pointwise_charge, *gradients)

    def outputs(self) -> dict[str, CoefficientFunction]:
        """Named fields in the current configuration; `ngswell.models.solid_state.OUTPUT_UNITS` has their units."""
        flux = self.transport(self.push)
        return {
            **self.solid_outputs(self.pore_pressure),
            "p": self.pore_pressure,
            "hydraulic_pressure": self.P - 2 * self.material.phi_bath * self.material.RT * self.salt,
            "c_plus": self.cations,
            "c_minus": self.anions,
            "cfc": self.pointwise_charge,
            "seepage": flux.fluid,
            "cation_flux": flux.cations,
        }


@dataclass(frozen=True)
class Potential:
    """Unknowns u (order k), P and c̃ (order k − 1): hydraulic pressure and salt concentration of a virtual bath.

    c̃ and P are those of the bath with which the point would be in Donnan equilibrium: c₊ c₋ = (Γ c̃)² and p = p_D(c̃, cfc, P),
    eqs. (23), (38). They stand for the chemical potentials of salt and fluid. A bath prescribes them whatever the
    deformation, and no gradient of the charge is left; ions and overall pressure follow from the charge at the point.
    """

    order: int = 2

    unknowns: ClassVar[tuple[str, ...]] = ("u", "P", "salt")
    balances: ClassVar[tuple[str, ...]] = ("momentum", "fluid", "cations")
    held: ClassVar[dict[str, str]] = {"fluid": "P", "cations": "salt"}
    evolving: ClassVar[dict[str, float]] = {"u": 1e-2, "P": 1e-1, "salt": 1e-1}
    treatments: ClassVar[tuple[type, ...]] = (Essential, Penalty)

    def __post_init__(self) -> None:
        check_order("Potential", self.order)

    def default_treatment(self) -> Essential:
        return Essential()

    def check(self, material: Material, baths: Sequence[Bath]) -> None:
        needs_salt("Potential", baths)

    def space(self, mesh: Mesh, kinematics: Kinematics, held: dict[str, str], essential: str) -> FESpace:
        Q = H1(mesh, order=self.order - 1, dirichlet=essential)
        return FESpace([kinematics.space(mesh, self.order, held), Q, Q])

    def state(self, functions: Sequence[CoefficientFunction], setting: Setting) -> State:
        return State(setting, *functions)

    def equilibrium(self, bath: BathFields, cfc: CoefficientFunction, material: Material) -> dict[str, CoefficientFunction]:
        return {"P": bath.P, "salt": bath.c}

    def terms(self, state: State, tests: Sequence[CoefficientFunction]) -> list[Term]:
        v, q, d = tests
        gradient = state.kinematics.flow_gradient
        flux = state.transport(state.pull)
        return [
            *state.momentum(state.pore_pressure, v),
            Term("fluid", "storage", state.content * q, "rate"),
            Term("fluid", "seepage", -InnerProduct(flux.fluid, gradient(q))),
            Term("cations", "storage", state.content * state.cations * d, "rate"),
            Term("cations", "diffusion and convection", -InnerProduct(flux.cations, gradient(d))),
        ]

    def excess(self, state: State, bath: BathFields) -> dict[str, CoefficientFunction]:
        return {"fluid": state.P - bath.P, "cations": state.salt - bath.c}

    def references(self, concentration: float, stress: float, length: float) -> dict[str, float]:
        return {"u": length, "P": stress, "salt": concentration}

    def bounds(self, state: State) -> dict[str, CoefficientFunction]:
        return {"salt concentration c̃": state.salt}

    def solution_bounds(self, state: State) -> dict[str, CoefficientFunction]:
        return {}
