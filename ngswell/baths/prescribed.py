"""Values of the unknowns prescribed on a bath's boundary: exact, or with the charge of the start."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from ngsolve import CoefficientFunction

from ngswell.baths.treatment import Charge, Prescribed, PrescribedBoundary
from ngswell.models.model import Model


@dataclass(frozen=True)
class Essential(Prescribed):
    """Prescribed values, for models whose unknowns in equilibrium with a bath do not depend on the charge: exact."""

    charge_of: ClassVar[Charge] = Charge.PRESENT

    def __str__(self) -> str:
        return "prescribed"

    def suits(self, model: Model) -> bool:
        return model.charge_field is None

    def values(self, on: PrescribedBoundary) -> dict[str, CoefficientFunction]:
        return on.equilibrium(None)


@dataclass(frozen=True)
class Frozen(Prescribed):
    """Prescribed values with the boundary charge of the start, whatever the deformation (Fig. 4, cfc = cfc0)."""

    charge_of: ClassVar[Charge] = Charge.START

    def __str__(self) -> str:
        return "prescribed with the charge of the start"

    def suits(self, model: Model) -> bool:
        return model.charge_field is not None

    def values(self, on: PrescribedBoundary) -> dict[str, CoefficientFunction]:
        return on.equilibrium(on.charge)
