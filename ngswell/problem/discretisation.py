"""A setup on its mesh: the space, its unknowns and their sizes, and states from their coefficients."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from ngsolve import BND, CF, ET, H1, VOL, BitArray, Compress, FESpace, GridFunction, IntegrationRule, NumberSpace
from numpy.typing import NDArray

from ngswell import checks
from ngswell.errors import InputError, place
from ngswell.mesh.points import vertices, vertices_of
from ngswell.models.model import BathFields, FieldContext
from ngswell.models.one_number import OneNumber
from ngswell.problem.lumping import Storage
from ngswell.problem.per_unknown import of_coefficients
from ngswell.problem.quadrature import over_body, watched
from ngswell.problem.share import Share
from ngswell.problem.tie import Tie
from ngswell.schedules import Clock, Schedule
from ngswell.setup.displacements import Held
from ngswell.setup.loads import followed
from ngswell.setup.setup import Setup
from ngswell.setup.snapshot import Snapshot
from ngswell.team import team_of

ROUND_OFF = 1e-12
"""What a held displacement may be off by, in units of its reference, and count as held."""


class Discretisation:
    """The unknowns of a setup. No field: two states of one setup have the same discretisation.

    Raises InputError where the mesh has changed since the setup was made.
    """

    def __init__(self, setup: Setup) -> None:
        setup.mesh_shape.check(setup.mesh)
        self.setup = setup
        self.mesh, self.model, self.kinematics = setup.mesh, setup.model, setup.kinematics
        self.team = team_of(setup.ranks)
        prescribed = "|".join(bath.boundary for bath, _ in setup.prescribed_baths)
        self.space: FESpace = self.model.space(self.mesh, self.kinematics, setup.fixed(), prescribed)
        self.names: tuple[str, ...] = self.model.unknowns
        with_multipliers = "|".join(bath.boundary for bath, treatment in setup.weak_baths if treatment.multipliers)
        if with_multipliers:
            traces = Compress(H1(self.mesh, order=self.model.order - 1, definedon=self.mesh.Boundaries(with_multipliers)))
            self.space = FESpace([*self.space.components, *(traces for _ in self.model.balanced)])
            self.names += tuple(f"efflux of {balance}" for balance in self.model.balanced)
        self.numbers: dict[str, OneNumber] = {number.name: number for number in self._bring_numbers()}
        if self.numbers:
            self.space = FESpace([*self.space.components, *(NumberSpace(self.mesh) for _ in self.numbers)])
            self.names += tuple(self.numbers)
        spans = [self.space.Range(i) for i in range(len(self.names))]
        self.ranges = {name: slice(span.start, span.stop) for name, span in zip(self.names, spans, strict=True)}
        self.free = self._free_dofs()

    def _bring_numbers(self) -> list[OneNumber]:
        """The unknowns that pieces of the setup bring: the seam for those of others."""
        return [number for bath in self.setup.baths for number in bath.numbers(self.concentration).values()]

    def _free_dofs(self) -> BitArray:
        free = BitArray(self.space.FreeDofs())
        directions = self.kinematics.directions
        per_component = self.space.components[0].ndof // len(directions)
        for vertex, direction in self.setup.pins():
            free.Clear(directions.index(direction) * per_component + vertex)
        return free

    @cached_property
    def rules(self) -> dict[ET, IntegrationRule]:
        """The integration rules of all forms over the body, whatever terms they have."""
        return over_body(self.model.order, self.mesh)

    @cached_property
    def points(self) -> NDArray:
        """Where bounds are looked at."""
        return watched(self.model.order, self.mesh)

    @cached_property
    def storage(self) -> Storage:
        """Where contents are lumped."""
        return Storage(self.mesh, self.kinematics.weight, self.share.cells)

    @cached_property
    def share(self) -> Share:
        """What this rank integrates over."""
        return Share(self.mesh, self.team)

    @property
    def largest_charge(self) -> float:
        """The highest fixed charge of the reference configuration, at any time and place [mol/l]."""
        return self.setup.material.largest("cfc0", self.mesh) * max(map(abs, self.setup.charge.values))

    @cached_property
    def concentration(self) -> float:
        """The largest concentration that the setup itself sets [mol/l]."""
        return max([self.largest_charge, *(value for bath in self.setup.baths for value in bath.concentrations)])

    @cached_property
    def evolving(self) -> dict[str, float]:
        """Unknowns whose time error is controlled, see `Model.evolving`."""
        shares = {name: number.evolves for name, number in self.numbers.items() if number.evolves is not None}
        return dict(self.model.evolving) | shares

    @cached_property
    def round_off(self) -> dict[str, float]:
        """What round-off leaves undetermined of unknowns, in their units."""
        return self.model.round_off(self.largest_charge, self.setup.material.RT)

    @cached_property
    def references(self) -> dict[str, float]:
        """A size of each unknown that the setup itself sets, so that tolerances need no units."""
        setup = self.setup
        corners = vertices(self.mesh)
        length = float(np.linalg.norm(corners.max(axis=0) - corners.min(axis=0)))
        own = self.model.references(self.concentration, setup.material.largest("mu", self.mesh), length)
        multipliers = self.names[len(own) : len(self.names) - len(self.numbers)]  # in the units of p and c
        own |= {name: own[unknown] for name, unknown in zip(multipliers, self.model.balanced.values(), strict=False)}
        return own | {name: number.size for name, number in self.numbers.items()}

    @cached_property
    def sizes(self) -> NDArray:
        """The reference size of every coefficient."""
        return of_coefficients(self.ranges, self.references)

    def worst(self, vector: NDArray) -> tuple[str, tuple[float, ...]]:
        """The unknown with the largest entry of `vector` in units of its reference, and the vertex [mm] where it is."""
        name = max(self.model.unknowns, key=lambda n: _largest(vector[self.ranges[n]]) / self.references[n])
        at_vertices = np.abs(self.vertex_values(vector, name)).max(axis=0)
        vertex = int(np.argmax(np.where(np.isfinite(at_vertices), at_vertices, np.inf)))
        return name, tuple(map(float, self.mesh.vertices[vertex].point))

    def vertex_values(self, vector: NDArray, name: str) -> NDArray:
        """Coefficients of an unknown at the vertices, one row a component."""
        components = self.kinematics.dimension if name == self.model.unknowns[0] else 1
        return vector[self.ranges[name]].reshape(components, -1)[:, : self.mesh.nv]

    @cached_property
    def meaning(self) -> dict[str, str]:
        """What coefficients are those of: equal for two scenes whose snapshots can be exchanged."""
        return {**self.fields_meaning, "numbers": ", ".join(self.numbers)}

    @cached_property
    def fields_meaning(self) -> dict[str, str]:
        """The same of the unknowns that are fields."""
        spans = [f"{name} {part.start}:{part.stop}" for name, part in self.ranges.items() if name not in self.numbers]
        multipliers = [bath.boundary for bath, treatment in self.setup.weak_baths if treatment.multipliers]
        return {
            "mesh": f"{self.mesh.ne} cells, {self.mesh.nv} vertices, {self.setup.mesh_digest[:12]}",
            "kinematics": type(self.kinematics).__name__,
            "model": f"{type(self.model).__name__} of order {self.model.order}",
            "unknowns": ", ".join(spans) + (f", multipliers on {'|'.join(multipliers)}" if multipliers else ""),
        }

    def check(self, what: str, snapshot: Snapshot) -> None:
        """Refuse a snapshot whose values mean something else here, or are elsewhere than this scene holds the body."""
        checks.instance(what, snapshot, Snapshot, "a snapshot, such as `result.end`")
        if snapshot.meaning and snapshot.meaning != self.meaning:
            name = next(name for name, mine in self.meaning.items() if snapshot.meaning.get(name) != mine)
            raise InputError(
                f"{what}: the snapshot has another {name} ({snapshot.meaning.get(name)}) than the scene "
                f"({self.meaning[name]}); go on with the scene that it comes from, or with what its `after` gives"
            )
        if snapshot.values.shape != (self.space.ndof,):
            raise InputError(f"{what}: the snapshot has {snapshot.values.size} unknowns, the scene {self.space.ndof}")
        shall = self.displaced_at(snapshot.time)
        for tie in self.ties:  # anywhere, but as one
            shall[tie.dofs] = snapshot.values[tie.dofs[0]]
        shall = shall[self._held]
        off = np.abs(snapshot.values[self._held] - shall)
        if off.size and not off.max() <= ROUND_OFF * self.references[self.names[0]]:
            worst = int(np.argmax(np.where(np.isfinite(off), off, np.inf)))
            where, is_at = self._place(int(self._held[worst])), snapshot.values[self._held][worst]
            raise InputError(
                f"{what}: the snapshot displaces the body by {is_at:.10g} mm near {place(where)} mm, where a support of the "
                f"scene holds it at {shall[worst]:.10g} mm; a support can hold only what is there already: give "
                "the Roller that displacement"
            )

    @cached_property
    def displaced(self) -> list[tuple[NDArray, Schedule]]:
        """Coefficients of the displacement that follow histories: those of vertices. The others there vanish."""
        return [(self._dofs(one), one.history) for one in self.setup.held() if one.moves and one.force is None]

    @cached_property
    def ties(self) -> list[Tie]:
        """Coefficients of the displacement that forces move as one."""
        return [Tie(self._dofs(one), one.force) for one in self.setup.held() if one.force is not None]

    def _dofs(self, one: Held) -> NDArray:
        """Coefficients at the vertices of what a support holds: where those alone are not zero it is moved as a whole."""
        per_component = self.space.components[0].ndof // len(self.kinematics.directions)
        first = per_component * self.kinematics.directions.index(one.direction)
        return first + np.array(sorted(vertices_of(self.mesh, one.boundary)))

    def displaced_at(self, time: float) -> NDArray:
        """Coefficients of the displacement on supports at `time` [s], 0 elsewhere."""
        values = np.zeros(self.ranges[self.names[0]].stop)
        for dofs, history in self.displaced:
            values[dofs] = history.at(time)
        return values

    @cached_property
    def _held(self) -> NDArray:
        """Numbers of the displacement's coefficients that supports hold."""
        return np.flatnonzero(~np.array(list(self.free))[: self.ranges[self.names[0]].stop])

    @cached_property
    def _still(self) -> NDArray:
        """Numbers of those that they hold at zero."""
        moved = [*(dofs for dofs, _ in self.displaced), *(tie.dofs for tie in self.ties)]
        return np.setdiff1d(self._held, np.concatenate(moved)) if moved else self._held

    def _place(self, dof: int) -> tuple[float, ...]:
        """About where [mm] a displacement's coefficient acts: its vertex, or the middle of its element."""
        space = self.space.components[0]
        vertex = dof % (space.ndof // len(self.kinematics.directions))
        if vertex < self.mesh.nv:
            return self.mesh.vertices[vertex].point
        elements = (element for region in (BND, VOL) for element in space.Elements(region))
        element = next(element for element in elements if dof in element.dofs)
        return tuple(np.mean([self.mesh.vertices[v.nr].point for v in element.vertices], axis=0))

    def state_at(self, snapshot: Snapshot) -> Any:
        """The model's state at a snapshot, on fields of its own: what a later run does leaves it as it is."""
        self.check("state", snapshot)
        fields = GridFunction(self.space)
        fields.vec.FV().NumPy()[:] = snapshot.values
        setup, time = self.setup, snapshot.time
        bath = None
        if setup.baths:
            first = setup.baths[0]
            salt = None if first.salt is None else CF(first.salt.at(time))
            if number := first.numbers(self.concentration).get("cations"):
                salt = fields.components[self.names.index(number.name)]
            bath = BathFields(salt, CF(first.hydraulic.at(time)))
        weight = None if setup.fluid_weight is None else followed(setup.fluid_weight, Clock(time))
        context = FieldContext(setup.material, self.kinematics, setup.charge.at(time), weight, bath)
        return self.model.state(fields.components[: len(self.model.unknowns)], context)


def _largest(values: NDArray) -> float:
    largest = float(np.abs(values).max())
    return largest if np.isfinite(largest) else np.inf
