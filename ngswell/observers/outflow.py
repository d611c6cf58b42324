"""The flow through a bath, from the balances of its nodes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from ngsolve import BilinearForm, GridFunction, Mesh, ds
from numpy.typing import NDArray

from ngswell import checks
from ngswell.errors import InputError
from ngswell.mesh.points import vertices_of
from ngswell.observers.effluxes import Effluxes
from ngswell.observers.records import Recorder, power_of_mm, product
from ngswell.problem.problem import Problem
from ngswell.problem.quadrature import BONUS_ORDER
from ngswell.stepping.steps import Step
from ngswell.streams import CSV

ON_BOUNDARY = 1e-9
"""Share of a cell by which a point may miss the boundary."""


class Outflow(Recorder):
    """Fluid and cations that leave through one bath in unit time, and at `points` [mm] on it per current area.

        outflow = Outflow("top", (0.5, 1.0))

    Not taken from derivatives: it is what the balances of the nodes on the bath lack, as in `Ledger`, whose amounts are its
    integral over time. The flux q at a point is the trace (order of p or P) with

        ∫ q δ da = what the balance tested with δ lacks, for all traces δ;

    with δ = 1 its integral over the boundary is the whole outflow. Where two baths meet, the shared node counts
    with the first, and in the cells beside it q is rough.

    One entry a time: `fluid` [mm²/s, in 1-d mm/s, in 3-d mm³/s], `fluid_at` (rows of time, columns of points) [mm/s] and,
    where the model has them, `cations`, `cations_at` [mol/l times that]. Not a number at the start, before anything flowed.
    With `to`, a path or a `CSV`, records go to that file. Raises InputError for a boundary that is no bath's and for points
    off it.
    """

    def __init__(
        self,
        boundary: str,
        *points: Sequence[float],
        when: float | Sequence[float] | None = None,
        to: str | Path | CSV | None = None,
    ) -> None:
        checks.name("Outflow: boundary", boundary, "top")
        self.boundary = boundary
        self.points = tuple(checks.vector("Outflow: a point", point, 1e6, "mm") for point in points)
        super().__init__(when, boundary, *self.points, to=to)

    def prepare(self, problem: Problem, begin: float, until: float) -> None:
        self._effluxes, self._power = Effluxes(problem), power_of_mm(problem)
        if self.boundary not in self._effluxes.vertices:
            known = ", ".join(map(repr, self._effluxes.vertices)) or "none"
            raise InputError(f"Outflow: {self.boundary!r} is no bath's boundary; those of the baths are {known}")
        self._traces = {
            name: _Trace(problem, self.boundary, unknown, self.points) for name, unknown in problem.model.balanced.items()
        }
        self._contents = self._effluxes.contents().copy()
        self._rate = np.full(problem.space.ndof, np.nan)

    def observe(self, problem: Problem, step: Step) -> None:
        contents = self._effluxes.contents().copy()
        self._rate = (self._contents - contents) / step.dt if step.slope is None else step.slope
        self._contents = contents
        super().observe(problem, step)

    def unit(self, name: str) -> str:
        balance, _, at = name.partition(" ")
        return product("mol/l" if balance == "cations" else "-", 1 if at else self._power) + "/s"

    def row(self, problem: Problem) -> Mapping[str, Any]:
        lacks = self._rate - self._effluxes.flows()
        sums = self._effluxes.sums(lacks)
        whole = {name: sums[name, self.boundary] for name in self._traces}
        return whole | {f"{name} at": trace.flux(lacks) for name, trace in self._traces.items()}

    @property
    def fluid(self) -> NDArray:
        return self._table.columns()["fluid"]

    @property
    def cations(self) -> NDArray:
        return self._table.columns()["cations"]

    @property
    def fluid_at(self) -> NDArray:
        return self._table.columns()["fluid at"]

    @property
    def cations_at(self) -> NDArray:
        return self._table.columns()["cations at"]


class _Trace:
    """The flux on one boundary as a trace of one unknown's space, at points."""

    def __init__(self, problem: Problem, boundary: str, unknown: str, points: Sequence[tuple[float, ...]]) -> None:
        mesh, number = problem.mesh, problem.names.index(unknown)
        space = problem.fields.components[number].space
        region = mesh.Boundaries(boundary)
        names = [bath.boundary for bath in problem.setup.baths]
        before = "|".join(names[: names.index(boundary)])
        self._dofs = np.flatnonzero(list(space.GetDofs(region)))
        theirs = np.array(list(space.GetDofs(mesh.Boundaries(before)))) if before else np.zeros(space.ndof, dtype=bool)
        self._others = np.flatnonzero(theirs[self._dofs])  # count with the baths before
        self._offset = problem.ranges[unknown].start
        self._field = GridFunction(space)
        self._where = [self._point(mesh, point, boundary) for point in points]
        q, test = space.TnT()
        integrand = problem.kinematics.weight * problem.state.stretch_on_boundary * q * test
        self._mass = BilinearForm(space)
        self._mass += integrand * ds(definedon=region, bonus_intorder=BONUS_ORDER)

    def _point(self, mesh: Mesh, point: tuple[float, ...], boundary: str) -> Any:
        """The point, refused off the boundary: there not all vertex functions that are not zero belong to the boundary."""
        if len(point) == mesh.dim and mesh.Contains(*point):
            self._field.vec.FV().NumPy()[sorted(vertices_of(mesh, boundary))] = 1.0
            if abs(self._field(mesh(*point)) - 1.0) < ON_BOUNDARY:
                return mesh(*point)
        raise InputError(f"Outflow: {point} is not a point of the boundary {boundary!r}")

    def flux(self, lacks: NDArray) -> list[float]:
        """At the points, per current area; what the nodes' balances lack is all of it."""
        if not self._where:
            return []
        right = lacks[self._offset + self._dofs]
        right[self._others] = 0.0
        self._mass.Assemble()
        rows, columns, values = self._mass.mat.COO()
        place = np.full(self._field.space.ndof, -1)
        place[self._dofs] = np.arange(len(self._dofs))
        rows, columns, values = (np.asarray(part) for part in (rows, columns, values))
        mine = (place[rows] >= 0) & (place[columns] >= 0)
        mass = np.zeros((len(right), len(right)))
        mass[place[rows[mine]], place[columns[mine]]] = values[mine]
        self._field.vec[:] = 0.0
        self._field.vec.FV().NumPy()[self._dofs] = np.linalg.solve(mass, right)
        return [float(self._field(where)) for where in self._where]
