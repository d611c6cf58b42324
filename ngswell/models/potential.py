"""The same physics in unknowns that are continuous across a bath's boundary: exact baths, no charge field."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from ngsolve import H1, CoefficientFunction, FESpace, InnerProduct, Mesh

from ngswell.models.model import BathData, BathFields, FieldContext, check_order, needs_ions, needs_salt
from ngswell.models.term import Kind, Term
from ngswell.models.virtual_bath import VirtualBathState
from ngswell.physics import laws
from ngswell.physics.kinematics import Kinematics
from ngswell.physics.material import Material

ROOT_OF_ROUND_OFF = 3e-8
"""Twice the root of the last digit of 1."""


@dataclass(frozen=True)
class State(VirtualBathState):
    """Displacement, and the bath (P, c̃) with which the point would be in equilibrium."""

    def transport(self, frame: CoefficientFunction) -> laws.Transport:
        """Fluxes from gradients in the `frame` (a matrix on reference gradients): `pull` or `push`."""
        drive, gradient = self.drive(self.P), self.kinematics.flow_gradient(self.salt)

        def flux(material: Material, frame: CoefficientFunction) -> laws.Transport:
            return laws.transport_by_potentials(
                material, self.J, self.salt, self.pointwise_charge, frame * drive, frame * gradient
            )

        return laws.Transport(*self.through(frame, flux))

    def outputs(self) -> dict[str, CoefficientFunction]:
        """Named fields in the current configuration; `OUTPUT_UNITS` has their units."""
        flux = self.transport(self.push)
        return {**self.ion_outputs(), "seepage": flux.fluid, "cation_flux": flux.cations}


@dataclass(frozen=True)
class Potential:
    """Unknowns u (order k), P and c̃ (order k − 1): hydraulic pressure and salt concentration of a virtual bath.

    c̃ and P are those of the bath with which the point would be in Donnan equilibrium: c₊ c₋ = (Γ c̃)² and p = p_D(c̃, cfc, P),
    eqs. (23), (38). They stand for the chemical potentials of salt and fluid. A bath prescribes them whatever the
    deformation, and no gradient of the charge is left; ions and overall pressure follow from the charge at the point.
    """

    order: int = 2

    positive: ClassVar[tuple[str, ...]] = ("salt",)
    charge_field: ClassVar[str | None] = None
    unknowns: ClassVar[tuple[str, ...]] = ("u", "P", "salt")
    balanced: ClassVar[dict[str, str]] = {"fluid": "P", "cations": "salt"}
    evolving: ClassVar[dict[str, float]] = {"u": 1e-2, "P": 1e-1, "salt": 1e-1}

    def __post_init__(self) -> None:
        check_order("Potential", self.order)

    def check(self, material: Material, baths: Sequence[BathData]) -> None:
        needs_ions("Potential", material)
        needs_salt("Potential", baths)

    def space(self, mesh: Mesh, kinematics: Kinematics, fixed: dict[str, str], prescribed: str) -> FESpace:
        Q = H1(mesh, order=self.order - 1, dirichlet=prescribed)
        return FESpace([kinematics.space(mesh, self.order, fixed), Q, Q])

    def state(self, functions: Sequence[CoefficientFunction], context: FieldContext) -> State:
        return State(context, *functions)

    def equilibrium(self, bath: BathFields, cfc: CoefficientFunction, material: Material) -> dict[str, CoefficientFunction]:
        return {"P": bath.P, "salt": bath.salt}

    def terms(self, state: State, tests: Sequence[CoefficientFunction]) -> list[Term]:
        v, q, d = tests
        gradient = state.kinematics.flow_gradient
        flux = state.transport(state.pull)
        return [
            *state.momentum(state.pore_pressure, v),
            Term("fluid", "storage", state.content * q, Kind.RATE),
            Term("fluid", "seepage", -InnerProduct(flux.fluid, gradient(q))),
            Term("cations", "storage", state.content * state.cations * d, Kind.RATE, lumps=True),
            Term("cations", "diffusion and convection", -InnerProduct(flux.cations, gradient(d))),
        ]

    def excess(self, state: State, bath: BathFields) -> dict[str, CoefficientFunction]:
        return {"fluid": state.P - bath.P, "cations": state.salt - bath.salt}

    def references(self, concentration: float, stress: float, length: float) -> dict[str, float]:
        return {"u": length, "P": stress, "salt": concentration}

    def round_off(self, charge: float, RT: float) -> dict[str, float]:
        """Stored cations see c̃²/cfc beside cfc: c̃ below the root of round-off times cfc drowns, and P with it."""
        salt = ROOT_OF_ROUND_OFF * charge
        return {"salt": salt, "P": 2 * RT * salt}

    def bounds(self, state: State) -> dict[str, CoefficientFunction]:
        return {"salt concentration c̃": state.salt}

    def solution_bounds(self, state: State) -> dict[str, CoefficientFunction]:
        return {}
