"""What holds the body: rollers, symmetry planes, pins."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

import numpy as np
from ngsolve import Mesh, specialcf

from ngswell import checks
from ngswell.baths.treatment import Surroundings
from ngswell.errors import InputError
from ngswell.mesh.points import points, vertices
from ngswell.schedules import Schedule, schedule


@runtime_checkable
class Support(Protocol):
    """Displacements that are held. A support of one's own derives from this and gives, numbered:

    1. `check_in`: its refusals;
    2. `fixed`: boundaries on which it holds components of the displacement;
    3. `displacements`: the histories of those that move there; the others vanish;
    4. `forces`: the histories of forces under which they move there as one instead;
    5. `pins`: vertices at which components vanish;
    6. `schedules`: the histories that it follows, if any.
    """

    schedules: tuple[Schedule, ...] = ()

    def check_in(self, surroundings: Surroundings) -> None: ...

    def fixed(self, surroundings: Surroundings) -> dict[str, str]:
        """Boundaries ("a|b") by direction."""
        return {}

    def displacements(self, surroundings: Surroundings) -> dict[str, Schedule]:
        """Histories [mm] by direction, of the displacement on the boundaries of `fixed`: one number there at each time."""
        return {}

    def forces(self, surroundings: Surroundings) -> dict[str, Schedule]:
        """Histories of the force, in the units of `Reaction`, by direction; the displacement is one number, an unknown."""
        return {}

    def pins(self, surroundings: Surroundings) -> list[tuple[int, str]]:
        """Pairs of a vertex and a direction."""
        return []


@dataclass(frozen=True)
class Roller(Support):
    """The displacement in `direction` ("x", "y"; "xy" for both) is held on a boundary: at zero, or as `displacement` says.

        Roller("top", "y", Ramp((0, 0.0), (600, -0.1)))  # frictionless
        Roller("top", "xy", (0.0, Ramp((0, 0.0), (600, -0.1))))  # glued

    `displacement` [mm] is a number or a history, for several directions one each. A body that starts undeformed has to start
    with none. Like every boundary it is sealed unless it has a bath. Raises InputError for displacements that vary in space,
    are longer than ten times the body, or contradict another support.
    """

    boundary: str
    direction: str
    displacement: float | Schedule | tuple[float | Schedule, ...] = 0.0
    schedules: tuple[Schedule, ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        checks.name("Roller: boundary", self.boundary, "left|right")
        checks.name("Roller: direction", self.direction, "x")
        entries: Any = checks.as_tuple(self.displacement)
        if entries is None:
            still = checks.is_number(self.displacement) and self.displacement == 0
            entries = (self.displacement,) * (len(self.direction) if still else 1)
        histories = tuple(schedule("Roller: displacement [mm]", entry) for entry in entries)
        if len(histories) != len(self.direction):
            raise InputError(
                f"Roller: displacement in {self.direction!r} has to be {len(self.direction)} numbers or histories, one a "
                f"direction, got {checks.short(self.displacement)}"
            )
        if not all(history.uniform for history in histories):
            raise InputError("Roller: displacement varies in space; it has to be one number or history for a boundary")
        checks.set_fields(self, schedules=histories)

    def check_in(self, surroundings: Surroundings) -> None:
        surroundings.check_boundary("Roller", self.boundary)
        _check_directions("Roller", self.direction, surroundings)

    def fixed(self, surroundings: Surroundings) -> dict[str, str]:
        return dict.fromkeys(self.direction, self.boundary)

    def displacements(self, surroundings: Surroundings) -> dict[str, Schedule]:
        return dict(zip(self.direction, self.schedules, strict=True))


@dataclass(frozen=True)
class Symmetry(Support):
    """A symmetry plane: the displacement normal to a straight boundary along an axis vanishes; no flow through it."""

    boundary: str

    def __post_init__(self) -> None:
        checks.name("Symmetry: boundary", self.boundary, "left")

    def check_in(self, surroundings: Surroundings) -> None:
        wet = {name for bath in surroundings.baths for name in bath.boundary.split("|")}
        names = surroundings.check_boundary("Symmetry", self.boundary)
        self._normal(surroundings)
        for name in names:
            if name in wet:
                raise InputError(f"Symmetry on {name!r}: it has a bath, but nothing flows through a symmetry plane")

    def fixed(self, surroundings: Surroundings) -> dict[str, str]:
        return {self._normal(surroundings): self.boundary}

    def _normal(self, surroundings: Surroundings) -> str:
        """The direction of the plane's normal."""
        mesh = surroundings.mesh
        if mesh.dim == 1:  # an end has no points
            return surroundings.kinematics.directions
        axis = axis_across(mesh, self.boundary)
        if axis is None:
            raise InputError(f"Symmetry on {self.boundary!r}: the boundary is not straight along an axis")
        return surroundings.kinematics.directions[axis]


def axis_across(mesh: Mesh, boundary: str) -> int | None:
    """The axis that a boundary in 2-d or 3-d lies across everywhere; None for one that is curved or oblique."""
    normals = np.abs(specialcf.normal(mesh.dim)(points(mesh, mesh.Boundaries(boundary), 2)))
    axis = int(np.argmax(normals[0]))
    return axis if normals[:, axis].min() >= 1 - 1e-9 else None


@dataclass(frozen=True)
class Pin(Support):
    """The displacement in `direction` vanishes at the mesh vertex at `point` [mm]."""

    point: tuple[float, ...]
    direction: str

    def __post_init__(self) -> None:
        checks.set_fields(self, point=checks.vector("Pin: point", self.point, 1e6, "mm"))
        checks.name("Pin: direction", self.direction, "x")

    def check_in(self, surroundings: Surroundings) -> None:
        _check_directions("Pin", self.direction, surroundings)
        self._vertex(surroundings)

    def pins(self, surroundings: Surroundings) -> list[tuple[int, str]]:
        return [(self._vertex(surroundings), direction) for direction in self.direction]

    def _vertex(self, surroundings: Surroundings) -> int:
        places = vertices(surroundings.mesh)
        if len(self.point) != surroundings.mesh.dim:
            raise InputError(f"Pin at {self.point} needs {surroundings.mesh.dim} coordinates [mm]")
        distances = np.linalg.norm(places - np.array(self.point), axis=1)
        nearest = int(np.argmin(distances))
        if distances[nearest] > 1e-9 * max(1.0, float(np.abs(places).max())):
            raise InputError(f"Pin at {self.point}: no mesh vertex there; the nearest is {tuple(places[nearest])}")
        return nearest


def _check_directions(what: str, directions: str, surroundings: Surroundings) -> None:
    known = surroundings.kinematics.directions
    if any(direction not in known for direction in directions):
        raise InputError(f"{what}: direction {directions!r} is none of {', '.join(known)} (or several of them)")
    if len(set(directions)) < len(directions):
        raise InputError(f"{what}: direction {directions!r} names one twice")
