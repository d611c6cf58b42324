"""What loads the body: tractions, pressures and weight."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Protocol, cast, runtime_checkable

import numpy as np
from ngsolve import CF, CoefficientFunction, InnerProduct, specialcf

from ngswell import checks
from ngswell.baths.bath import check_histories, pressing
from ngswell.baths.treatment import Surroundings
from ngswell.errors import InputError
from ngswell.mesh.points import points
from ngswell.models.term import Role, Term
from ngswell.schedules import Clock, Schedule, schedule

LARGEST_TRACTION = 1e3
"""Forces per area beyond this [N/mm²] are none that can be meant."""


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
    """Traction on a boundary [N/mm²], per area and in the direction of the reference configuration, eq. (36).

    Each component of `vector` is a number or a history, `(0.0, Ramp((0, 0.0), (60, -0.02)))`; a `Blend` varies in space.
    Raises InputError for values beyond ±1e3 and in directions in which a support holds the boundary.
    """

    boundary: str
    vector: tuple[float | Schedule, ...]

    def __post_init__(self) -> None:
        checks.name("Traction: boundary", self.boundary, "top")
        entries = checks.as_tuple(self.vector)
        values = self.vector if entries is None else [value for entry in entries for value in _values(entry)]
        checks.vector("Traction", values, LARGEST_TRACTION, "N/mm²")
        vector = (entry if checks.is_a(entry, Schedule) else checks.as_float(entry) for entry in entries or ())
        checks.set_fields(self, vector=tuple(vector))

    @property
    def schedules(self) -> tuple[Schedule, ...]:  # type: ignore[override]
        return tuple(cast(Schedule, entry) for entry in self.vector if checks.is_a(entry, Schedule))

    def check_in(self, surroundings: Surroundings) -> None:
        _check_components("Traction", self.vector, surroundings)
        names, fixed = surroundings.check_boundary("Traction", self.boundary), surroundings.fixed()
        for direction, entry in zip(surroundings.kinematics.directions, self.vector, strict=True):
            for name in names:
                if any(_values(entry)) and name in fixed[direction].split("|"):
                    raise InputError(f"Traction on {name!r}: a support holds it in {direction}, so it has no effect")
        check_histories(surroundings.mesh, self.boundary, self.schedules)

    def terms(self, state: Any, v: CoefficientFunction, clock: Clock) -> list[Term]:
        vector = [clock.follow(cast(Schedule, e)) if checks.is_a(e, Schedule) else e for e in self.vector]
        return [Term("momentum", "traction", -InnerProduct(CF(tuple(vector)), v), role=Role.LOAD, boundary=self.boundary)]


@dataclass(frozen=True)
class Pressure(Load):
    """Pressure on a boundary [N/mm²] that follows it: −P n per current area, n the current outer normal.

    `P` is a number or a history. It presses on solid and fluid together, the total stress of (16); a bath presses by itself,
    `Bath(..., P=...)`. Raises InputError for values beyond ±1e3 and on a boundary that a support holds along its normal.
    """

    boundary: str
    P: float | Schedule
    history: Schedule = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        checks.name("Pressure: boundary", self.boundary, "top")
        checks.set_fields(self, history=schedule("Pressure: P [N/mm²]", self.P))
        for value in self.history.values:
            checks.number("Pressure: P", value, "N/mm²", -LARGEST_TRACTION, LARGEST_TRACTION, "1 N/mm² = 1e6 Pa")

    @property
    def schedules(self) -> tuple[Schedule, ...]:  # type: ignore[override]
        return (self.history,)

    def check_in(self, surroundings: Surroundings) -> None:
        fixed = surroundings.fixed()
        for name in surroundings.check_boundary("Pressure", self.boundary):
            along = _normal_directions(surroundings, name)
            if all(name in fixed[direction].split("|") for direction in along):
                raise InputError(f"Pressure on {name!r}: a support holds it along its normal, so it has no effect")
        check_histories(surroundings.mesh, self.boundary, self.schedules)

    def terms(self, state: Any, v: CoefficientFunction, clock: Clock) -> list[Term]:
        pressure = clock.follow(self.history)
        return [pressing("pressure", self.boundary, pressure, state.kinematics, state.u, v)]


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


def _check_components(what: str, vector: tuple[float | Schedule, ...], surroundings: Surroundings) -> None:
    if len(vector) != surroundings.mesh.dim:
        raise InputError(f"{what}: {vector} needs {surroundings.mesh.dim} components")


def _values(entry: Any) -> tuple[float, ...]:
    """All that a component passes."""
    return entry.values if checks.is_a(entry, Schedule) else (entry,)


def _normal_directions(surroundings: Surroundings, name: str) -> list[str]:
    """Directions along which the normal of a boundary has a component anywhere."""
    mesh, directions = surroundings.mesh, surroundings.kinematics.directions
    if mesh.dim == 1:
        return list(directions)
    normals = np.abs(specialcf.normal(mesh.dim)(points(mesh, mesh.Boundaries(name), 2)))
    return [direction for direction, size in zip(directions, normals.max(axis=0), strict=True) if size > 1e-9]
