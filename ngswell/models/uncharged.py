"""No charge, no ions: finite-strain consolidation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from ngsolve import H1, CoefficientFunction, FESpace, InnerProduct, Mesh

from ngswell.baths import Bath, BathFields, Essential, Penalty
from ngswell.errors import InputError
from ngswell.kinematics import Kinematics
from ngswell.materials import Field, Material
from ngswell.models.mechanics import SolidState
from ngswell.models.terms import Term, check_order
from ngswell.supports import Weight


@dataclass(frozen=True)
class State(SolidState):
    """Displacement and pore pressure p."""

    p: CoefficientFunction

    def seepage(self, frame: CoefficientFunction) -> CoefficientFunction:
        """Darcy's law nF wF = −K grad p in the `frame` (`pull` or `push`) [mm/s]."""
        return -self.permeability * (frame * self.drive(self.p))

    def outputs(self) -> dict[str, CoefficientFunction]:
        """Named fields in the current configuration; `ngswell.models.OUTPUT_UNITS` has their units."""
        return {**self.solid_outputs(self.p), "p": self.p, "seepage": self.seepage(self.push)}


@dataclass(frozen=True)
class Uncharged:
    """Unknowns u (order k) and p (order k − 1): the concentration model for cfc0 = 0, whose salt then only drifts along."""

    order: int = 2

    unknowns: ClassVar[tuple[str, ...]] = ("u", "p")
    balances: ClassVar[tuple[str, ...]] = ("momentum", "fluid")
    held: ClassVar[dict[str, str]] = {"fluid": "p"}
    evolving: ClassVar[dict[str, float]] = {"u": 1e-2, "p": 1e-1}
    treatments: ClassVar[tuple[type, ...]] = (Essential, Penalty)

    def __post_init__(self) -> None:
        check_order("Uncharged", self.order)

    def default_treatment(self) -> Essential:
        return Essential()

    def check(self, material: Material, baths: Sequence[Bath]) -> None:
        if not isinstance(material.cfc0, (int, float)) or material.cfc0 != 0:
            value = f"{material.cfc0:g}" if isinstance(material.cfc0, (int, float)) else "a field"
            remedy = "use Concentration or LocalDonnan"
            raise InputError(f"Uncharged: the material has cfc0 other than 0 ({value}, mol/l); {remedy}")
        for bath in baths:
            if bath.c is not None:
                raise InputError(f"bath on {bath.boundary!r}: Uncharged has no ions, so it takes no concentration c")

    def space(self, mesh: Mesh, kinematics: Kinematics, held: dict[str, str], essential: str) -> FESpace:
        V = kinematics.space(mesh, self.order, held)
        return FESpace([V, H1(mesh, order=self.order - 1, dirichlet=essential)])

    def state(
        self,
        functions: Sequence[CoefficientFunction],
        material: Material,
        kinematics: Kinematics,
        charge: Field,
        weight: Weight | None,
        bath: BathFields | None,
    ) -> State:
        return State(material, kinematics, charge, weight, *functions)

    def equilibrium(self, bath: BathFields, cfc: CoefficientFunction, material: Material) -> dict[str, CoefficientFunction]:
        return {"p": bath.P}

    def terms(self, state: State, tests: Sequence[CoefficientFunction]) -> list[Term]:
        v, q = tests
        flux = state.seepage(state.pull)
        return [
            *state.momentum(state.p, v),
            Term("fluid", "storage", state.content * q, "rate"),
            Term("fluid", "seepage", -InnerProduct(flux, state.kinematics.flow_gradient(q))),
        ]

    def weak_terms(
        self, state: State, tests: Sequence[CoefficientFunction], bath: BathFields, factors: tuple[Field, Field]
    ) -> dict[str, CoefficientFunction]:
        return {"fluid": factors[0] * (state.p - bath.P) * tests[1]}

    def references(self, concentration: float, stress: float, length: float) -> dict[str, float]:
        return {"u": length, "p": stress}

    def bounds(self, state: State) -> dict[str, CoefficientFunction]:
        return {"fluid content J − nS0": state.content}
