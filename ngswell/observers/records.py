"""Records of numbers, in the memory or in a file."""

from __future__ import annotations

from abc import abstractmethod
from array import array
from collections.abc import Callable, Mapping, Sequence
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ngswell import checks
from ngswell.errors import InputError
from ngswell.files import Tree
from ngswell.observers.base import Observer
from ngswell.problem.problem import Problem
from ngswell.setup.snapshot import Snapshot
from ngswell.stepping.steps import Step
from ngswell.streams import CSV, Stream
from ngswell.team import Team


class Table:
    """Rows of a time and of numbers, vectors and tensors by name; all rows are alike."""

    def __init__(self, what: str, to: CSV | None, unit: Callable[[str], str]) -> None:
        self._unit = unit  # of a quantity, for the header of a file
        self._stream = None if to is None else Stream(to, what)
        self._numbers = array("d")  # of all rows, one after another; none of those in a file
        self._shapes: dict[str, tuple[int, ...]] = {}

    def begin(self, team: Team) -> None:
        if self._stream is not None:
            self._stream.begin(team)

    def append(self, time: float, row: Mapping[str, Any]) -> None:
        values = {name: np.asarray(value, dtype=float) for name, value in row.items()}
        numbers = [float(time), *(number for value in values.values() for number in value.ravel().tolist())]
        if not self._shapes:
            self._shapes = {name: value.shape for name, value in values.items()}
            if self._stream is not None:
                self._stream.write(["time [s]", *self._header()])
        if self._stream is not None:
            self._stream.write(list(map(repr, numbers)))
        else:
            self._numbers.extend(numbers)

    def _header(self) -> list[str]:
        """Names of the columns beside the time, with their units as in `to_csv`: "p [N/mm²]", "displacement 1 [mm]"."""
        header: list[str] = []
        units: list[str] = []
        for name, shape in self._shapes.items():
            header += [name] if shape == () else [f"{name} {number}" for number in range(1, prod(shape) + 1)]
            units += [self._unit(name)] * prod(shape)
        return [f"{name} [{unit}]" for name, unit in zip(header, units, strict=True)]

    def _rows(self) -> NDArray:
        width = 1 + sum(map(prod, self._shapes.values()))
        if self._stream is None:
            return np.array(self._numbers).reshape(-1, width)
        return np.column_stack(list(self._stream.there().read().values())) if self._shapes else np.zeros((0, width))

    @property
    def time(self) -> NDArray:
        """Times of the records [s]."""
        return self._rows()[:, 0].copy()

    def columns(self) -> dict[str, NDArray]:
        """Records of each quantity: one row a time."""
        rows, at, found = self._rows(), 1, {}
        for name, shape in self._shapes.items():
            found[name] = rows[:, at : at + prod(shape)].reshape(len(rows), *shape).copy()
            at += prod(shape)
        return found

    def state(self) -> Tree:
        """The records, or where they stand in the file."""
        shapes = {name: np.array(shape, dtype=int) for name, shape in self._shapes.items()}
        return {"shapes": shapes} | ({"rows": self._rows()} if self._stream is None else self._stream.state())

    def resume(self, state: Tree, team: Team) -> None:
        self._shapes = {name: tuple(shape.tolist()) for name, shape in state["shapes"].items()}
        if self._stream is None:
            self._numbers = array("d", state["rows"].ravel().tolist())
        else:
            self._stream.resume(state, team)

    def close(self) -> None:
        if self._stream is not None:
            self._stream.close()


def power_of_mm(problem: Problem) -> int:
    """Of the unit of the body's volume: 1 in a column, 2 in the plane and per millimetre of a cylinder, 3 otherwise."""
    return problem.kinematics.power


def product(unit: str, power: int) -> str:
    """A unit times a power of mm: "N/mm² mm²"; without one, the other alone."""
    factors = [unit.strip("-"), ("", "mm", "mm²", "mm³")[power]]
    return " ".join(filter(None, factors)) or "-"


class Recorder(Observer):
    """An observer whose records are rows of numbers: in the memory, or in the file `to` (a `CSV`, or its path), from which
    they are read when asked for. A class gives `row` and `unit` in place of `record`, `state`, `restore` and `table`.

    Steps do not land on the times `when` of one that is `dense`: its records lie on the scheme's interpolant of the rows at
    the stages of a step (`Step.weights`). Such a class gives rows of the present fields alone.
    """

    def __init__(
        self,
        when: float | Sequence[float] | None = None,
        *settings: object,
        to: str | Path | CSV | None = None,
        dense: bool = False,
    ) -> None:
        what = type(self).__name__
        file = CSV.of(f"{what}: to", to)
        checks.flag(f"{what}: dense", dense)
        if dense and when is None:
            raise InputError(f"{what}: dense records lie between steps, at times `when`: give an interval or a list [s]")
        self._dense = bool(dense)
        super().__init__(when, *settings, *(("dense",) if dense else ()), *(() if file is None else (file,)))
        self._table = Table(what, file, self.unit)

    @abstractmethod
    def row(self, problem: Problem) -> Mapping[str, Any]:
        """The record of the present fields: numbers, vectors or tensors by name."""

    @abstractmethod
    def unit(self, name: str) -> str:
        """Unit of a quantity of the records, once prepared."""

    def table(self) -> dict[str, NDArray]:
        columns = self._table.columns().items()
        return {f"{name} [{self.unit(name)}]": values for name, values in columns if values[0].size}

    @property
    def time(self) -> NDArray:
        """Times of the records [s]."""
        return self._table.time

    def start(self, problem: Problem, begin: float, until: float) -> None:
        self.prepare(problem, begin, until)
        self._table.begin(problem.team)
        try:
            self._record_if_due(problem, begin)
        except BaseException:
            self._table.close()
            raise

    def resume(self, problem: Problem, begin: float, until: float, state: Tree) -> None:
        self.prepare(problem, begin, until)
        self._table.resume(state, problem.team)
        self.restore(state)

    def plan(self, begin: float, until: float) -> list[float]:
        times = super().plan(begin, until)
        return [] if self._dense else times

    def observe(self, problem: Problem, step: Step) -> None:
        if not self._dense:
            super().observe(problem, step)
        elif times := self._when.passed(step.stages[0].time, step.time):
            end, rows = problem.snapshot(step.time), []
            for _, time, values in step.stages:
                problem.restore(Snapshot(time, values))
                rows.append(self.row(problem))
            problem.restore(end)
            for time in times:
                self._table.append(time, _combined(step.weights(time), rows))

    def _record_if_due(self, problem: Problem, time: float) -> None:
        if self._when.due(time):
            self._table.append(time, self.row(problem))

    def state(self) -> Tree:
        return self._table.state()

    def kept(self) -> Tree:
        return self.state()

    def finish(self, problem: Problem) -> None:
        self._table.close()


def _combined(weights: NDArray, rows: Sequence[Mapping[str, Any]]) -> dict[str, NDArray]:
    """The sum of rows, each times its weight."""
    return {name: np.tensordot(weights, np.array([row[name] for row in rows], dtype=float), 1) for name in rows[0]}
