"""Equilibrium with a bath imposed weakly and consistently: Nitsche's method."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Any

from ngsolve import CoefficientFunction, InnerProduct

from ngswell import checks
from ngswell.baths.treatment import Contact, Weak, normal_size
from ngswell.errors import InputError
from ngswell.models.model import Model
from ngswell.models.term import Role, Term
from ngswell.physics import laws

LEAST = {"symmetric": 20.0, "skew": 0.0, "none": 5.0}
"""Smallest γ by adjoint. Homogeneous bodies need γ of 1 to 3; the rest is for fluxes that vary in a cell, and for what
cations and fluid drive of each other."""


@dataclass(frozen=True)
class Nitsche(Weak):
    """Equilibrium imposed weakly and consistently: the boundary fluxes W·N stay in the balances, beside a penalty

        fluid efflux W·N + γ (k − 1)² L/h (p − p_D),   cation efflux W₊·N + γ (k − 1)² L₊/h (c − c_D),

    and the same fluxes of the test functions act on the excess: with `adjoint` "symmetric" as in Nitsche's method for
    symmetric problems, with "skew" so that they cancel in the balance of energy (then γ = 0 is possible), with "none" not
    at all. k is the order of u, h the size of the deformed cell at the point normal to the boundary, and L and L₊ are the
    conductances of the body there (`own_conductances`): those of the material's laws in the state that is sought. Raises
    InputError for γ below 20 (symmetric) or 5 (none), with which the form need not have a unique solution.
    J. Nitsche, Abh. Math. Sem. Univ. Hamburg 36 (1971) 9; E. Burman, SIAM J. Numer. Anal. 50 (2012) 1959.
    """

    gamma: float = 50.0
    adjoint: str = "symmetric"

    def __post_init__(self) -> None:
        checks.choice("Nitsche: adjoint", self.adjoint, LEAST)
        gamma, least = self.gamma, LEAST[self.adjoint]
        if not (checks.is_number(gamma) and least <= checks.as_float(gamma) < inf):
            raise InputError(
                f"Nitsche with adjoint {self.adjoint!r}: gamma has to be at least {least:g} and finite, got "
                f"{checks.short(gamma)}: less leaves the form without a unique solution"
            )
        checks.set_fields(self, gamma=checks.as_float(gamma))

    def __str__(self) -> str:
        return f"Nitsche, {self.adjoint} adjoint, γ = {self.gamma:g}"

    def suits(self, model: Model) -> bool:
        return model.charge_field is not None

    def terms(self, contact: Contact) -> list[Term]:
        """With the outer normal N and the fluxes W(Grad p, Grad c), linear in the gradients:

            efflux  W·N + γ (k − 1)²/h |Cof(F) N|²/J (L excess_p, L₊ excess_c),
            adjoint, symmetric  + ∫ W(excess_p N, excess_c N) · Grad test,
            adjoint, skew       − ∫ [excess_p W_fluid(Grad test) + excess_c W_cations(Grad test)] · N.

        In the skew form flux and adjoint cancel for a test equal to the excess, so it needs no penalty.
        """
        state, normal = contact.state, contact.state.kinematics.normal
        size = normal_size(state.kinematics)
        factor = self.gamma * (contact.order - 1) ** 2 / size * InnerProduct(state.pull * normal, normal)
        own = dict(zip(contact.excess, laws.own_conductances(state.material, state.J, state.c, state.cfc), strict=True))
        fluxes = state.transport(state.pull)._asdict()
        driven = _driven(state, contact.excess["fluid"] * normal, contact.excess["cations"] * normal)
        terms = []
        for balance in contact.tests:
            efflux = InnerProduct(fluxes[balance], normal) + factor * own[balance] * contact.excess[balance]
            terms.append(contact.in_cells(balance, "efflux", efflux * contact.exchange(balance), Role.EFFLUX))
            if self.adjoint != "none":
                terms.append(contact.in_cells(balance, "adjoint", self._adjoint(contact, balance, driven), Role.ADJOINT))
        return terms

    def _adjoint(self, contact: Contact, balance: str, driven: dict[str, CoefficientFunction]) -> CoefficientFunction:
        state, normal = contact.state, contact.state.kinematics.normal
        gradient = state.kinematics.flow_gradient(contact.tests[balance])
        if self.adjoint == "symmetric":
            return InnerProduct(driven[balance], gradient)
        none = 0.0 * normal
        by_test = _driven(state, gradient, none) if balance == "fluid" else _driven(state, none, gradient)
        return -sum(value * InnerProduct(by_test[name], normal) for name, value in contact.excess.items())


def _driven(state: Any, of_p: CoefficientFunction, of_c: CoefficientFunction) -> dict[str, CoefficientFunction]:
    """Fluxes that reference gradients of p and of c drive, by balance."""
    return state.driven(state.pull, of_p, of_c, 0.0 * of_p)._asdict()
