"""What has to stay positive, and where it is watched."""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from ngsolve import CF, CoefficientFunction, GridFunction, x, y, z
from numpy.typing import NDArray

from ngswell.errors import Reason
from ngswell.mesh.points import corners
from ngswell.problem.discretisation import Discretisation


class Violation(NamedTuple):
    """What is not positive, by name, where [mm], and the reason why an iterate may not have it."""

    what: str
    where: tuple[float, ...]
    reason: Reason


CONTENT = "fluid content J − nS0"
"""What is not positive where a body is squeezed dry."""

TURNED = "J at a cell's corner"
"""What is not positive where a cell turns over."""

SQUEEZED = 0.25
"""Share of fluid below which a cell counts as squeezed."""


class Admissible:
    """Bounds of a state: those of every iterate, and those of a solution only.

    They are looked at many times an iteration where matrices are kept: all at once, in one pass over the points.
    """

    def __init__(self, discretisation: Discretisation, state: Any, fields: GridFunction) -> None:
        self._discretisation, self._state, self._fields = discretisation, state, fields
        self._team = discretisation.team

    @cached_property
    def always(self) -> dict[str, CoefficientFunction]:
        """At points as near to the sides of cells as those where laws are evaluated."""
        return {CONTENT: self._state.content} | self.of_ions | self._numbers

    @cached_property
    def _numbers(self) -> dict[str, CoefficientFunction]:
        """Those that pieces of the setup bring."""
        numbers, names = self._discretisation.numbers, self._discretisation.names
        return {name: self._fields.components[names.index(name)] for name, n in numbers.items() if n.positive}

    def least_content(self) -> float:
        """The smallest J − nS0 at the watched points [-]."""
        return self._team.least(self._values(solution=False)[:, 0].min())[0]

    @cached_property
    def of_ions(self) -> dict[str, CoefficientFunction]:
        """The model's own among these."""
        return self._discretisation.model.bounds(self._state)

    @cached_property
    def in_solutions(self) -> dict[str, CoefficientFunction]:
        """None where a bath takes the charge of the last step: it may oscillate and drive anions below zero, and whoever
        chooses it wants to see that."""
        problem = self._discretisation
        if problem.setup.looks_back:
            return {}
        return problem.model.solution_bounds(self._state)

    @cached_property
    def _in_one(self) -> dict[bool, CoefficientFunction]:
        """The bounds of iterates, and of solutions, as one vector each."""
        each = {False: self.always, True: self.in_solutions}
        return {solution: CF(tuple(bounds.values())).Compile() for solution, bounds in each.items() if bounds}

    @cached_property
    def _wet(self) -> float:
        """A J − nS0 above which no watched point is squeezed [-]: it is nS0 nF / (1 − nF)."""
        solid = CF(self._discretisation.setup.material.nS0)(self._discretisation.points).max()
        return float(solid) * SQUEEZED / (1 - SQUEEZED)

    def _values(self, solution: bool) -> NDArray:
        points = self._points
        return self._in_one[solution](points).reshape(points.size, -1)

    @cached_property
    def _points(self) -> NDArray:
        """The watched points of this rank."""
        return self._discretisation.share.of_points(self._discretisation.points)

    def violation(self, solution: bool = False) -> Violation | None:
        """What leaves the physical range of iterates (or of a `solution`) at a watched point; None if nothing does."""
        bounds = self.in_solutions if solution else self.always
        if not bounds:
            return None
        values = self._values(solution)
        least, most, content = self._team.least(values.min(), -values.max(), values[:, 0].min())
        if not (least > 0 and most > -np.inf):
            for name, column in zip(bounds, values.T, strict=True):
                finite = np.where(np.isfinite(column), column, -np.inf)
                worst = int(np.argmin(finite))
                found = self._team.each((float(finite[worst]), self._place(self._points[worst : worst + 1])))
                value, where = min(found, key=lambda one: one[0])
                if not value > 0:
                    reason = Reason.IONS_RUN_OUT if name in self.of_ions else Reason.NOT_ADMISSIBLE
                    return Violation(name, where, reason)
        return None if solution or content > self._wet else self.turned()

    def turned(self, fluid: float = SQUEEZED) -> Violation | None:
        """A cell that has turned over at a corner, and is squeezed: at a point of its own, at most this share is fluid.

        Where a bonded edge meets a wet side the strain is singular, and J at the corner overshoots, below nS0 and even below
        zero, while no law sees it and the solution converges.
        """
        at_corners = self._state.J(self._corners).ravel()
        if at_corners.min() > 0:
            return None
        points = self._discretisation.points
        least = np.ones(self._discretisation.mesh.ne)
        np.minimum.at(least, points["nr"], self._state.nF(points).ravel())
        at_corners[least[self._corners["nr"]] > fluid] = np.inf
        worst = int(np.argmin(at_corners))
        if at_corners[worst] > 0:
            return None
        return Violation(TURNED, self._place(self._corners[worst : worst + 1]), Reason.TURNS_OVER)

    @cached_property
    def _corners(self) -> NDArray:
        return corners(self._discretisation.mesh)

    def _place(self, where: NDArray) -> tuple[float, ...]:
        return tuple(map(float, CF((x, y, z)[: self._discretisation.mesh.dim])(where).ravel()))
