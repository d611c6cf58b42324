"""Equilibrium with a bath imposed by Lagrange multipliers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from ngswell.baths.treatment import Contact, Prescribed, Surroundings, Weak
from ngswell.errors import InputError
from ngswell.mesh.points import vertices_of
from ngswell.models.model import Model
from ngswell.models.term import Role, Term

CONDITION = "equilibrium with the bath"
"""What multipliers are tested with, beside the balances."""


@dataclass(frozen=True)
class Multiplier(Weak):
    """Equilibrium imposed by Lagrange multipliers on the bath's boundary, which are the effluxes:

        ∫ (p − p_D) δ da = 0,  ∫ (c − c_D) δ da = 0   for every trace δ,   effluxes K/h times the one, D₊/h times the other.

    Measured in K/h and D₊/h, the largest of the body before any law, the multipliers have the dimensions of p and c.
    """

    multipliers: ClassVar[bool] = True

    def __str__(self) -> str:
        return "Lagrange multipliers"

    def suits(self, model: Model) -> bool:
        return model.charge_field is not None

    def check_in(self, surroundings: Surroundings, boundary: str) -> None:
        """Refuse a bath that prescribes values in vertices where multipliers impose theirs: the system would be singular."""
        mesh = surroundings.mesh
        for other in surroundings.baths:
            theirs = surroundings.treatment(other)
            touching = vertices_of(mesh, boundary) & vertices_of(mesh, other.boundary)
            if isinstance(theirs, Prescribed) and touching:
                raise InputError(
                    f"baths on {boundary!r} and {other.boundary!r} touch: {self!r} would impose "
                    f"there what {theirs!r} prescribes; beside it take Penalty, Nitsche or Multiplier"
                )

    def terms(self, contact: Contact) -> list[Term]:
        terms = []
        for balance, value in contact.excess.items():
            unknown, test = contact.multipliers[balance]
            condition = contact.conductances[balance] * value * test * contact.stretch
            terms += [
                contact.efflux(balance, contact.conductances[balance] * unknown),
                Term(CONDITION, balance, condition, role=Role.CONDITION, boundary=contact.boundary),
            ]
        return terms
