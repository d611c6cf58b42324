"""The variants: the paper's model with another state, and for some another place of the bath integrals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from ngsolve import CF, CoefficientFunction

from ngswell import Concentration, Potential, Scene
from ngswell.models.concentration import State
from ngswell.models.model import BathFields, FieldContext
from ngswell.physics import laws
from studies.limits.convergence.from_cells import from_cells
from studies.scenes import with_model


class SmoothState(State):
    """The smooth p in the momentum balance."""

    @property
    def pore_pressure(self) -> CoefficientFunction:
        return self.p


class ElementwiseState(State):
    """The charge at the point, and its gradient element by element, in the fluxes."""

    def transport(self, frame: CoefficientFunction) -> laws.Transport:
        """Fluxes with Grad cfc(J) = −cfc/(J − nS0) Grad J, Grad J = Cof F : Grad Grad u; jumps of J are missed."""
        second = self.u.Operator("hesse")  # row i: u_i,xx u_i,xy u_i,yx u_i,yy
        grad_J = CF(tuple(sum(self.cofactor[i, j] * second[i, 2 * j + k] for i in (0, 1) for j in (0, 1)) for k in (0, 1)))
        gradient, cfc = self.kinematics.flow_gradient, self.pointwise_charge
        gradients = (frame * g for g in (self.drive(self.p), gradient(self.c), -cfc / self.content * grad_J))
        return laws.transport(self.material, self.J, self.c, cfc, *gradients)


class ElementwiseSmoothState(ElementwiseState, SmoothState):
    """Elementwise charge and smooth p: without any charge field."""


@dataclass(frozen=True)
class Variant(Concentration):
    """The paper's model with another state."""

    kind: type[State] = State

    def state(self, functions: Sequence[CoefficientFunction], context: FieldContext) -> State:
        return self.kind(context, *functions)


@dataclass(frozen=True)
class Elementwise(Variant):
    """The charge at the point in the bath condition too; the charge field is carried along, and nothing reads it."""

    def excess(self, state: State, bath: BathFields) -> dict[str, CoefficientFunction]:
        return super().excess(replace(state, cfc=state.pointwise_charge), bath)


VARIANTS: dict[str, Concentration] = {
    "present": Concentration(),
    "smooth": Variant(kind=SmoothState),
    "elementwise": Elementwise(kind=ElementwiseSmoothState),
    "elementwise_pointwise": Elementwise(kind=ElementwiseState),
}


def as_variant(scene: Scene, name: str) -> Scene:
    """The scene with another discretisation; `potential` is the toolkit's default model with exact baths."""
    if name == "potential":
        return with_model(scene, Potential())
    model = VARIANTS[name]
    return from_cells(scene, model) if isinstance(model, Elementwise) else replace(scene, model=model)
