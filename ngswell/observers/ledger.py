"""What the body holds and what crossed its boundaries."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ngswell.files import Tree
from ngswell.mesh.points import vertices_of
from ngswell.models.term import Kind, Role
from ngswell.observers.base import Observer
from ngswell.problem.discretisation import Snapshot
from ngswell.problem.forms import form
from ngswell.problem.problem import Problem
from ngswell.stepping.steps import Step


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
        inner = [
            term
            for term in problem.terms
            if term.balance in problem.model.balanced and term.kind is not Kind.RATE and term.role is not Role.EFFLUX
        ]
        self._flows = form(problem, inner)
        self._nodes: dict[tuple[str, str], NDArray] = {}
        taken = np.zeros(problem.mesh.nv, dtype=bool)
        for bath in problem.setup.baths:
            mine = np.array([number for number in sorted(vertices_of(problem.mesh, bath.boundary)) if not taken[number]])
            taken[mine] = True
            for name, unknown in problem.model.balanced.items():
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
        for name, unknown in problem.model.balanced.items():
            self._held.setdefault(name, []).append(held[self._vertices[unknown]].sum())

    def observe(self, problem: Problem, step: Step) -> None:
        contents = self._contents_at_nodes(problem)
        gone = {key: self._contents[key] - now for key, now in contents.items()}
        self._contents = contents
        end = problem.snapshot(step.time)
        for weight, time, values in step.stages:
            problem.restore(Snapshot(time, values))
            self._flows.Apply(problem.fields.vec, self._vector)
            for key, flow in self._sums().items():
                gone[key] -= weight * flow
        problem.restore(end)
        for key, amount in gone.items():
            self._left[key].append(self._left[key][-1] + amount)
        super().observe(problem, step)

    def state(self) -> Tree:
        left: Tree = {}
        for (name, boundary), values in self._left.items():
            left.setdefault(name, {})[boundary] = np.array(values)
        return {"held": {name: np.array(values) for name, values in self._held.items()}, "left": left}

    def restore(self, state: Tree) -> None:
        self._held = {name: list(values) for name, values in state["held"].items()}
        self._left = {(name, boundary): list(state["left"][name][boundary]) for name, boundary in self._nodes}

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
        """Largest |held − held₀ + left| over the run, of "fluid" and "cations", relative to the largest held.

        Of a balance that holds nothing, relative to the largest that left; 0 where nothing did.
        """
        result = {}
        for name, values in self._held.items():
            held = np.array(values)
            gone = sum(self._left_of(name).values(), np.zeros_like(held))
            scale = np.abs(held).max() or np.abs(gone).max() or 1.0
            result[name] = float(np.abs(held - held[0] + gone).max() / scale)
        return result
