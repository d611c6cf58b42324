"""A rigid plate that presses on a plane side of the body."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ngswell import checks
from ngswell.baths.bath import area
from ngswell.baths.treatment import Surroundings
from ngswell.errors import InputError
from ngswell.mesh.points import vertices, vertices_of
from ngswell.schedules import Schedule, schedule
from ngswell.setup.supports import Support, axis_across

LARGEST_PRESSURE = 1e3
"""Forces over the plate's area beyond this [N/mm²] are none that can be meant."""


@dataclass(frozen=True)
class Platen(Support):
    """A rigid plate on a plane side across an axis; it moves along that axis and does not tilt.

        Platen("top", displacement=Ramp((0, 0.0), (600, -0.1)))  # mm
        Platen("top", force=Ramp((0, 0.0), (10, -0.05)))

    Either `displacement` or `force` says how, a number or a history along the axis. `force` is in the units of `Reaction`:
    N/mm² on a column, N per mm of thickness in plane strain, N in space and on the whole circumference when axisymmetric;
    how far it pushes the plate is then an unknown. The side slides along the plate without friction, unless it is `glued`.
    Fluid passes where the side has a bath (`Bath(..., porous_plate=True)` where its pressure shall not press), else it is
    sealed. Raises InputError for a side that is curved, oblique or not in one plane, for forces beyond 1e3 N/mm², and where
    another support holds the side along the axis.
    """

    boundary: str
    displacement: float | Schedule | None = None
    force: float | Schedule | None = None
    glued: bool = False
    history: Schedule = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        checks.name("Platen: boundary", self.boundary, "top")
        checks.flag("Platen: glued", self.glued)
        if (self.displacement is None) == (self.force is None):
            raise InputError("Platen: give either displacement=, how far it moves [mm], or force=, what it pushes with")
        if self.force is None:
            history = schedule("Platen: displacement [mm]", self.displacement)  # type: ignore[arg-type]
        else:
            history = schedule("Platen: force", self.force)
        if not history.uniform:
            raise InputError("Platen: it is rigid, but what moves it varies in space; give a number or a Ramp")
        checks.set_fields(self, history=history)

    @property
    def schedules(self) -> tuple[Schedule, ...]:  # type: ignore[override]
        return (self.history,)

    def check_in(self, surroundings: Surroundings) -> None:
        surroundings.check_boundary("Platen", self.boundary)
        self._normal(surroundings)
        if self.force is not None:
            most, on = max(map(abs, self.history.values)), area(surroundings.mesh, surroundings.kinematics, self.boundary)
            if most > LARGEST_PRESSURE * on:
                raise InputError(
                    f"Platen on {self.boundary!r}: a force of {most:g} is more than {LARGEST_PRESSURE:g} N/mm² on its area "
                    f"of {on:g}; units are N and mm"
                )

    def fixed(self, surroundings: Surroundings) -> dict[str, str]:
        along = self._normal(surroundings)
        directions = surroundings.kinematics.directions if self.glued else along
        return dict.fromkeys(directions, self.boundary)

    def displacements(self, surroundings: Surroundings) -> dict[str, Schedule]:
        return {self._normal(surroundings): self.history} if self.force is None else {}

    def forces(self, surroundings: Surroundings) -> dict[str, Schedule]:
        return {} if self.force is None else {self._normal(surroundings): self.history}

    def _normal(self, surroundings: Surroundings) -> str:
        """The direction of the axis that the plate lies across."""
        mesh, kinematics = surroundings.mesh, surroundings.kinematics
        if mesh.dim == 1:
            if not kinematics.rigid_motions(np.zeros(1)).size:  # nothing moves as a whole along a radius
                raise InputError(
                    f"Platen on {self.boundary!r}: a cylinder or sphere has no plane side; take a Roller or a Pressure"
                )
            return kinematics.directions
        axis = axis_across(mesh, self.boundary)
        if axis is None:
            raise InputError(
                f"Platen on {self.boundary!r}: it needs a plane side across an axis, this one is curved or oblique"
            )
        at = vertices(mesh)[sorted(vertices_of(mesh, self.boundary)), axis]
        if np.ptp(at) > 1e-9 * np.abs(vertices(mesh)).max():
            raise InputError(f"Platen on {self.boundary!r}: it needs one plane side, this one is in several planes")
        return kinematics.directions[axis]
