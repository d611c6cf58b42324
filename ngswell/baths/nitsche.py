"""Equilibrium with a bath imposed weakly and consistently: Nitsche's method."""

from __future__ import annotations

from dataclasses import dataclass

from ngsolve import CoefficientFunction, InnerProduct, Norm

from ngswell import checks
from ngswell.baths.treatment import Contact, Weak, normal_size, per_cell
from ngswell.checks import Field
from ngswell.errors import InputError
from ngswell.models.model import Model
from ngswell.models.term import Role, Term
from ngswell.physics import laws
from ngswell.physics.material import Material


@dataclass(frozen=True)
class Nitsche(Weak):
    """Equilibrium imposed weakly and consistently: the boundary fluxes W·N stay in the balances, beside a penalty

        fluid efflux W·N + γ K/h (p − p_D),   cation efflux W₊·N + γ D₊/h (c − c_D),

    and the same fluxes of the test functions act on the excess: with `adjoint` "symmetric" as in Nitsche's method for
    symmetric problems, with "skew" so that they cancel in the balance of energy (then γ = 0 is possible), with "none" not
    at all. J. Nitsche, Abh. Math. Sem. Univ. Hamburg 36 (1971) 9; E. Burman, SIAM J. Numer. Anal. 50 (2012) 1959.
    """

    gamma: float = 20.0
    adjoint: str = "symmetric"

    def __post_init__(self) -> None:
        checks.choice("Nitsche: adjoint", self.adjoint, ("symmetric", "skew", "none"))
        least = "at least 0" if self.adjoint == "skew" else "positive"
        inside = checks.is_number(self.gamma) and 0 <= (gamma := checks.as_float(self.gamma)) < float("inf")
        if not inside or (gamma == 0 and self.adjoint != "skew"):
            raise InputError(
                f"Nitsche with adjoint {self.adjoint!r}: gamma has to be {least} and finite, got {checks.short(self.gamma)}"
            )
        checks.set_fields(self, gamma=gamma)

    def __str__(self) -> str:
        return f"Nitsche, {self.adjoint} adjoint, γ = {self.gamma:g}"

    def factors(self, material: Material, h: Field) -> tuple[Field, Field]:
        """γ K/h [mm³/(N s)] and γ D₊/h [mm/s] for cells of the size h [mm] normal to the boundary."""
        return per_cell(material, h, self.gamma)

    def suits(self, model: Model) -> bool:
        return model.charge_field is not None

    def terms(self, contact: Contact) -> list[Term]:
        """With the outer normal N and the fluxes W(Grad p, Grad c), linear in the gradients:

            efflux  W·N + γ (K/h, D₊/h) excess,
            adjoint, symmetric  + ∫ W(excess_p N, excess_c N) · Grad test,
            adjoint, skew       − ∫ [excess_p W_fluid(Grad test) + excess_c W_cations(Grad test)] · N.

        In the skew form flux and adjoint cancel for a test equal to the excess, so it needs no penalty.
        """
        state, boundary = contact.state, contact.boundary
        stretch = Norm(state.cofactor * state.kinematics.normal)
        factors = dict(zip(contact.excess, self.factors(state.material, normal_size(state.kinematics)), strict=True))
        fluxes = state.transport(state.pull)._asdict()
        terms = []
        for balance, value in contact.excess.items():
            efflux = InnerProduct(fluxes[balance], state.kinematics.normal) + factors[balance] * value * stretch
            integrand = efflux * contact.tests[balance]
            terms.append(Term(balance, "efflux", integrand, role=Role.EFFLUX, boundary=boundary, normal_derivatives=True))
            if self.adjoint != "none":
                adjoint = self._adjoint(contact, balance)
                terms.append(
                    Term(balance, "adjoint", adjoint, role=Role.ADJOINT, boundary=boundary, normal_derivatives=True)
                )
        return terms

    def _adjoint(self, contact: Contact, balance: str) -> CoefficientFunction:
        state, excess = contact.state, contact.excess
        normal, none = state.kinematics.normal, 0.0 * state.kinematics.normal
        gradient = state.kinematics.flow_gradient(contact.tests[balance])

        def response(of_p: CoefficientFunction, of_c: CoefficientFunction) -> dict[str, CoefficientFunction]:
            """Fluxes that a gradient of p and one of c would drive."""
            pull = state.pull
            return laws.transport(state.material, state.J, state.c, state.cfc, pull * of_p, pull * of_c, none)._asdict()

        if self.adjoint == "symmetric":
            return InnerProduct(response(excess["fluid"] * normal, excess["cations"] * normal)[balance], gradient)
        driven = response(gradient, none) if balance == "fluid" else response(none, gradient)
        return -sum(value * InnerProduct(driven[name], normal) for name, value in excess.items())
