"""Terms as integrals for NGSolve's forms."""

from __future__ import annotations

from typing import Any

from ngsolve import BilinearForm, Variation, ds, dx

from ngswell.models.term import Kind, Role, Term
from ngswell.problem.discretisation import BONUS_ORDER, Discretisation
from ngswell.problem.lumping import VERTEX_RULES


def integral(discretisation: Discretisation, term: Term, factor: Any = None) -> Any:
    """A term over its part of the body or of its boundary, for a BilinearForm."""
    weight = discretisation.kinematics.weight
    integrand = ((weight if factor is None else factor * weight) * term.integrand).Compile()
    if term.boundary is not None:
        region = discretisation.mesh.Boundaries(term.boundary)
        # At the ends of a 1-d mesh NGSolve's normal points outwards as seen from the cell only.
        in_cells = term.normal_derivatives or (discretisation.mesh.dim == 1 and term.role is Role.LOAD)
        return integrand * ds(definedon=region, bonus_intorder=BONUS_ORDER, skeleton=in_cells)
    over_body = integrand * dx(bonus_intorder=BONUS_ORDER)
    return Variation(over_body) if term.kind is Kind.ENERGY else over_body


def content_integrals(discretisation: Discretisation, term: Term, factor: Any = None) -> list[Any]:
    """A content that lumps over the cells where contents are integrals, and over those where they are lumped at the corners.

    At a corner no other function than that of its vertex is there.
    """
    storage = discretisation.storage
    of_cell = discretisation.kinematics.weight * term.integrand
    of_corner = storage.vertex_weights * term.integrand
    if factor is not None:
        of_cell, of_corner = factor * of_cell, factor * of_corner
    return [
        of_cell.Compile() * dx(bonus_intorder=BONUS_ORDER, definedonelements=storage.integrated),
        of_corner.Compile() * dx(intrules=VERTEX_RULES, definedonelements=storage.lumped),
    ]


def form(discretisation: Discretisation, terms: list[Term], rates: Any = None, condense: bool = False) -> BilinearForm:
    """The sum of terms; those of kind RATE with the factor `rates`, such as 1/Δt."""
    result = BilinearForm(discretisation.space, condense=condense)
    for term in terms:
        if term.lumps:
            for part in content_integrals(discretisation, term, rates):
                result += part
        else:
            result += integral(discretisation, term, rates if term.kind is Kind.RATE else None)
    return result
