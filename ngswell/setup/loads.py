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
    4. `fluid_weight`: a body force on the fluid [N/mm³], which also drives seepage, if it has one: numbers or histories;
    5. `flows`: its terms of the other balances, if it has any, with `Role.EFFLUX` what leaves through a boundary;
    6. `check_start`: its refusals of the fields that a run goes on from, if any;
    7. `amiss`: what it finds not physical in a result, if anything.
    """

    schedules: tuple[Schedule, ...] = ()
    fluid_weight: tuple[float | Schedule, ...] | None = None

    def check_in(self, surroundings: Surroundings) -> None: ...

    def check_start(self, state: Any, time: float) -> None:
        """Refuse fields, the model's `state` at `time` [s]."""
        return

    def amiss(self, state: Any, time: float) -> str | None:
        """What is not physical in the model's `state` at `time` [s], and the remedy: said once a run."""
        return None

    def terms(self, state: Any, v: CoefficientFunction, clock: Clock) -> list[Term]:
        """Less the power of the load over the test displacement `v`; `state` holds the trial functions.

        Terms are integrated over the reference configuration. On a boundary `state.u` and `v` have tangential derivatives:
        `state.kinematics.area_vector(state.u)` is n da/dA.
        """
        ...

    def flows(self, tests: dict[str, CoefficientFunction], clock: Clock) -> list[Term]:
        """Terms tested with the test function of each balance, "fluid" and where the model has ions "cations"."""
        return []


@dataclass(frozen=True)
class Traction(Load):
    """Traction on a boundary [N/mm²], per area and in the direction of the reference configuration, eq. (36).

    Each component of `vector` is a number or a history, `(0.0, Ramp((0, 0.0), (60, -0.02)))`; a `Blend` varies in space.
    An `effective` traction is what the solid alone bears: the pore pressure p at the boundary, osmotic pressure included,
    adds its −p n per current area. A bath there has to give p: with a given flow in its place, or none, p and its gradient
    are both given on one side, from which diffusion does not follow. Raises InputError without one, where a bath presses
    as well, for values beyond ±1e3, and in directions in which a support holds the boundary.
    """

    boundary: str
    vector: tuple[float | Schedule, ...]
    effective: bool = field(default=False, kw_only=True)

    def __post_init__(self) -> None:
        checks.name("Traction: boundary", self.boundary, "top")
        checks.set_fields(self, vector=_components("Traction", self.vector, LARGEST_TRACTION, "N/mm²"))
        checks.flag("Traction: effective", self.effective)

    @property
    def schedules(self) -> tuple[Schedule, ...]:  # type: ignore[override]
        return _histories(self.vector)

    def check_in(self, surroundings: Surroundings) -> None:
        _check_components("Traction", self.vector, surroundings)
        names, fixed = surroundings.check_boundary("Traction", self.boundary), surroundings.fixed()
        for direction, entry in zip(surroundings.kinematics.directions, self.vector, strict=True):
            for name in names:
                if any(_values(entry)) and name in fixed[direction].split("|"):
                    raise InputError(f"Traction on {name!r}: a support holds it in {direction}, so it has no effect")
        wet = {name for bath in surroundings.baths for name in bath.boundary.split("|")}
        for name in names if self.effective else ():
            if name not in wet:
                raise InputError(
                    f"Traction on {name!r}: it is effective, and no bath gives the pore pressure there, so nothing fixes "
                    "the motion; give that boundary a Bath, or the traction on solid and fluid together, effective=False"
                )
        for bath in surroundings.baths if self.effective else ():
            if {*names} & {*bath.boundary.split("|")} and any(bath.hydraulic.values) and not bath.porous_plate:
                raise InputError(
                    f"Traction on {self.boundary!r}: it is effective, so that all of the pore pressure presses there, and "
                    "so does the bath's P; give the bath porous_plate=True"
                )
        check_histories(surroundings.mesh, self.boundary, self.schedules)

    def terms(self, state: Any, v: CoefficientFunction, clock: Clock) -> list[Term]:
        power = InnerProduct(CF(followed(self.vector, clock)), v)
        terms = [Term("momentum", "traction", -power, role=Role.LOAD, boundary=self.boundary)]
        if self.effective:
            area = state.cofactor * state.kinematics.normal  # all of it in the cells beside: osmotic pressure depends on J
            along = CF(tuple(area[i] for i in range(len(self.vector))))
            pressed = state.pore_pressure * InnerProduct(along, v)
            terms.append(
                Term("momentum", "pore pressure", pressed, role=Role.LOAD, boundary=self.boundary, normal_derivatives=True)
            )
        return terms


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
        for name in surroundings.check_surface("Pressure", self.boundary):
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

    The fluid's weight also drives seepage, as in (19). `fluid` and `solid` are vectors, such as (0, -1e-5), whose components
    are numbers or histories; in a centrifuge a `Blend` of none and the largest grows with the radius.
    """

    fluid: tuple[float | Schedule, ...]
    solid: tuple[float | Schedule, ...]

    def __post_init__(self) -> None:
        for name in ("fluid", "solid"):
            checks.set_fields(self, **{name: _components(f"Weight: {name}", getattr(self, name), 1.0, "N/mm³")})

    @property
    def schedules(self) -> tuple[Schedule, ...]:  # type: ignore[override]
        return _histories(self.fluid) + _histories(self.solid)

    @property
    def fluid_weight(self) -> tuple[float | Schedule, ...]:  # type: ignore[override]
        return self.fluid

    def check_in(self, surroundings: Surroundings) -> None:
        for vector in (self.fluid, self.solid):
            _check_components("Weight", vector, surroundings)
        if sum(load.fluid_weight is not None for load in surroundings.loads) > 1:
            raise InputError("loads hold more than one Weight; add the vectors up")
        for history in self.schedules:
            history.check_on(points(surroundings.mesh))

    def terms(self, state: Any, v: CoefficientFunction, clock: Clock) -> list[Term]:
        solid, fluid = (CF(followed(vector, clock)) for vector in (self.solid, self.fluid))
        force = state.material.nS0 * solid + state.content * fluid
        return [Term("momentum", "weight", -InnerProduct(force, v), role=Role.LOAD)]


def followed(vector: tuple[float | Schedule, ...], clock: Clock) -> tuple[float | CoefficientFunction, ...]:
    """The components of a vector at the clock's time."""
    return tuple(clock.follow(cast(Schedule, e)) if checks.is_a(e, Schedule) else cast(float, e) for e in vector)


def _components(what: str, vector: Any, limit: float, unit: str) -> tuple[float | Schedule, ...]:
    """`vector` as a tuple of numbers and histories, all within ±`limit`."""
    entries = checks.as_tuple(vector)
    checks.vector(what, vector if entries is None else [value for entry in entries for value in _values(entry)], limit, unit)
    return tuple(entry if checks.is_a(entry, Schedule) else checks.as_float(entry) for entry in entries or ())


def _histories(vector: tuple[float | Schedule, ...]) -> tuple[Schedule, ...]:
    return tuple(cast(Schedule, entry) for entry in vector if checks.is_a(entry, Schedule))


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
