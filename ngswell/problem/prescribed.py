"""The boundary values that baths and moving supports prescribe."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from ngsolve import GridFunction
from numpy.typing import NDArray

from ngswell.baths.bath import Bath
from ngswell.baths.boundary import BathBoundary
from ngswell.baths.treatment import Charge, PrescribedBoundary
from ngswell.models.model import BathFields
from ngswell.problem.bounded import Bounded
from ngswell.problem.discretisation import Discretisation


class PrescribedValues:
    """Degrees of freedom on baths and the values they shall have, as treatments give them for a step or stage; displacements
    of supports at that time.

    Where two baths meet, the one that stands first in the scene prescribes. `fields` are those of the problem, `baths` the
    baths in the forms, by boundary.
    """

    def __init__(self, discretisation: Discretisation, fields: GridFunction, baths: dict[str, BathFields]) -> None:
        self._discretisation, self._fields, self._baths = discretisation, fields, baths
        self._treated = discretisation.setup.prescribed_baths
        self._held = np.zeros(0, dtype=int)
        self._wanted = np.zeros(discretisation.space.ndof)
        self._set: dict[tuple[str, str], Bounded] = {}
        charge = discretisation.model.charge_field
        self._charges: dict[Charge, GridFunction] = {}
        if charge is not None:
            self._charge_field = fields.components[discretisation.names.index(charge)]
            self._charges = {of: GridFunction(self._charge_field.space) for of in (Charge.START, Charge.LAST_STEP)}

    def remember(self, of: Charge) -> None:
        """Keep the present charge field as that of the start or of the last step."""
        if of in self._charges:
            self._charges[of].vec.data = self._charge_field.vec

    def update(self, time: float) -> None:
        """Take the values that hold at `time` [s], that of the baths."""
        pairs = [(dofs, np.full(dofs.size, history.at(time))) for dofs, history in self._discretisation.displaced]
        for bath, treatment in self._treated:
            on = PrescribedBoundary(
                self._boundaries[bath.boundary], self._charges.get(treatment.charge_of), self._equilibrium(bath.boundary)
            )
            for name, value in treatment.values(on).items():
                field = self._on_boundary(bath, name)
                field.set(value)
                dofs = self._dofs[name, bath.boundary]
                start = self._discretisation.ranges[name].start
                pairs.append((start + dofs, field.field.vec.FV().NumPy()[dofs]))
        for dofs, values in reversed(pairs):
            self._wanted[dofs] = values
        if pairs and not self._held.size:
            self._held = np.unique(np.concatenate([dofs for dofs, _ in pairs]))

    def _on_boundary(self, bath: Bath, name: str) -> Bounded:
        """A field with the values of an unknown on the boundary of a bath."""
        if (bath.boundary, name) not in self._set:
            component = self._fields.components[self._discretisation.names.index(name)]
            region = self._discretisation.mesh.Boundaries(bath.boundary)
            uniform = all(history.uniform for history in bath.schedules)
            self._set[bath.boundary, name] = Bounded(GridFunction(component.space), region, uniform)
        return self._set[bath.boundary, name]

    def gap(self, vector: NDArray) -> NDArray:
        """What `vector` exceeds the prescribed values by, where there are any; zero elsewhere."""
        gap = np.zeros(vector.size)
        gap[self._held] = vector[self._held] - self._wanted[self._held]
        return gap

    def _equilibrium(self, boundary: str) -> Any:
        model, material = self._discretisation.model, self._discretisation.setup.material
        return lambda charge: model.equilibrium(self._baths[boundary], charge, material)

    @cached_property
    def _boundaries(self) -> dict[str, BathBoundary]:
        all_baths, weight = "|".join(self._baths), self._discretisation.kinematics.weight
        mesh = self._discretisation.mesh
        return {boundary: BathBoundary(mesh, boundary, all_baths, weight) for boundary in self._baths}

    @cached_property
    def _dofs(self) -> dict[tuple[str, str], NDArray]:
        """Degrees of freedom of the unknowns that baths hold, on each of their boundaries."""
        problem = self._discretisation
        found = {}
        for name in problem.model.balanced.values():
            space = self._fields.components[problem.names.index(name)].space
            for boundary in self._baths:
                found[name, boundary] = np.flatnonzero(list(space.GetDofs(problem.mesh.Boundaries(boundary))))
        return found
