"""Values at a point, integrals over the body or a boundary, and whole states."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from ngsolve import CF, Integrate
from numpy.typing import NDArray

from ngswell import checks
from ngswell.errors import InputError
from ngswell.files import Tree
from ngswell.mesh.points import integral_on_boundary
from ngswell.models.solid_state import FLUXES, OUTPUT_UNITS, warn_of_extrapolation
from ngswell.observers.base import Observer
from ngswell.observers.records import Recorder, power_of_mm, product
from ngswell.problem.problem import Problem
from ngswell.setup.snapshot import Snapshot
from ngswell.streams import CSV

UNKNOWN = "unit of the model"
"""Of outputs that a model of one's own adds."""


class Probe(Recorder):
    """Quantities at a point of the reference configuration [mm].

    `Probe((1.1, 0.5), "J", "p")`; then `probe.time` and `probe.values["J"]` are arrays, one row a record. Quantities and
    units are those of `ngswell.models.solid_state.OUTPUT_UNITS`. With `to`, a path or a `CSV`, records go to that file.
    Fluxes and stress are made of derivatives: good inside cells; at a bath take `Outflow`. Warns with ExtrapolationWarning,
    once, at a corner where J − nS0 is not positive.

    With `dense`, records at the times `when` lie on the scheme's interpolant between steps, and no step lands there: as
    accurate as those at the ends of steps, but for the first steps after a sudden change.
    """

    def __init__(
        self,
        point: Sequence[float],
        *quantities: str,
        when: float | Sequence[float] | None = None,
        to: str | Path | CSV | None = None,
        dense: bool = False,
    ) -> None:
        if not quantities:
            raise InputError("Probe: name at least one quantity, such as 'displacement'")
        for quantity in quantities:
            checks.name("Probe: a quantity", quantity, "displacement")
        self.point, self.quantities = checks.vector("Probe: point", point, 1e6, "mm"), quantities
        super().__init__(when, self.point, *quantities, to=to, dense=dense)
        self._warned = False

    def prepare(self, problem: Problem, begin: float, until: float) -> None:
        if len(self.point) != problem.mesh.dim or not problem.mesh.Contains(*self.point):
            raise InputError(f"Probe: {self.point} is not a point of the {problem.mesh.dim}-d body")
        self._fields = {name: problem.state.output(name) for name in self.quantities}

    def unit(self, name: str) -> str:
        return OUTPUT_UNITS.get(name, UNKNOWN)

    def row(self, problem: Problem) -> Mapping[str, Any]:
        point = problem.mesh(*self.point)
        if not self._warned and (content := problem.state.content(point)) <= 0:
            self._warned = True
            warn_of_extrapolation("Probe", content, self.point)
        return {name: field(point) for name, field in self._fields.items()}

    @property
    def values(self) -> dict[str, NDArray]:
        """Records of each quantity: one row a time."""
        return self._table.columns()


class Integral(Recorder):
    """Integral of a quantity over the deformed body, or over the deformed `boundary`; of 1 if no quantity is named.

    With `to`, a path or a `CSV`, records go to that file; `dense` as in `Probe`.

    Raises InputError for a flux on a boundary: `Outflow` has it from the balances. "stress" is made of derivatives too: its
    integral over a held side or a corner is off at any mesh where the stress is singular; `Reaction` has the force there.
    """

    def __init__(
        self,
        quantity: str | None = None,
        boundary: str | None = None,
        when: float | Sequence[float] | None = None,
        to: str | Path | CSV | None = None,
        dense: bool = False,
    ) -> None:
        super().__init__(when, quantity, boundary, to=to, dense=dense)
        for what, value, example in (("quantity", quantity, "p"), ("boundary", boundary, "top")):
            if value is not None:
                checks.name(f"Integral: {what}", value, example)
        if quantity in FLUXES and boundary is not None:
            raise InputError(
                f"Integral: {quantity!r} on a boundary would be the sum of derivatives where they are least accurate; "
                "what passes a bath is in Outflow('top') at each time and in Ledger() in all, and elsewhere nothing passes"
            )
        self.quantity, self.boundary = quantity, boundary

    def prepare(self, problem: Problem, begin: float, until: float) -> None:
        quantity = CF(1.0) if self.quantity is None else problem.state.output(self.quantity)
        weight = problem.kinematics.weight
        unit = "-" if self.quantity is None else OUTPUT_UNITS.get(self.quantity, UNKNOWN)
        self._unit = product(unit, power_of_mm(problem) - (self.boundary is not None))
        if self.boundary is None:
            self._density = (quantity * problem.state.J * weight).Compile()
        else:
            problem.setup.check_boundary("Integral", self.boundary)
            self._quantity, self._measure = quantity, problem.state.stretch_on_boundary * weight

    def unit(self, name: str) -> str:
        return self._unit

    def row(self, problem: Problem) -> Mapping[str, Any]:
        mesh, order = problem.mesh, 2 * problem.model.order + 2
        if self.boundary is None:
            return {"value": Integrate(self._density, mesh, order=order)}
        return {"value": integral_on_boundary(mesh, self._quantity, self.boundary, order, self._measure)}

    @property
    def values(self) -> NDArray:
        """Records, one row a time; the quantity's unit times mm (1-d, or a boundary in 2-d), mm² or mm³."""
        return self._table.columns().get("value", np.zeros(0))


class Area(Integral):
    """Area of the deformed body in plane strain [mm²], its volume in three dimensions [mm³], its length confined [mm]."""

    def __init__(
        self, when: float | Sequence[float] | None = None, to: str | Path | CSV | None = None, dense: bool = False
    ) -> None:
        super().__init__(when=when, to=to, dense=dense)


class Snapshots(Observer):
    """Whole states at the given times, for pictures (`scene.state`) and for runs that go on from them."""

    def __init__(self, when: float | Sequence[float] | None) -> None:
        super().__init__(when)
        self.states: list[Snapshot] = []

    def prepare(self, problem: Problem, begin: float, until: float) -> None:
        self._meaning = problem.meaning

    def record(self, problem: Problem, time: float) -> None:
        self.states.append(problem.snapshot(time))

    def state(self) -> Tree:
        return {"values": np.array([state.values for state in self.states])}

    def restore(self, state: Tree) -> None:
        self.states = [
            Snapshot(time, values, self._meaning) for time, values in zip(self._recorded, state["values"], strict=True)
        ]
