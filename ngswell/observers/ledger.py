"""What the body holds and what crossed its boundaries."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ngswell.files import Tree
from ngswell.observers.effluxes import Effluxes
from ngswell.observers.records import Recorder, power_of_mm, product
from ngswell.problem.problem import Problem
from ngswell.setup.snapshot import Snapshot
from ngswell.stepping.steps import Step
from ngswell.streams import CSV


class Ledger(Recorder):
    """Fluid volume and cations held, and what left through each bath by the discrete fluxes.

    What left is what the balances of the nodes on a bath lack: their flows from the body, over the stages of the step, less
    the fall of their contents. A node that two baths share counts with the first. What an `Efflux`
    takes out is counted as given, by its boundary. `held − held₀ + Σ left` is what the
    nonlinear solves left in all other nodes: the scheme itself conserves exactly.

    Attributes, one entry a time: `time` [s], `fluid` [mm², in 1-d mm, in 3-d mm³] and, where the model has
    ions, `cations` [mol/l times that];
    `fluid_left`, `cations_left` by boundary, cumulative. Of baths in vessels, by boundary: `bath_fluid` and
    `bath_cations` that they hold, their concentration `bath_c` [mol/l], and what was let in less what was let out,
    `fluid_fed` and `cations_fed`. With `to`, a path or a `CSV`, records go to that file.
    """

    def __init__(self, to: str | Path | CSV | None = None) -> None:
        super().__init__(to=to)
        self._left: dict[tuple[str, str], float] = {}  # so far
        self._fed: dict[tuple[str, str], float] = {}
        self._balances: tuple[str, ...] = ()

    def prepare(self, problem: Problem, begin: float, until: float) -> None:
        self._power = power_of_mm(problem)
        self._vertices = {name: slice(r.start, r.start + problem.mesh.nv) for name, r in problem.ranges.items()}
        self._effluxes, self._balances = Effluxes(problem), tuple(problem.model.balanced)
        self._left = dict.fromkeys((*self._effluxes.nodes, *self._effluxes.given()), 0.0)
        self._fed = dict.fromkeys(self._effluxes.vessels, 0.0)
        self._contents = self._effluxes.sums(self._effluxes.contents())

    def unit(self, name: str) -> str:
        return product("mol/l" if name.startswith("cations") else "-", self._power)

    def row(self, problem: Problem) -> Mapping[str, Any]:
        held = self._effluxes.contents()
        whole = {name: held[self._vertices[unknown]].sum() for name, unknown in problem.model.balanced.items()}
        whole |= {_left_through(boundary, name): amount for (name, boundary), amount in self._left.items()}
        for (name, boundary), dof in self._effluxes.vessels.items():
            whole[_in_bath(boundary, name)] = held[dof]
            whole[_fed_to(boundary, name)] = self._fed[name, boundary]
        return whole

    def observe(self, problem: Problem, step: Step) -> None:
        effluxes = self._effluxes
        contents = effluxes.sums(effluxes.contents())
        gone = {key: self._contents[key] - now for key, now in contents.items()}
        self._contents = contents
        end = problem.snapshot(step.time)
        for weight, time, values in (stage for stage in step.stages if stage.weight):
            problem.restore(Snapshot(time, values))
            flows = effluxes.flows()
            for key, flow in effluxes.sums(flows).items():
                gone[key] -= weight * flow
            for key, flow in effluxes.given().items():
                self._left[key] += weight * flow
            for key, dof in effluxes.vessels.items():
                self._fed[key] -= weight * float(flows[dof])
        problem.restore(end)
        for key, amount in gone.items():
            self._left[key] += amount
        super().observe(problem, step)

    def state(self) -> Tree:
        so_far = {"left": np.array(list(self._left.values())), "fed": np.array(list(self._fed.values()))}
        return {**super().state(), **so_far}

    def restore(self, state: Tree) -> None:
        self._left = dict(zip(self._left, state["left"].tolist(), strict=True))
        self._fed = dict(zip(self._effluxes.vessels, state["fed"].tolist(), strict=True))

    @property
    def fluid(self) -> NDArray:
        return self._table.columns()["fluid"]

    @property
    def cations(self) -> NDArray:
        return self._table.columns()["cations"]

    @property
    def fluid_left(self) -> dict[str, NDArray]:
        return self._left_of("fluid")

    @property
    def cations_left(self) -> dict[str, NDArray]:
        return self._left_of("cations")

    @property
    def bath_fluid(self) -> dict[str, NDArray]:
        return self._of_vessels(_in_bath, "fluid")

    @property
    def bath_cations(self) -> dict[str, NDArray]:
        return self._of_vessels(_in_bath, "cations")

    @property
    def bath_c(self) -> dict[str, NDArray]:
        fluid = self.bath_fluid
        return {boundary: cations / fluid[boundary] for boundary, cations in self.bath_cations.items()}

    @property
    def fluid_fed(self) -> dict[str, NDArray]:
        return self._of_vessels(_fed_to, "fluid")

    @property
    def cations_fed(self) -> dict[str, NDArray]:
        return self._of_vessels(_fed_to, "cations")

    def _left_of(self, name: str) -> dict[str, NDArray]:
        columns = self._table.columns()
        return {boundary: columns[_left_through(boundary, name)] for kind, boundary in self._left if kind == name}

    def _of_vessels(self, column: Callable[[str, str], str], name: str) -> dict[str, NDArray]:
        columns = self._table.columns()
        return {boundary: columns[column(boundary, name)] for kind, boundary in self._fed if kind == name}

    def imbalance(self) -> dict[str, float]:
        """Largest |held − held₀ + left| over the run, of "fluid" and "cations", relative to the largest held.

        Of a balance that holds nothing, relative to the largest that left; 0 where nothing did. Of a bath in a vessel also
        |held − held₀ − left − fed|, relative to the largest that gel or bath held: together they close.
        """
        result, columns = {}, self._table.columns()
        for name in self._balances:
            held = columns[name]
            gone = sum(self._left_of(name).values(), np.zeros_like(held))
            scale = np.abs(held).max() or np.abs(gone).max() or 1.0
            result[name] = float(np.abs(held - held[0] + gone).max() / scale)
            left, fed = self._left_of(name), self._of_vessels(_fed_to, name)
            for boundary, there in self._of_vessels(_in_bath, name).items():
                lack = np.abs(there - there[0] - left[boundary] - fed[boundary]).max()
                result[name] = max(result[name], float(lack / max(scale, np.abs(there).max())))
        return result


def _left_through(boundary: str, name: str) -> str:
    return f"{name} left through {boundary}"


def _in_bath(boundary: str, name: str) -> str:
    return f"{name} in the bath on {boundary}"


def _fed_to(boundary: str, name: str) -> str:
    return f"{name} fed to the bath on {boundary}"
