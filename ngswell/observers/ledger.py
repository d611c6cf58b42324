"""What the body holds and what crossed its boundaries."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ngswell.baths import Weak
from ngswell.observers.base import Observer
from ngswell.problem import Problem
from ngswell.stepping import StepReport


class Ledger(Observer):
    """Fluid volume and cations held, and what left through each bath by the discrete fluxes.

    Both are sums over the test functions that add up to one, so `held − held₀ + Σ left` closes to the accuracy of the
    nonlinear solve: the scheme conserves exactly. A node that two strongly treated baths share counts with the first.

    Attributes, one entry a time: `time` [s], `fluid` [mm², in 1-d mm, in 3-d mm³] and, where the model has
    ions, `cations` [mol/l times that];
    `fluid_left`, `cations_left` by boundary, cumulative.
    """

    def __init__(self) -> None:
        super().__init__()
        self._held: dict[str, list[float]] = {}
        self._left: dict[tuple[str, str], list[float]] = {}

    def start(self, problem: Problem, begin: float, until: float) -> None:
        self._vector = problem.fields.vec.CreateVector()
        self._vertices = {name: slice(r.start, r.start + problem.mesh.nv) for name, r in problem.ranges.items()}
        self._effluxes = [
            (bath.boundary, name, problem.form(term))
            for bath in problem.scene.baths
            for name in problem.model.held
            for term in problem.terms
            if (term.balance, term.name, term.boundary) == (name, "efflux", bath.boundary)
        ]
        self._reactions: list[tuple[str, str, NDArray]] = []
        taken = np.zeros(problem.mesh.nv, dtype=bool)
        for bath in problem.scene.baths:
            if not isinstance(problem.scene.treatment(bath), Weak):
                region = problem.mesh.Boundaries(bath.boundary)
                mine = sorted({v.nr for element in region.Elements() for v in element.vertices if not taken[v.nr]})
                taken[mine] = True
                for name, unknown in problem.model.held.items():
                    self._reactions.append((bath.boundary, name, problem.ranges[unknown].start + np.array(mine)))
        self._left = {(name, bath.boundary): [0.0] for bath in problem.scene.baths for name in problem.model.held}
        super().start(problem, begin, until)

    def record(self, problem: Problem, time: float) -> None:
        problem.contents(self._vector)
        held = self._vector.FV().NumPy()
        for name, unknown in problem.model.held.items():
            self._held.setdefault(name, []).append(held[self._vertices[unknown]].sum())

    def observe(self, problem: Problem, report: StepReport) -> None:
        values = self._vector.FV().NumPy()
        gone = dict.fromkeys(self._left, 0.0)
        for boundary, name, form in self._effluxes:
            form.Apply(problem.fields.vec, self._vector)
            gone[name, boundary] += report.dt * values[self._vertices[problem.model.held[name]]].sum()
        if self._reactions:
            problem.residual(self._vector)
            for boundary, name, dofs in self._reactions:
                gone[name, boundary] -= report.dt * values[dofs].sum()
        for key, amount in gone.items():
            self._left[key].append(self._left[key][-1] + amount)
        super().observe(problem, report)

    @property
    def fluid(self) -> NDArray:
        return np.array(self._held["fluid"])

    @property
    def cations(self) -> NDArray:
        return np.array(self._held["cations"])

    @property
    def fluid_left(self) -> dict[str, NDArray]:
        return self._left_of("fluid")

    @property
    def cations_left(self) -> dict[str, NDArray]:
        return self._left_of("cations")

    def _left_of(self, name: str) -> dict[str, NDArray]:
        return {boundary: np.array(values) for (kind, boundary), values in self._left.items() if kind == name}

    def imbalance(self) -> dict[str, float]:
        """Largest |held − held₀ + left| over the run, relative to the largest held, of "fluid" and "cations"."""
        result = {}
        for name, values in self._held.items():
            held = np.array(values)
            gone = sum(self._left_of(name).values(), np.zeros_like(held))
            result[name] = float(np.abs(held - held[0] + gone).max() / np.abs(held).max())
        return result
