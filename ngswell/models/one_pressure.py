"""What models of a displacement and one pressure share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from ngsolve import H1, CoefficientFunction, FESpace, InnerProduct, Mesh

from ngswell.models.model import BathFields, check_order
from ngswell.models.term import Kind, Term
from ngswell.physics.kinematics import Kinematics
from ngswell.physics.material import Material


@dataclass(frozen=True)
class OnePressure:
    """Unknowns u (order k) and a hydraulic pressure (order k − 1) that a bath prescribes whatever the deformation.

    The state has `pressure`, `pore_pressure` and `seepage(frame)`.
    """

    order: int = 2

    positive: ClassVar[tuple[str, ...]] = ()
    charge_field: ClassVar[str | None] = None
    unknowns: ClassVar[tuple[str, ...]]

    def __post_init__(self) -> None:
        check_order(type(self).__name__, self.order)

    def space(self, mesh: Mesh, kinematics: Kinematics, fixed: dict[str, str], prescribed: str) -> FESpace:
        V = kinematics.space(mesh, self.order, fixed)
        return FESpace([V, H1(mesh, order=self.order - 1, dirichlet=prescribed)])

    def equilibrium(self, bath: BathFields, cfc: CoefficientFunction, material: Material) -> dict[str, CoefficientFunction]:
        return {self.unknowns[1]: bath.P}

    def terms(self, state: Any, tests: Sequence[CoefficientFunction]) -> list[Term]:
        v, q = tests
        flux = state.seepage(state.pull)
        return [
            *state.momentum(state.pore_pressure, v),
            Term("fluid", "storage", state.content * q, Kind.RATE),
            Term("fluid", "seepage", -InnerProduct(flux, state.kinematics.flow_gradient(q))),
        ]

    def excess(self, state: Any, bath: BathFields) -> dict[str, CoefficientFunction]:
        return {"fluid": state.pressure - bath.P}

    def references(self, concentration: float, stress: float, length: float) -> dict[str, float]:
        return {"u": length, self.unknowns[1]: stress}

    def round_off(self, charge: float, RT: float) -> dict[str, float]:
        return {}

    def bounds(self, state: Any) -> dict[str, CoefficientFunction]:
        return {}

    def solution_bounds(self, state: Any) -> dict[str, CoefficientFunction]:
        return {}
