"""What the body holds and what crossed its boundaries."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ngswell.files import Tree
from ngswell.observers.base import Observer
from ngswell.observers.effluxes import Effluxes
from ngswell.problem.problem import Problem
from ngswell.setup.snapshot import Snapshot
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
        self._vertices = {name: slice(r.start, r.start + problem.mesh.nv) for name, r in problem.ranges.items()}
        self._effluxes = Effluxes(problem)
        self._left = {key: [0.0] for key in self._effluxes.nodes}
        self._contents = self._effluxes.sums(self._effluxes.contents())

    def record(self, problem: Problem, time: float) -> None:
        held = self._effluxes.contents()
        for name, unknown in problem.model.balanced.items():
            self._held.setdefault(name, []).append(held[self._vertices[unknown]].sum())

    def observe(self, problem: Problem, step: Step) -> None:
        effluxes = self._effluxes
        contents = effluxes.sums(effluxes.contents())
        gone = {key: self._contents[key] - now for key, now in contents.items()}
        self._contents = contents
        end = problem.snapshot(step.time)
        for weight, time, values in step.stages:
            problem.restore(Snapshot(time, values))
            for key, flow in effluxes.sums(effluxes.flows()).items():
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
        self._left = {(name, boundary): list(state["left"][name][boundary]) for name, boundary in self._effluxes.nodes}

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
