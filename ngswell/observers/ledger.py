"""What the body holds and what crossed its boundaries."""

from __future__ import annotations

import numpy as np
from ngsolve import BilinearForm
from numpy.typing import NDArray

from ngswell.mesh.points import vertices_of
from ngswell.observers.base import Observer
from ngswell.problem.problem import Problem, Snapshot
from ngswell.stepping.stepper import StepReport


class Ledger(Observer):
    """Fluid volume and cations held, and what left through each bath by the discrete fluxes.

    What left is what the balances of the nodes on a bath lack: their flows from the body, over the stages of the step, less
    the fall of their contents. A node that two baths share counts with the first. `held − held₀ + Σ left` is what the
    nonlinear solves left in all other nodes: the scheme itself conserves exactly.

    Attributes, one entry a time: `time` [s], `fluid` [mm², in 1-d mm, in 3-d mm³] and, where the model has
    ions, `cations` [mol/l times that];
    `fluid_left`, `cations_left` by boundary, cumulative.
    """

    def __init__(self) -> None:
        super().__init__()
        self._held: dict[str, list[float]] = {}
        self._left: dict[tuple[str, str], list[float]] = {}

    def prepare(self, problem: Problem, begin: float, until: float) -> None:
        self._vector = problem.fields.vec.CreateVector()
        self._vertices = {name: slice(r.start, r.start + problem.mesh.nv) for name, r in problem.ranges.items()}
        self._flows = BilinearForm(problem.space)
        for term in problem.terms:
            if term.balance in problem.model.held and term.kind != "rate" and term.name != "efflux":
                self._flows += problem.integral(term)
        self._nodes: dict[tuple[str, str], NDArray] = {}
        taken = np.zeros(problem.mesh.nv, dtype=bool)
        for bath in problem.scene.baths:
            mine = np.array([number for number in sorted(vertices_of(problem.mesh, bath.boundary)) if not taken[number]])
            taken[mine] = True
            for name, unknown in problem.model.held.items():
                self._nodes[name, bath.boundary] = problem.ranges[unknown].start + mine
        self._left = {key: [0.0] for key in self._nodes}
        self._contents = self._contents_at_nodes(problem)

    def _contents_at_nodes(self, problem: Problem) -> dict[tuple[str, str], float]:
        problem.contents(self._vector)
        return self._sums()

    def _sums(self) -> dict[tuple[str, str], float]:
        values = self._vector.FV().NumPy()
        return {key: float(values[dofs].sum()) for key, dofs in self._nodes.items()}

    def record(self, problem: Problem, time: float) -> None:
        problem.contents(self._vector)
        held = self._vector.FV().NumPy()
        for name, unknown in problem.model.held.items():
            self._held.setdefault(name, []).append(held[self._vertices[unknown]].sum())

    def observe(self, problem: Problem, report: StepReport) -> None:
        contents = self._contents_at_nodes(problem)
        gone = {key: self._contents[key] - now for key, now in contents.items()}
        self._contents = contents
        end = problem.snapshot(report.time)
        for weight, time, values in problem.stages:
            problem.restore(Snapshot(time, values))
            self._flows.Apply(problem.fields.vec, self._vector)
            for key, flow in self._sums().items():
                gone[key] -= weight * flow
        problem.restore(end)
        for key, amount in gone.items():
            self._left[key].append(self._left[key][-1] + amount)
        super().observe(problem, report)

    def memory(self) -> dict[str, NDArray]:
        held = {f"held/{name}": np.array(values) for name, values in self._held.items()}
        return held | {f"left/{name}/{boundary}": np.array(values) for (name, boundary), values in self._left.items()}

    def remember(self, memory: dict[str, NDArray]) -> None:
        self._held = {key.split("/", 1)[1]: list(values) for key, values in memory.items() if key.startswith("held/")}
        self._left = {(name, boundary): list(memory[f"left/{name}/{boundary}"]) for name, boundary in self._nodes}

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
