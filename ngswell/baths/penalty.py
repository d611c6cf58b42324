"""Equilibrium with a bath imposed weakly by a penalty: the paper's way."""

from __future__ import annotations

from dataclasses import dataclass

from ngswell import checks
from ngswell.baths.treatment import Contact, Weak
from ngswell.checks import Field
from ngswell.errors import InputError
from ngswell.models.term import Term
from ngswell.physics import laws


@dataclass(frozen=True)
class Penalty(Weak):
    """Equilibrium imposed weakly, the third terms of (27) and (32), with the sign that makes them coercive:

        fluid efflux q̄ = ε (p − p_D),   cation efflux j̄ = ε (c − c_D)    per current area.

    Give either the paper's raw ε (`Penalty(40.0)`: mm³/(N s) for p and mm/s for c, one number for both dimensions) or
    `Penalty(relative=1e3)`: that multiple of K/h for p and of D₊/h for c, h being the size of the cells at the boundary. K
    and D₊ are those of the material's laws in the state that is sought.
    """

    epsilon: float | None = None
    relative: float | None = None

    def __post_init__(self) -> None:
        if (self.epsilon is None) == (self.relative is None):
            raise InputError("Penalty takes either epsilon, Penalty(40.0), or relative, Penalty(relative=1e3)")
        name = "relative" if self.epsilon is None else "epsilon"
        checks.set_fields(self, **{name: checks.positive("Penalty", getattr(self, name))})

    def __str__(self) -> str:
        if self.relative is None:
            return f"weak, ε = {self.epsilon:g}"
        return f"weak, ε = {self.relative:g} K/h and D₊/h"

    def factors(self, contact: Contact) -> tuple[Field, Field]:
        """ε for p [mm³/(N s)] and for c [mm/s]: numbers, or fields where K or D₊ are; 0 for a c that is none."""
        if self.relative is None:
            return self.epsilon, self.epsilon
        state, per_size = contact.state, self.relative / contact.h
        D_plus = laws.diffusivities(state.nF, state.material)[0] if "cations" in contact.excess else 0.0
        return per_size * state.permeability, per_size * D_plus

    def terms(self, contact: Contact) -> list[Term]:
        factors = self.factors(contact)
        return contact.effluxes(*factors, in_cells=not all(map(checks.is_number, factors)))
