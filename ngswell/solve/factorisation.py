"""One factorisation and whether it may be used again: over iterations, stages and steps."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from ngsolve import BaseVector
from numpy.typing import NDArray

from ngswell.files import Tree
from ngswell.problem.problem import Problem
from ngswell.solve.direct import LinearSolver

FASTEST, CAUTION, TRUSTED = 0.1, 3.0, 0.02
"""The rate of a matrix's first solves does not hold for those of later stages and steps: one above the first is taken as it
is, a smaller one times the second but as no more than the first, and none as less than the third."""


class Point(NamedTuple):
    """Where a matrix is dr/dx: time and step [s], fields, and whether contents are lumped."""

    time: float
    dt: float
    values: NDArray
    lumped: bool


class Factorisation:
    """The present factorisation of a linear solver, kept as long as it is worth it.

    It is usable while each correction made with it was at most `slowest` times the one before, and for steps that differ by
    no more than that share from the one it was made for. With 0 each iteration has its own.
    """

    def __init__(self, solver: LinearSolver, slowest: float = 0.0) -> None:
        self.solver, self.slowest = solver, slowest
        self._ready = False
        self._contraction: float | None = None  # the last correction over the one before, once there are two
        self._made: Point | None = None
        self._analysed: Point | None = None  # of the analysis that later ones share, which may depend on its values

    @property
    def usable(self) -> bool:
        """Whether corrections with the present factorisation are expected to shrink fast enough."""
        slow = self._contraction is not None and self._contraction > self.slowest
        return self._ready and not slow and self.slowest > 0

    def prepare(self, problem: Problem, dt: float) -> None:
        """Before a nonlinear solve with the step `dt` [s]: a matrix of another step contracts no better than they differ."""
        if self._made is None:
            return
        change = abs(1 - dt / self._made.dt)
        if change > self.slowest or self._made.lumped != problem.storage.is_lumped:
            self._ready = False
        elif self._contraction is not None:
            self._contraction = max(self._contraction, change)

    def contracted(self, rate: float) -> None:
        """Take note of a correction over the one before."""
        self._contraction = max(rate, self._contraction or 0.0)

    def left(self, change: float) -> float:
        """What further corrections with it would add up to, after one of the size `change`: a geometric series."""
        rate = self._contraction
        if rate is None or not self.slowest:
            return change
        rate = max(rate, min(FASTEST, max(TRUSTED, CAUTION * rate)))
        return change * min(1.0, rate / (1 - rate))

    def renew(self, problem: Problem) -> bool:
        """Linearise and factorise at the present fields; False if the matrix is singular or not finite."""
        at = Point(problem.time, problem.dt.Get(), problem.vector.copy(), problem.storage.is_lumped)
        self._ready, self._contraction = False, None
        if not self.solver.renew(problem):
            return False
        self._ready, self._made = True, at
        if self._analysed is None or self.solver.analysed_anew:
            self._analysed = at
        return True

    def solve(self, right: BaseVector, solution: BaseVector, prescribed: BaseVector | None = None) -> bool:
        """solution = A⁻¹ right, with `prescribed` values where degrees of freedom are not free; False if none is found.

        A factorisation that finds none is not used again.
        """
        solved = self.solver.solve(right, solution, prescribed)
        self._ready &= solved
        return solved

    def state(self) -> Tree:
        """What makes the next solve, or the next factorisation, the same in another process."""
        kept: Tree = {
            "counts": np.array([self.solver.factorisations, self.solver.solves]),
            "ready": np.array(self._ready),
        }
        if self._contraction is not None:
            kept["contraction"] = np.array(self._contraction)
        for name, point in (("analysed", self._analysed), ("made", self._made)):
            if point is not None:
                kept[name] = {
                    "at": np.array([point.time, point.dt]),
                    "fields": point.values,
                    "lumped": np.array(point.lumped),
                }
        return kept

    def restore(self, problem: Problem, state: Tree) -> None:
        """Factorise as before; moves the fields and the clock of `problem`."""
        for name in ("analysed", "made"):
            if name in state:
                time, dt = state[name]["at"].tolist()
                problem.set_time(time)
                problem.dt.Set(dt)
                problem.storage.lump(bool(state[name]["lumped"]))
                problem.vector[:] = state[name]["fields"]
                self.renew(problem)
        self.solver.factorisations, self.solver.solves = state["counts"].tolist()
        self._ready = bool(state["ready"])
        self._contraction = float(state["contraction"]) if "contraction" in state else None
