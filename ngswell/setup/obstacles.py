"""Rigid obstacles: frictionless unilateral contact of a boundary with planes, spheres and cylinders."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from ngsolve import CF, CoefficientFunction, IfPos, InnerProduct, Mesh, x, y, z
from numpy.typing import NDArray

from ngswell import checks
from ngswell.baths.treatment import Surroundings
from ngswell.errors import InputError, place
from ngswell.mesh.points import points_and_corners, vertices_of
from ngswell.mesh.sizes import cell_size
from ngswell.models.term import Role, Term
from ngswell.schedules import Clock, Schedule, schedule
from ngswell.setup.loads import Load
from ngswell.setup.rigid import FARTHEST, RigidPlane, Shape

TOUCHING = 1e-9
"""Share of the size of a cell by which an undeformed body that touches an obstacle may overlap it by round-off."""

PRESSED = 10.0
"""The same, times the penalty, of a body that is pressed against it already: with a pressure so many times 2µ + λ."""

SIDEWAYS = 1e-9
"""Component of the direction away from an obstacle below which it does not push there."""


@dataclass(frozen=True)
class Obstacle(Load):
    """A rigid obstacle that a boundary touches without friction, and leaves again: pressed, never pulled.

        Obstacle("top", RigidPlane((0.0, 1.2), (0.0, -1.0)))
        Obstacle("top", RigidSphere((0.0, 6.0), 5.0), displacement=(0.0, Ramp((0, 0.0), (10, -0.1))))

    With the gap g = d(x + u − displacement), d the distance from the `shape`, the obstacle pushes with k ⟨−g⟩ per
    reference area along grad d: a penalty, k = `penalty` (2µ + λ)/h, h the size of the cells normal to the boundary. What it
    is pressed in by is p h/[penalty (2µ + λ)] under a pressure p. `displacement` [mm] is one number or history a direction.

    Only this boundary touches; `OverlapWarning` says where another one is within the obstacle. Where it has a bath, fluid
    and salt pass as before: the obstacle is porous. Elsewhere it is sealed. An obstacle does not hold a body: supports do.
    Raises InputError for an obstacle that overlaps the body at the start, that pushes only where supports hold, or that has
    no meaning in the motion.
    """

    boundary: str
    shape: Shape
    displacement: tuple[float | Schedule, ...] | None = None
    penalty: float = 1e3
    schedules: tuple[Schedule, ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        checks.name("Obstacle: boundary", self.boundary, "top")
        checks.instance("Obstacle: shape", self.shape, Shape, "a RigidPlane, a RigidSphere or a RigidCylinder")
        checks.set_fields(self, penalty=checks.number("Obstacle: penalty", self.penalty, low=1.0, high=1e6))
        entries = (0.0,) * len(self.shape.at) if self.displacement is None else checks.as_tuple(self.displacement)
        if entries is None or len(entries) != len(self.shape.at):
            raise InputError(
                f"Obstacle: displacement has to be {len(self.shape.at)} numbers or histories, one a direction, got "
                f"{checks.short(self.displacement)}"
            )
        histories = tuple(schedule("Obstacle: displacement [mm]", entry) for entry in entries)
        for history in histories:
            if not history.uniform:
                raise InputError("Obstacle: displacement varies in space; the obstacle is rigid: give a number or a history")
            for value in history.values:
                checks.number("Obstacle: displacement", value, "mm", -FARTHEST, FARTHEST)
        checks.set_fields(self, schedules=histories)

    def check_in(self, surroundings: Surroundings) -> None:
        names, kinematics = surroundings.check_surface("Obstacle", self.boundary), surroundings.kinematics
        if len(self.shape.at) != kinematics.dimension:
            raise InputError(f"Obstacle: {self.shape!r} needs {kinematics.dimension} coordinates [mm]")
        self.shape.check(kinematics)
        sideways = kinematics.dimension == 2 and kinematics.power == 3 and any(self.schedules[0].values)
        if sideways and not checks.is_a(self.shape, RigidPlane):
            raise InputError("Obstacle: axisymmetric it moves along the axis only: its displacement along r has to be 0.0")
        self._check_held(names, surroundings)
        if surroundings.origin is None:
            self._check_overlap(surroundings.mesh, CF((0.0,) * kinematics.dimension), surroundings.start, TOUCHING)

    def check_start(self, state: Any, time: float) -> None:
        self._check_overlap(state.mesh, state.u, time, PRESSED / self.penalty)

    def _check_held(self, names: list[str], surroundings: Surroundings) -> None:
        """Refuse a boundary that supports hold wherever the obstacle would push it to."""
        fixed, mesh = surroundings.fixed(), surroundings.mesh
        _, away = self.shape.gap(_seen_from(mesh, self.shape.at))
        for name in names:
            sizes = np.abs(_on(mesh, name, away)).max(axis=0)
            pushed = [d for d, size in zip(surroundings.kinematics.directions, sizes, strict=True) if size > SIDEWAYS]
            if all(name in fixed[direction].split("|") for direction in pushed):
                raise InputError(f"Obstacle on {name!r}: a support holds it where the obstacle pushes, so it has no effect")

    def amiss(self, state: Any, time: float) -> str | None:
        """Whether a boundary that does not touch it is within it."""
        mesh, own = state.mesh, self.boundary.split("|")
        allowed = PRESSED / self.penalty * cell_size(mesh, self.boundary)
        for name in sorted(set(mesh.GetBoundaries()) - set(own)):
            found = self._overlap(mesh, name, state.u, time, allowed)
            if found is not None:
                depth, where = found
                return (
                    f"{name!r} is {depth:.3g} mm within the obstacle on {self.boundary!r} near {where} mm of the undeformed "
                    f"body: only {self.boundary!r} touches it. Remedy: Obstacle('{self.boundary}|{name}', ...)"
                )
        return None

    def _check_overlap(self, mesh: Mesh, u: CoefficientFunction, time: float, share: float) -> None:
        """Refuse to start within the obstacle, by more than a share of a cell."""
        found = self._overlap(mesh, self.boundary, u, time, share * cell_size(mesh, self.boundary))
        if found is not None:
            raise InputError(
                f"Obstacle on {self.boundary!r}: at the start ({time:g} s) it overlaps the body by {found[0]:.3g} mm "
                f"near {found[1]} mm; let it start where it touches at most, and move it from there"
            )

    def _overlap(
        self, mesh: Mesh, boundary: str, u: CoefficientFunction, time: float, allowed: float
    ) -> tuple[float, str] | None:
        """How far [mm] a boundary is within the obstacle, and where most, if by more than is `allowed` [mm]."""
        at = [start + history.at(time) for start, history in zip(self.shape.at, self.schedules, strict=True)]
        gaps = _on(mesh, boundary, self.shape.gap(_seen_from(mesh, at) + u)[0]).ravel()
        worst = int(np.argmin(gaps))
        if gaps[worst] >= -allowed:
            return None
        return -gaps[worst], place(_on(mesh, boundary, _seen_from(mesh, (0.0,) * mesh.dim))[worst])

    def terms(self, state: Any, v: CoefficientFunction, clock: Clock) -> list[Term]:
        mesh, material = state.mesh, state.material
        stiffness = 2 * material.largest("mu", mesh) + material.largest("lam", mesh)
        moved = [start + clock.follow(history) for start, history in zip(self.shape.at, self.schedules, strict=True)]
        gap, normal = self.shape.gap(_seen_from(mesh, moved) + state.u)
        pressure = self.penalty * stiffness / cell_size(mesh, self.boundary) * IfPos(gap, 0.0, -gap)
        push = -pressure * InnerProduct(normal, v)
        return [Term("momentum", "obstacle", push, role=Role.CONTACT, boundary=self.boundary, kinked=True)]


def _seen_from(mesh: Mesh, at: Any) -> CoefficientFunction:
    """Places of the undeformed body as seen from a point."""
    return CF((x, y, z)[: mesh.dim]) - CF(tuple(at))


def _on(mesh: Mesh, boundary: str, field: CoefficientFunction) -> NDArray:
    """A field at places of a boundary, its corners among them, one row each."""
    if mesh.dim == 1:  # an end has no integration points
        where = [mesh(*mesh.vertices[number].point) for number in sorted(vertices_of(mesh, boundary))]
        return np.array([np.ravel(field(point)) for point in where])
    values = np.asarray(field(points_and_corners(mesh, mesh.Boundaries(boundary), 4)))
    return values.reshape(len(values), -1)
