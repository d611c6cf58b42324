"""What loads the body: tractions and weight."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

from ngsolve import CF, CoefficientFunction, InnerProduct

from ngswell import checks
from ngswell.baths.treatment import Surroundings
from ngswell.errors import InputError
from ngswell.models.term import Role, Term
from ngswell.schedules import Clock, Schedule


@runtime_checkable
class Load(Protocol):
    """A force from outside. A load of one's own derives from this and gives, numbered:

    1. `check_in`: its refusals;
    2. `terms`: its terms of the momentum balance, with `Role.LOAD`;
    3. `schedules`: the histories that it follows, if any; `clock.follow(history)` makes the field that a term takes;
    4. `fluid_weight`: a body force on the fluid [N/mm³], which also drives seepage, if it has one.
    """

    schedules: tuple[Schedule, ...] = ()
    fluid_weight: tuple[float, ...] | None = None

    def check_in(self, surroundings: Surroundings) -> None: ...

    def terms(self, state: Any, v: CoefficientFunction, clock: Clock) -> list[Term]:
        """Less the power of the load over the test displacement `v`; `state` holds the trial functions.

        Terms are integrated over the reference configuration. On a boundary `state.u` and `v` have tangential derivatives:
        `state.kinematics.area_vector(state.u)` is n da/dA.
        """
        ...


@dataclass(frozen=True)
class Traction(Load):
    """Traction on a boundary [N/mm²], per area and in the direction of the reference configuration, eq. (36)."""

    boundary: str
    vector: tuple[float, ...]

    def __post_init__(self) -> None:
        checks.name("Traction: boundary", self.boundary, "top")
        checks.set_fields(self, vector=checks.vector("Traction", self.vector, 1e3, "N/mm²"))

    def check_in(self, surroundings: Surroundings) -> None:
        _check_components("Traction", self.vector, surroundings)
        names, fixed = surroundings.check_boundary("Traction", self.boundary), surroundings.fixed()
        for direction, value in zip(surroundings.kinematics.directions, self.vector, strict=True):
            for name in names:
                if value and name in fixed[direction].split("|"):
                    raise InputError(f"Traction on {name!r}: a support holds it in {direction}, so it has no effect")

    def terms(self, state: Any, v: CoefficientFunction, clock: Clock) -> list[Term]:
        power = InnerProduct(CF(self.vector), v)
        return [Term("momentum", "traction", -power, role=Role.LOAD, boundary=self.boundary)]


@dataclass(frozen=True)
class Weight(Load):
    """Body force ρ b of (16) from the specific weights of solid and fluid substance [N/mm³]; water has 1e-5.

    The fluid's weight also drives seepage, as in (19). `fluid` and `solid` are vectors, such as (0, -1e-5).
    """

    fluid: tuple[float, ...]
    solid: tuple[float, ...]

    def __post_init__(self) -> None:
        for name in ("fluid", "solid"):
            checks.set_fields(self, **{name: checks.vector(f"Weight: {name}", getattr(self, name), 1.0, "N/mm³")})

    @property
    def fluid_weight(self) -> tuple[float, ...]:  # type: ignore[override]
        return self.fluid

    def check_in(self, surroundings: Surroundings) -> None:
        for vector in (self.fluid, self.solid):
            _check_components("Weight", vector, surroundings)
        if sum(load.fluid_weight is not None for load in surroundings.loads) > 1:
            raise InputError("loads hold more than one Weight; add the vectors up")

    def terms(self, state: Any, v: CoefficientFunction, clock: Clock) -> list[Term]:
        force = state.material.nS0 * CF(self.solid) + state.content * CF(self.fluid)
        return [Term("momentum", "weight", -InnerProduct(force, v), role=Role.LOAD)]


def _check_components(what: str, vector: tuple[float, ...], surroundings: Surroundings) -> None:
    if len(vector) != surroundings.mesh.dim:
        raise InputError(f"{what}: {vector} needs {surroundings.mesh.dim} components")
