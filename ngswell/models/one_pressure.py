"""What models of a displacement and one pressure share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from ngsolve import H1, CoefficientFunction, FESpace, InnerProduct, Mesh

from ngswell.baths.bath import BathFields, Essential, Penalty
from ngswell.models.model import Term, check_order
from ngswell.physics.kinematics import Kinematics
from ngswell.physics.material import Material


@dataclass(frozen=True)
class OnePressure:
    """Unknowns u (order k) and a hydraulic pressure (order k − 1) that a bath prescribes whatever the deformation.

    The state has `pressure`, `pore_pressure` and `seepage(frame)`.
    """

    order: int = 2

    unknowns: ClassVar[tuple[str, ...]]
    balances: ClassVar[tuple[str, ...]] = ("momentum", "fluid")
    treatments: ClassVar[tuple[type, ...]] = (Essential, Penalty)

    def __post_init__(self) -> None:
        check_order(type(self).__name__, self.order)

    def default_treatment(self) -> Essential:
        return Essential()

    def space(self, mesh: Mesh, kinematics: Kinematics, held: dict[str, str], essential: str) -> FESpace:
        V = kinematics.space(mesh, self.order, held)
        return FESpace([V, H1(mesh, order=self.order - 1, dirichlet=essential)])

    def equilibrium(self, bath: BathFields, cfc: CoefficientFunction, material: Material) -> dict[str, CoefficientFunction]:
        return {self.unknowns[1]: bath.P}

    def terms(self, state: Any, tests: Sequence[CoefficientFunction]) -> list[Term]:
        v, q = tests
        flux = state.seepage(state.pull)
        return [
            *state.momentum(state.pore_pressure, v),
            Term("fluid", "storage", state.content * q, "rate"),
            Term("fluid", "seepage", -InnerProduct(flux, state.kinematics.flow_gradient(q))),
        ]

    def excess(self, state: Any, bath: BathFields) -> dict[str, CoefficientFunction]:
        return {"fluid": state.pressure - bath.P}

    def references(self, concentration: float, stress: float, length: float) -> dict[str, float]:
        return {"u": length, self.unknowns[1]: stress}

    def bounds(self, state: Any) -> dict[str, CoefficientFunction]:
        return {}

    def solution_bounds(self, state: Any) -> dict[str, CoefficientFunction]:
        return {}
