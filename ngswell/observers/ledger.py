"""What the body holds and what crossed its boundaries."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ngswell.baths import Penalty
from ngswell.observers.base import Observer
from ngswell.problem import Problem
from ngswell.stepping import StepReport


class Ledger(Observer):
    """Fluid volume and cations held, and what left through each bath by the discrete fluxes.

    Both are sums over the test functions that add up to one, so `held − held₀ + Σ left` closes to the accuracy of the
    nonlinear solve: the scheme conserves exactly. A node that two strongly treated baths share counts with the first.

    Attributes, one entry a time: `time` [s], `fluid` [mm²; mm, mm³ in 1-d, 3-d], `cations` [mol/l times that];
    `fluid_left`, `cations_left` by boundary, cumulative.
    """

    def __init__(self) -> None:
        super().__init__()
        self._rows: list[tuple[float, float, float]] = []
        self._left: dict[tuple[str, str], list[float]] = {}

    def start(self, problem: Problem, begin: float, until: float) -> None:
        self._vector = problem.fields.vec.CreateVector()
        self._vertices = {name: slice(r.start, r.start + problem.mesh.nv) for name, r in problem.ranges.items()}
        self._effluxes = [
            (bath.boundary, name, problem.form(term))
            for bath in problem.scene.baths
            if isinstance(bath.treatment, Penalty)
            for name in ("fluid", "cations")
            for term in problem.terms
            if (term.balance, term.name, term.boundary) == (name, "efflux", bath.boundary)
        ]
        self._reactions: list[tuple[str, str, NDArray]] = []
        taken = np.zeros(problem.mesh.nv, dtype=bool)
        for bath in problem.scene.baths:
            if not isinstance(bath.treatment, Penalty):
                region = problem.mesh.Boundaries(bath.boundary)
                mine = sorted({v.nr for element in region.Elements() for v in element.vertices if not taken[v.nr]})
                taken[mine] = True
                for name, unknown in (("fluid", "p"), ("cations", "c")):
                    self._reactions.append((bath.boundary, name, problem.ranges[unknown].start + np.array(mine)))
        self._left = {(name, bath.boundary): [0.0] for bath in problem.scene.baths for name in ("fluid", "cations")}
        super().start(problem, begin, until)

    def record(self, problem: Problem, time: float) -> None:
        problem.contents(self._vector)
        held = self._vector.FV().NumPy()
        self._rows.append((time, held[self._vertices["p"]].sum(), held[self._vertices["c"]].sum()))

    def observe(self, problem: Problem, report: StepReport) -> None:
        values = self._vector.FV().NumPy()
        gone = dict.fromkeys(self._left, 0.0)
        for boundary, name, form in self._effluxes:
            form.Apply(problem.fields.vec, self._vector)
            gone[name, boundary] += report.dt * values[self._vertices["p" if name == "fluid" else "c"]].sum()
        if self._reactions:
            problem.residual(self._vector)
            for boundary, name, dofs in self._reactions:
                gone[name, boundary] -= report.dt * values[dofs].sum()
        for key, amount in gone.items():
            self._left[key].append(self._left[key][-1] + amount)
        super().observe(problem, report)

    @property
    def time(self) -> NDArray:
        return np.array([row[0] for row in self._rows])

    @property
    def fluid(self) -> NDArray:
        return np.array([row[1] for row in self._rows])

    @property
    def cations(self) -> NDArray:
        return np.array([row[2] for row in self._rows])

    @property
    def fluid_left(self) -> dict[str, NDArray]:
        return {boundary: np.array(values) for (name, boundary), values in self._left.items() if name == "fluid"}

    @property
    def cations_left(self) -> dict[str, NDArray]:
        return {boundary: np.array(values) for (name, boundary), values in self._left.items() if name == "cations"}

    def imbalance(self) -> tuple[float, float]:
        """Largest |held − held₀ + left| over the run, relative to the largest held: (fluid, cations)."""
        return (
            _imbalance(self.fluid, list(self.fluid_left.values())),
            _imbalance(self.cations, list(self.cations_left.values())),
        )


def _imbalance(held: NDArray, left: list[NDArray]) -> float:
    return float(np.abs(held - held[0] + sum(left, np.zeros_like(held))).max() / np.abs(held).max())
