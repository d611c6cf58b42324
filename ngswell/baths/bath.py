"""Baths on named boundaries, and the ways of imposing Donnan equilibrium there.

The condition p = p_D(c̄, cfc), c = c_D(c̄, cfc), eqs. (23), depends on the deformation through cfc. A treatment says how it
enters: weakly, as an efflux, or as prescribed values with a charge known before the step.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, NamedTuple, TypeAlias

from ngsolve import CoefficientFunction

from ngswell import checks
from ngswell.baths.sampling import SamplingRule
from ngswell.errors import InputError
from ngswell.physics.material import Field, Material
from ngswell.schedules import Schedule, schedule


class BathFields(NamedTuple):
    """A bath in the forms: salt concentration c̄ [mol/l] (None without ions) and hydraulic pressure P̄ [N/mm²]."""

    c: CoefficientFunction
    P: CoefficientFunction


def _per_cell(material: Material, h: Field, multiple: float = 1.0) -> tuple[Field, Field]:
    """That multiple of K/h [mm³/(N s)] and of D₊/h [mm/s], for cells of the size h [mm] normal to the boundary."""
    return multiple * material.K / h, multiple * material.D_plus / h


@dataclass(frozen=True)
class Penalty:
    """Equilibrium imposed weakly, the third terms of (27) and (32), with the sign that makes them coercive:

        fluid efflux q̄ = ε (p − p_D),   cation efflux j̄ = ε (c − c_D)    per current area.

    Give either the paper's raw ε (`Penalty(40.0)`: mm³/(N s) for p and mm/s for c, one number for both dimensions) or
    `Penalty(relative=1e3)`: that multiple of K/h for p and of D₊/h for c, h being the size of the cells at the boundary.
    """

    epsilon: float | None = None
    relative: float | None = None

    def __post_init__(self) -> None:
        if (self.epsilon is None) == (self.relative is None):
            raise InputError("Penalty takes either epsilon, Penalty(40.0), or relative, Penalty(relative=1e3)")
        name = "relative" if self.epsilon is None else "epsilon"
        checks.settle(self, **{name: checks.positive("Penalty", getattr(self, name))})

    def __str__(self) -> str:
        if self.relative is None:
            return f"weak, ε = {self.epsilon:g}"
        return f"weak, ε = {self.relative:g} K/h and D₊/h"

    def factors(self, material: Material, h: Field) -> tuple[Field, Field]:
        """ε for p [mm³/(N s)] and for c [mm/s] on a boundary whose cells have the size h [mm]."""
        if self.relative is None:
            return self.epsilon, self.epsilon
        return _per_cell(material, h, self.relative)


@dataclass(frozen=True)
class Nitsche:
    """Equilibrium imposed weakly and consistently: the boundary fluxes W·N stay in the balances, beside a penalty

        fluid efflux W·N + γ K/h (p − p_D),   cation efflux W₊·N + γ D₊/h (c − c_D),

    and the same fluxes of the test functions act on the excess: with `adjoint` "symmetric" as in Nitsche's method for
    symmetric problems, with "skew" so that they cancel in the balance of energy (then γ = 0 is possible), with "none" not
    at all. J. Nitsche, Abh. Math. Sem. Univ. Hamburg 36 (1971) 9; E. Burman, SIAM J. Numer. Anal. 50 (2012) 1959.
    """

    gamma: float = 20.0
    adjoint: str = "symmetric"

    def __post_init__(self) -> None:
        checks.one_of("Nitsche: adjoint", self.adjoint, ("symmetric", "skew", "none"))
        least = "at least 0" if self.adjoint == "skew" else "positive"
        inside = checks.is_number(self.gamma) and 0 <= (gamma := checks.as_float(self.gamma)) < float("inf")
        if not inside or (gamma == 0 and self.adjoint != "skew"):
            raise InputError(
                f"Nitsche with adjoint {self.adjoint!r}: gamma has to be {least} and finite, got {checks.shown(self.gamma)}"
            )
        checks.settle(self, gamma=gamma)

    def __str__(self) -> str:
        return f"Nitsche, {self.adjoint} adjoint, γ = {self.gamma:g}"

    def factors(self, material: Material, h: Field) -> tuple[Field, Field]:
        """γ K/h [mm³/(N s)] and γ D₊/h [mm/s] for cells of the size h [mm] normal to the boundary."""
        return _per_cell(material, h, self.gamma)


@dataclass(frozen=True)
class Multiplier:
    """Equilibrium imposed by Lagrange multipliers on the bath's boundary, which are the effluxes:

        ∫ (p − p_D) δ da = 0,  ∫ (c − c_D) δ da = 0   for every trace δ,   effluxes K/h times the one, D₊/h times the other.

    Measured in K/h and D₊/h the multipliers have the dimensions of p and c.
    """

    def __str__(self) -> str:
        return "Lagrange multipliers"

    def factors(self, material: Material, h: Field) -> tuple[Field, Field]:
        """K/h [mm³/(N s)] and D₊/h [mm/s]."""
        return _per_cell(material, h)


@dataclass(frozen=True)
class Lagged:
    """Prescribed values with the charge of the last accepted step: the scheme that oscillates (Fig. 8, upper).

    Without a `rule` the charge at the boundary itself; else sampled: `Lagged(InnerLayer())`, `Lagged(Averaged())`,
    `Lagged(LeastSquares())` are the remedies that the paper lists. `growth_factor` says whether a scene
    is stable with them.
    """

    rule: SamplingRule | None = None

    charge_of: ClassVar[str] = "last"

    def __post_init__(self) -> None:
        if self.rule is not None and not checks.is_a(self.rule, SamplingRule):
            raise InputError(
                f"Lagged: rule {checks.shown(self.rule)} is none of InnerLayer(), Averaged(), LeastSquares(...)"
            )

    def __str__(self) -> str:
        return "prescribed with the charge of the last step" + (f", {self.rule}" if self.rule is not None else "")


@dataclass(frozen=True)
class Frozen:
    """Prescribed values with the boundary charge of the start, whatever the deformation (Fig. 4, cfc = cfc0)."""

    charge_of = "start"

    def __str__(self) -> str:
        return "prescribed with the charge of the start"


@dataclass(frozen=True)
class Essential:
    """Prescribed values, for models whose unknowns in equilibrium with a bath do not depend on the charge: exact."""

    charge_of = None

    def __str__(self) -> str:
        return "prescribed"


Weak: TypeAlias = Penalty | Nitsche | Multiplier
Treatment: TypeAlias = Weak | Lagged | Frozen | Essential


def checked_salt(what: str, concentration: object) -> float:
    """A salt concentration of a bath [mol/l] as a float, within the possible."""
    hint = "for pure water use a small one, such as 1e-6; 1 mol/l = 1000 mol/m³"
    return checks.number(what, concentration, "mol/l", *SALT, hint=hint)


SALT = (1e-12, 10.0)
"""Salt concentrations that a bath may have [mol/l]. Water itself has 1e-7 of ions."""


@dataclass(frozen=True)
class Bath:
    """A salt bath on a boundary ("top" or "top|left").

    `c` is the salt concentration c̄ [mol/l] (none for models without ions), `P` the hydraulic pressure P̄ [N/mm²]; each a
    number or a schedule. Without a `treatment` the model's default applies. Raises InputError for a concentration that is
    below 1e-12 or beyond 10 mol/l.
    """

    boundary: str
    c: float | Schedule | None = None
    P: float | Schedule = 0.0
    treatment: Treatment | None = None

    def __post_init__(self) -> None:
        checks.name("a bath's boundary", self.boundary, "top|left")
        for value in () if self.concentration is None else self.concentration.values:
            checked_salt(f"bath on {self.boundary!r}: concentration", value)
        for value in self.pressure.values:
            if not abs(value) <= 1e3:
                raise InputError(f"bath on {self.boundary!r}: P = {value!r} N/mm² is beyond ±1e3; 1 N/mm² = 1e6 Pa")
        if self.treatment is not None and not isinstance(self.treatment, Treatment):
            raise InputError(
                f"bath on {self.boundary!r}: treatment {checks.shown(self.treatment)} is none of "
                "Penalty(...), Nitsche(), Multiplier(), Lagged(), Frozen(), Essential()"
            )

    @property
    def concentration(self) -> Schedule | None:
        return None if self.c is None else schedule(f"bath on {self.boundary!r}: concentration [mol/l]", self.c)

    @property
    def pressure(self) -> Schedule:
        return schedule(f"bath on {self.boundary!r}: P [N/mm²]", self.P)

    @property
    def schedules(self) -> list[Schedule]:
        """Its histories."""
        return [self.pressure] if self.concentration is None else [self.concentration, self.pressure]
