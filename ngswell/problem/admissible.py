"""What has to stay positive, and where it is watched."""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from ngsolve import CF, CoefficientFunction, x, y, z
from numpy.typing import NDArray

from ngswell.baths.treatment import Charge
from ngswell.errors import Reason
from ngswell.mesh.points import corners
from ngswell.problem.discretisation import Discretisation


class Violation(NamedTuple):
    """What is not positive, by name, where [mm], and the reason why an iterate may not have it."""

    what: str
    where: tuple[float, ...]
    reason: Reason


class Bound(NamedTuple):
    """A field that has to be positive at points."""

    field: CoefficientFunction
    where: NDArray
    reason: Reason = Reason.NOT_ADMISSIBLE


class Admissible:
    """Bounds of a state: those of every iterate, and those of a solution only."""

    def __init__(self, discretisation: Discretisation, state: Any) -> None:
        self._discretisation, self._state = discretisation, state

    @cached_property
    def always(self) -> dict[str, Bound]:
        """At the forms' own points, where laws are evaluated; J at the cells' corners too, where cells turn over first.

        J − nS0 is not asked for at corners: no law sees it there, and where a bonded edge meets a wet side it falls below
        zero at the singular corner of a fine mesh while the solution at the points converges.
        """
        problem = self._discretisation
        content = self._at_own_points({"fluid content J − nS0": self._state.content})
        turned = {"J at a cell's corner": Bound(self._state.J.Compile(), corners(problem.mesh), Reason.TURNS_OVER)}
        return content | turned | self._at_own_points(problem.model.bounds(self._state))

    @cached_property
    def in_solutions(self) -> dict[str, Bound]:
        """None where a bath takes the charge of the last step: it may oscillate and drive anions below zero, and whoever
        chooses it wants to see that."""
        problem = self._discretisation
        if any(treatment.charge_of is Charge.LAST_STEP for _, treatment in problem.setup.prescribed_baths):
            return {}
        return self._at_own_points(problem.model.solution_bounds(self._state))

    def _at_own_points(self, bounds: dict[str, Any]) -> dict[str, Bound]:
        return {name: Bound(field.Compile(), self._discretisation.points) for name, field in bounds.items()}

    def violation(self, solution: bool = False) -> Violation | None:
        """What leaves the physical range of iterates (or of a `solution`) at a watched point; None if nothing does."""
        for name, (field, where, reason) in (self.in_solutions if solution else self.always).items():
            values = field(where).ravel()
            worst = int(np.argmin(np.where(np.isfinite(values), values, -np.inf)))
            if not values[worst] > 0:
                place = CF((x, y, z)[: self._discretisation.mesh.dim])(where[worst : worst + 1]).ravel()
                return Violation(name, tuple(map(float, place)), reason)
        return None
