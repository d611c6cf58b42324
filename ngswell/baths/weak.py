"""Equilibrium with a bath imposed weakly, as terms of the balances.

A weak treatment adds an efflux to the balances of fluid and cations and lets the excess of the unknowns over their
equilibrium decide it. Excess: p − p_D and c − c_D in the concentration model, P − P̄ and c̃ − c̄ in that of the potentials.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ngsolve import CoefficientFunction, InnerProduct, Norm, specialcf

from ngswell.baths.bath import BathFields, Multiplier, Nitsche, Penalty
from ngswell.models.model import Model, Term
from ngswell.physics import laws
from ngswell.physics.kinematics import Kinematics

CONDITION = "equilibrium with the bath"
"""What multipliers are tested with, beside the balances."""


def weak_terms(
    treatment: Penalty | Nitsche | Multiplier,
    model: Model,
    state: Any,
    tests: Sequence[CoefficientFunction],
    bath: BathFields,
    boundary: str,
    h: float,
    multipliers: Sequence[tuple[CoefficientFunction, CoefficientFunction]],
) -> list[Term]:
    """Terms of one bath whose boundary cells have the mean size `h` [mm]; Nitsche's method takes that of each cell.

    `multipliers` are trial and test functions, one pair a balance; only `Multiplier` uses them.
    """
    excess = model.excess(state, bath)
    tested = {balance: tests[model.unknowns.index(model.held[balance])] for balance in excess}
    size = normal_size(state.kinematics) if isinstance(treatment, Nitsche) else h
    factors = dict(zip(("fluid", "cations"), treatment.factors(state.material, size), strict=True))
    if isinstance(treatment, Nitsche):
        return _nitsche(treatment, state, excess, tested, factors, boundary)
    stretch = state.kinematics.area_stretch(state.u)
    if isinstance(treatment, Penalty):
        return [
            Term(balance, "efflux", factors[balance] * value * tested[balance] * stretch, boundary=boundary)
            for balance, value in excess.items()
        ]
    terms = []
    for (balance, value), (unknown, test) in zip(excess.items(), multipliers, strict=True):
        efflux = factors[balance] * unknown * tested[balance] * stretch
        terms.append(Term(balance, "efflux", efflux, boundary=boundary))
        terms.append(Term(CONDITION, balance, factors[balance] * value * test * stretch, boundary=boundary))
    return terms


def normal_size(kinematics: Kinematics) -> CoefficientFunction:
    """Size normal to the boundary of the cell at a point, |Aᵀ N| for the map x = A ξ from the reference cell [mm].

    For integrals with normal derivatives. With the mean size, the penalty would be too weak for cells far below it.
    """
    dimension = kinematics.dimension
    return Norm(specialcf.JacobianMatrix(dimension).trans * specialcf.normal(dimension))


def _nitsche(
    treatment: Nitsche,
    state: Any,
    excess: dict[str, CoefficientFunction],
    tested: dict[str, CoefficientFunction],
    factors: dict[str, Any],
    boundary: str,
) -> list[Term]:
    """Nitsche's method for the fluxes W(Grad p, Grad c), linear in the gradients, with the outer normal N:

        efflux  W·N + γ (K/h, D₊/h) excess,
        adjoint, symmetric  + ∫ W(excess_p N, excess_c N) · Grad test,
        adjoint, skew       − ∫ [excess_p W_fluid(Grad test) + excess_c W_cations(Grad test)] · N.

    In the skew form flux and adjoint cancel for a test equal to the excess, so it needs no penalty.
    """
    kinematics = state.kinematics
    normal, gradient, pull = kinematics.normal, kinematics.flow_gradient, state.pull
    stretch = Norm(state.cofactor * normal)
    flux = state.transport(pull)
    fluxes = {"fluid": flux.fluid, "cations": flux.cations}

    def response(of_p: CoefficientFunction, of_c: CoefficientFunction) -> dict[str, CoefficientFunction]:
        """Fluxes that a gradient of p and one of c would drive."""
        none = 0.0 * normal
        law = laws.transport(state.material, state.nF, state.c, state.cfc, pull * of_p, pull * of_c, none)
        return {"fluid": law.fluid, "cations": law.cations}

    terms = []
    for balance, value in excess.items():
        test = tested[balance]
        efflux = InnerProduct(fluxes[balance], normal) + factors[balance] * value * stretch
        terms.append(Term(balance, "efflux", efflux * test, boundary=boundary, normal_derivatives=True))
        if treatment.adjoint == "none":
            continue
        if treatment.adjoint == "symmetric":
            driven = response(excess["fluid"] * normal, excess["cations"] * normal)[balance]
            adjoint = InnerProduct(driven, gradient(test))
        else:
            none = 0.0 * normal
            driven = response(gradient(test), none) if balance == "fluid" else response(none, gradient(test))
            adjoint = -sum(value * InnerProduct(driven[name], normal) for name, value in excess.items())
        terms.append(Term(balance, "adjoint", adjoint, boundary=boundary, normal_derivatives=True))
    return terms
