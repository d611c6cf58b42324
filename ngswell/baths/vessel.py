"""What holds a bath of finite volume."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple, cast

import numpy as np
from ngsolve import CoefficientFunction

from ngswell import checks
from ngswell.errors import InputError
from ngswell.models.one_number import Functions, OneNumber
from ngswell.models.term import Kind, Term
from ngswell.schedules import Clock, Schedule, schedule

VOLUMES = (1e-12, 1e12)
"""Volumes that a bath may have [mm³]."""


PIECES = 65
"""Points at which a history is taken between its kinks and bends."""


class Feed(NamedTuple):
    """What is let in and out, in the forms: rates [mm³/s] and the concentration of what comes in [mol/l]."""

    inflow: CoefficientFunction
    outflow: CoefficientFunction
    c_in: CoefficientFunction


@dataclass(frozen=True)
class Vessel:
    """A vessel whose stirred bath is changed by what the gel takes and gives. Volume V and concentration c̄ are unknowns:

        dV/dt = efflux of fluid from the gel + inflow − outflow,
        d(V c̄)/dt = efflux of cations from the gel + inflow c_in − outflow c̄.

    `volume` is V at the start, `inflow` and `outflow` are rates per second, numbers or histories; [mm³] on solids, beads
    and axisymmetric bodies (whole turns), [mm²] per thickness in plane strain and per length of a cylinder, [mm] per area in
    a column. `c_in` is the salt
    concentration of what comes in [mol/l]. Raises InputError for volumes below 1e-12 or beyond 1e12, for rates that are
    negative, and for an inflow without a concentration.
    """

    volume: float
    inflow: float | Schedule = 0.0
    outflow: float | Schedule = 0.0
    c_in: float | Schedule | None = None
    schedules: tuple[Schedule, Schedule, Schedule] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        hint = "[mm³], in plane strain [mm²], in a column [mm]; leave the vessel out for a bath that never changes"
        volume = checks.number("Vessel: volume", self.volume, "mm³", *VOLUMES, hint=hint)
        rates = {name: schedule(f"Vessel: {name} [mm³/s]", getattr(self, name)) for name in ("inflow", "outflow")}
        for name, history in rates.items():
            for value in history.values:
                checks.number(f"Vessel: {name}", value, "mm³/s", 0.0, VOLUMES[1], "none of the two rates is negative")
        if self.c_in is None and any(rates["inflow"].values):
            raise InputError("Vessel: an inflow needs the salt concentration of what comes in, c_in [mol/l]")
        c_in = schedule("Vessel: c_in [mol/l]", 0.0 if self.c_in is None else self.c_in)
        for value in c_in.values:
            checks.number("Vessel: c_in", value, "mol/l", 0.0, 10.0, "1 mol/l = 1000 mol/m³")
        for name, history in {**rates, "c_in": c_in}.items():
            if not history.uniform:
                raise InputError(f"Vessel: {name} varies in space, but its bath is stirred: give a number or a Ramp")
        checks.set_fields(self, volume=volume, schedules=(*rates.values(), c_in))

    def __str__(self) -> str:
        return ", stirred, with in- and outflow" if self.fed else ", stirred"

    @property
    def fed(self) -> bool:
        """Whether anything is ever let in or out."""
        inflow, outflow, _ = self.schedules
        return any(inflow.values) or any(outflow.values)

    def let_in(self, begin: float, end: float) -> float:
        """Volume let in less that let out from `begin` to `end` [s]; by trapezia, exact for ramps."""
        inflow, outflow, _ = self.schedules
        marks = {begin, end, *(t for s in (inflow, outflow) for t in (*s.kinks, *s.bends) if begin < t < end)}
        times = np.concatenate([np.linspace(a, b, PIECES) for a, b in pairwise(sorted(marks))])
        rates = np.array([cast(float, inflow.at(t)) - cast(float, outflow.at(t)) for t in times])
        return float((np.diff(times) * (rates[1:] + rates[:-1]) / 2).sum())

    def numbers(self, boundary: str, c: float, size: float) -> dict[str, OneNumber]:
        """Its unknowns by the balance of the gel that they face: V, and c̄, `c` at the start, of natural `size` [mol/l]."""
        return {
            "fluid": OneNumber(f"volume of the bath on {boundary}", self.volume, self.volume, evolves=1e-1, positive=True),
            "cations": OneNumber(f"salt of the bath on {boundary}", size, c, evolves=1e-1, positive=True),
        }

    def sums(
        self,
        boundary: str,
        numbers: Mapping[str, OneNumber],
        functions: Mapping[str, Functions],
        area: float,
        in_gel: Mapping[str, CoefficientFunction],
        held: Mapping[str, float],
    ) -> list[Term]:
        """In place of its balances: gel and bath hold together what is `held`, by name; `in_gel` per reference volume."""
        volume, salt = functions["fluid"].trial, functions["cations"].trial
        terms = []
        for balance, there in (("fluid", volume), ("cations", volume * salt)):
            name, test = numbers[balance].name, functions[balance].test
            terms.append(Term(name, "held by the gel", in_gel[balance] * test))
            terms.append(Term(name, "held by the bath, less all", (there - held[name]) * test / area, boundary=boundary))
        return terms

    def follow(self, clock: Clock) -> Feed:
        """Its histories at the clock's time."""
        return Feed(*map(clock.follow, self.schedules))

    def terms(
        self,
        boundary: str,
        numbers: Mapping[str, OneNumber],
        functions: Mapping[str, Functions],
        area: float,
        clock: Clock,
    ) -> list[Term]:
        """Its two balances but for what the gel gives, as means over the `area` of the boundary [mm²]."""
        volume, salt = functions["fluid"], functions["cations"]
        contents = {"fluid": volume.trial, "cations": volume.trial * salt.trial}
        terms = [
            Term(numbers[b].name, "content", held * functions[b].test / area, Kind.RATE, boundary=boundary)
            for b, held in contents.items()
        ]
        if not self.fed:
            return terms
        feed = self.follow(clock)
        lost = {"fluid": feed.outflow - feed.inflow, "cations": feed.outflow * salt.trial - feed.inflow * feed.c_in}
        terms += [
            Term(numbers[b].name, "in- and outflow", rate * functions[b].test / area, boundary=boundary)
            for b, rate in lost.items()
        ]
        return terms
