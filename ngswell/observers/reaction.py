"""The force on what a boundary is held by, touches or is pressed by, from the balance of momentum."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ngswell import checks
from ngswell.errors import InputError
from ngswell.mesh.points import vertices_of
from ngswell.models.term import Role, Term
from ngswell.observers.records import Recorder, power_of_mm
from ngswell.problem.problem import Problem
from ngswell.setup.setup import Setup
from ngswell.streams import CSV

UNITS = ("N/mm²", "N/mm", "N")
"""Of forces on a point of a column, on a line in plane strain and on a surface."""


class Reaction(Recorder):
    """Force with which the body pushes on what holds a boundary or is touched by it: a vector along the motion's directions.

        base = Reaction("bottom")  # or "bottom|left", their sum

    Not taken from derivatives: it is what the balance of momentum (16) lacks at the displacements that supports hold there.
    All held boundaries together bear the sum of the loads, a bath's pressure among them, to what the solves leave (along r
    the hoop stress bears a share). Directions that are not held have 0. A vertex that several held boundaries share counts,
    in each direction, with the one whose support stands first in the scene; a pinned vertex counts with the first held
    boundary that it is on, and with none if it is on none. What obstacles bear on the boundary is added. On a boundary that
    nothing holds or touches, the force is what the pressure of its bath bears.

    `values` has one row a time: N/mm² in a column, N per mm of thickness in plane strain or length of a cylinder, N in
    space, and N on the whole circumference, 2π, when axisymmetric; along r that is the sum of the radial forces. At a
    start out of balance it is that of the fields as they are. With `to`, a path or a `CSV`, records go to that file;
    `dense` as in `Probe`. Raises InputError for a boundary on which nothing is held, that no obstacle may touch and no bath
    presses on.
    """

    def __init__(
        self,
        boundary: str,
        when: float | Sequence[float] | None = None,
        to: str | Path | CSV | None = None,
        dense: bool = False,
    ) -> None:
        checks.name("Reaction: boundary", boundary, "bottom")
        self.boundary = boundary
        super().__init__(when, boundary, to=to, dense=dense)

    def prepare(self, problem: Problem, begin: float, until: float) -> None:
        names, owners = problem.setup.check_boundary("Reaction", self.boundary), _owners(problem.setup)
        held, touching = set(owners.values()), list(_touching(problem))
        met = {term.boundary for term in touching}
        pressed = [term for term in _pressed(problem) if term.boundary not in held | met]
        pushed = [*touching, *pressed]
        for name in names:
            if name not in held | {term.boundary for term in pushed}:
                raise InputError(
                    f"Reaction: nothing is held on {name!r}; held boundaries are {_listed(held)}, those with an obstacle "
                    f"{_listed(met)}, those that a bath alone presses on {_listed({term.boundary for term in pressed})}"
                )
        directions = problem.kinematics.directions
        displacement = problem.ranges[problem.names[0]]
        per_component = (displacement.stop - displacement.start) // len(directions)
        self._dofs = [
            [
                displacement.start + axis * per_component + vertex
                for (vertex, held), name in owners.items()
                if held == direction and name in names
            ]
            for axis, direction in enumerate(directions)
        ]
        firsts = [displacement.start + axis * per_component for axis in range(len(directions))]
        self._vertices = [slice(first, first + problem.mesh.nv) for first in firsts]
        mine = [term for term in pushed if term.boundary in names]
        self._pushes = problem.form(mine) if mine else None
        self._lacks, self._unit = problem.fields.vec.CreateVector(), UNITS[power_of_mm(problem) - 1]

    def unit(self, name: str) -> str:
        return self._unit

    def row(self, problem: Problem) -> Mapping[str, Any]:
        problem.outflow(self._lacks)
        lacks = self._lacks.FV().NumPy()
        force = np.array([-lacks[dofs].sum() for dofs in self._dofs])
        if self._pushes is not None:
            self._pushes.apply(self._lacks)
            force += [lacks[part].sum() for part in self._vertices]
        return {"force": force}

    @property
    def values(self) -> NDArray:
        """Forces, one row a time."""
        return self._table.columns().get("force", np.zeros((0, 0)))


def _owners(setup: Setup) -> dict[tuple[int, str], str]:
    """The boundary with which each held pair of a vertex and a direction counts."""
    owners: dict[tuple[int, str], str] = {}
    vertices: dict[str, set[int]] = {}
    for one in setup.held():
        for name in one.boundary.split("|"):
            vertices.setdefault(name, vertices_of(setup.mesh, name))
            for vertex in vertices[name]:
                owners.setdefault((vertex, one.direction), name)
    for vertex, direction in setup.pins():
        for name in vertices:
            if vertex in vertices[name]:
                owners.setdefault((vertex, direction), name)
    return owners


def _touching(problem: Problem) -> Iterator[Term]:
    """What pushes back at single boundaries that touch obstacles."""
    for term in problem.terms:
        if term.role is Role.CONTACT and term.boundary is not None:
            yield from (replace(term, boundary=name) for name in term.boundary.split("|"))


def _pressed(problem: Problem) -> Iterator[Term]:
    """What baths press single boundaries with."""
    trials, tests = (list(functions) for functions in problem.space.TnT())
    for bath in problem.setup.baths:
        for term in bath.loads(problem.kinematics, trials[0], tests[0], problem.baths[bath.boundary]):
            yield from (replace(term, boundary=name) for name in bath.boundary.split("|"))


def _listed(names: Iterable[str | None]) -> str:
    return ", ".join(sorted(map(repr, names))) or "none"
