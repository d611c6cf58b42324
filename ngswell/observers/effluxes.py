"""What the balances of the nodes on a bath lack: the one place that knows which nodes and flows those are."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ngswell.mesh.points import vertices_of
from ngswell.models.term import Kind, Role
from ngswell.problem.problem import Problem


class Effluxes:
    """Flows of the body to the nodes on baths, and the vertices that count with each bath.

    Contents fall by what flows off inside and by what leaves; the flows inside are those of all terms but storage and
    effluxes to baths. A vertex that two baths share counts with the first. The contents of a vessel's bath fall by what is
    let out and by what goes into the gel, which is an efflux too: `vessels` are its unknowns, by balance and boundary.
    """

    def __init__(self, problem: Problem) -> None:
        self._problem, self._vector = problem, problem.fields.vec.CreateVector()
        self.vessels = {
            (name, bath.boundary): problem.ranges[number.name].start
            for bath in problem.setup.baths
            for name, number in bath.numbers(problem.concentration).items()
        }
        balances, baths = {*problem.model.balanced, *problem.numbers}, {bath.boundary for bath in problem.setup.baths}
        flows = [term for term in problem.terms if term.balance in balances and term.kind is not Kind.RATE]
        self._flows = problem.form([term for term in flows if term.role is not Role.EFFLUX or term.boundary not in baths])
        given = [term for term in flows if term.role is Role.EFFLUX and term.boundary not in baths]
        self._given = {
            boundary: problem.form([term for term in given if term.boundary == boundary])
            for boundary in dict.fromkeys(str(term.boundary) for term in given)
        }
        self.vertices: dict[str, NDArray] = {}
        taken = np.zeros(problem.mesh.nv, dtype=bool)
        for bath in problem.setup.baths:
            mine = np.array([number for number in sorted(vertices_of(problem.mesh, bath.boundary)) if not taken[number]])
            taken[mine] = True
            self.vertices[bath.boundary] = mine
        self.nodes = {
            (name, boundary): problem.ranges[unknown].start + mine
            for boundary, mine in self.vertices.items()
            for name, unknown in problem.model.balanced.items()
        }

    def contents(self) -> NDArray:
        """Contents of all nodes at the present fields; a view that the next call changes."""
        self._problem.contents(self._vector)
        return self._vector.FV().NumPy()

    def flows(self) -> NDArray:
        """What flows off inside the body in unit time, at the present fields; a view that the next call changes."""
        self._flows.apply(self._vector)
        return self._vector.FV().NumPy()

    def given(self) -> dict[tuple[str, str], float]:
        """What loads take out through their boundaries in unit time, by balance and boundary."""
        found, vector = {}, self._problem.fields.vec.CreateVector()
        for boundary, flux in self._given.items():
            flux.apply(vector)
            for name, unknown in self._problem.model.balanced.items():
                start = self._problem.ranges[unknown].start
                found[name, boundary] = float(vector.FV().NumPy()[start : start + self._problem.mesh.nv].sum())
        return found

    def sums(self, values: NDArray) -> dict[tuple[str, str], float]:
        """Sums over the vertices of each bath, by balance and boundary."""
        return {key: float(values[dofs].sum()) for key, dofs in self.nodes.items()}
