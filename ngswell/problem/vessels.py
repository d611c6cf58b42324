"""What a body and the bath in a vessel hold together."""

from __future__ import annotations

from ngswell.models.term import Role
from ngswell.problem.problem import Problem


def together(problem: Problem) -> dict[str, float]:
    """Fluid and cations of body and bath at the present fields, by name of each vessel's numbers."""
    vector = problem.fields.vec.CreateVector()
    problem.contents(vector)
    contents, found = vector.FV().NumPy(), {}
    for bath in problem.setup.baths:
        for balance, number in bath.numbers(problem.concentration).items():
            start = problem.ranges[problem.model.balanced[balance]].start
            in_gel = contents[start : start + problem.mesh.nv].sum()
            found[number.name] = float(in_gel + contents[problem.ranges[number.name]].sum())
    return found


def among_themselves(problem: Problem) -> bool:
    """Whether body and bath exchange with each other alone: there is no other bath, and no load drives flow."""
    baths = {bath.boundary for bath in problem.setup.baths}
    driven = any(term.role is Role.EFFLUX and term.boundary not in baths for term in problem.terms)
    return len(baths) == 1 and not driven
