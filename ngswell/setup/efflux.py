"""Fluid and salt that are driven through a boundary."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from ngsolve import CoefficientFunction

from ngswell import checks
from ngswell.baths.bath import check_histories
from ngswell.baths.treatment import Surroundings
from ngswell.errors import InputError
from ngswell.models.term import Role, Term
from ngswell.schedules import Clock, Schedule, schedule
from ngswell.setup.loads import Load

LARGEST_FLUX = {"fluid": 1e3, "cations": 1e4}
"""Effluxes beyond these [mm/s, mol/l mm/s] are none that can be meant."""


@dataclass(frozen=True)
class Efflux(Load):
    """What is made to leave through a boundary, per area of the reference configuration; what comes in is negative.

    `fluid` is the volume [mm/s], `cations` the amount of salt [mol/l mm/s], carried and diffused together, each a number or
    a history: fluid of concentration c that is let in at the rate q is `Efflux("bottom", fluid=-q, cations=-q * c)`; a
    membrane that keeps salt back lets fluid out alone. Raises InputError for fluxes beyond 1e3 mm/s and 1e4 mol/l mm/s, for
    none at all, where a bath decides what leaves, and for salt in a model that does not balance it.
    """

    boundary: str
    fluid: float | Schedule = 0.0
    cations: float | Schedule = 0.0
    histories: tuple[Schedule, Schedule] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        checks.name("Efflux: boundary", self.boundary, "bottom")
        histories = []
        for name, limit in LARGEST_FLUX.items():
            unit = "mm/s" if name == "fluid" else "mol/l mm/s"
            history = schedule(f"Efflux: {name} [{unit}]", getattr(self, name))
            for value in history.values:
                checks.number(f"Efflux: {name}", value, unit, -limit, limit)
            histories.append(history)
        if not any(value for history in histories for value in history.values):
            raise InputError(f"Efflux on {self.boundary!r}: nothing leaves or comes in; a boundary without one is sealed")
        checks.set_fields(self, histories=tuple(histories))

    @property
    def schedules(self) -> tuple[Schedule, ...]:  # type: ignore[override]
        return self.histories

    def check_in(self, surroundings: Surroundings) -> None:
        what = f"Efflux on {self.boundary!r}"
        names = surroundings.check_surface("Efflux", self.boundary)
        for name in names:
            if any(name in bath.boundary.split("|") for bath in surroundings.baths):
                raise InputError(f"{what}: {name!r} has a bath, which decides what leaves there; leave one of them out")
        for other in surroundings.loads:
            if other is not self and checks.is_a(other, Efflux) and {*other.boundary.split("|")} & {*names}:
                raise InputError(f"{what}: {other.boundary!r} has another Efflux; add them up")
        model = surroundings.model
        if any(self.histories[1].values) and "cations" not in model.balanced:
            raise InputError(f"{what}: {type(model).__name__} does not balance salt; take Potential or Concentration")
        check_histories(surroundings.mesh, self.boundary, self.schedules)

    def terms(self, state: Any, v: CoefficientFunction, clock: Clock) -> list[Term]:
        return []

    def flows(self, tests: dict[str, CoefficientFunction], clock: Clock) -> list[Term]:
        return [
            Term(balance, "given efflux", clock.follow(history) * tests[balance], role=Role.EFFLUX, boundary=self.boundary)
            for balance, history in zip(LARGEST_FLUX, self.histories, strict=True)
            if any(history.values)
        ]
